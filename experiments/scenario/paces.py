"""What only some paces can do: carrier sense needs promises, a hog needs the wall clock."""

from __future__ import annotations

from collections.abc import Iterable

from ...errors import BadInput
from ...transport.faults import Fault, Hog, LinkFault
from ...transport.media_settings import Csma, HalfDuplex, Medium


def check_pace(media: Iterable[Medium], faults: Iterable[Fault], *, realtime: bool) -> None:
    """Check media and faults against the pace.

    Args:
        media: of links, before faults.
        faults: of a timeline, or live ones.
        realtime: whether agents follow the wall clock come what may.
    Raises:
        BadInput: carrier sense in realtime pace, from the start or by a fault, or a hog in another pace.
    """
    faults = list(faults)
    changed = (
        fault.changes["medium"] for fault in faults if isinstance(fault, LinkFault) and "medium" in fault.changes
    )
    if realtime and any(_senses(medium) for medium in (*media, *changed)):
        raise BadInput(
            "csma listens for what began microseconds ago, which no process can know by the wall clock alone: "
            "leave out --pace realtime"
        )
    hogs = [fault.id for fault in faults if isinstance(fault, Hog)]
    if hogs and not realtime:
        text = "a hog needs realtime pace: elsewhere nominal time does not depend on the processor"
        raise BadInput(f"fault {', '.join(hogs)}: {text}")


def _senses(medium: Medium | None) -> bool:
    return isinstance(medium, HalfDuplex) and isinstance(medium.access, Csma)
