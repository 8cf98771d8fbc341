"""What one pace can do and the others cannot: carrier sense needs nominal time, a hog needs the clock."""

from __future__ import annotations

from collections.abc import Iterable

from ...errors import BadInput
from ...transport.faults import Fault, Hog, LinkFault
from ...transport.media_settings import Csma, HalfDuplex, Medium


def check_pace(media: Iterable[Medium], faults: Iterable[Fault], *, realtime: bool) -> None:
    """Refuse what a pace cannot do.

    Args:
        media: of links, before faults.
        faults: of a timeline, or live ones.
        realtime: whether agents go by the wall clock.
    Raises:
        BadInput: carrier sense by the wall clock, at the start or by a fault, or a hog elsewhere.
    """
    faults = list(faults)
    changed = (
        fault.changes["medium"] for fault in faults if isinstance(fault, LinkFault) and "medium" in fault.changes
    )
    if realtime and any(_senses(medium) for medium in (*media, *changed)):
        raise BadInput(
            "csma listens for what began microseconds ago, which no process can know by the wall clock: "
            "add --pace lockstep or --engine twin"
        )
    hogs = [fault.id for fault in faults if isinstance(fault, Hog)]
    if hogs and not realtime:
        text = "a hog needs realtime pace: elsewhere nominal time does not depend on the processor"
        raise BadInput(f"fault {', '.join(hogs)}: {text}")


def _senses(medium: Medium | None) -> bool:
    return isinstance(medium, HalfDuplex) and isinstance(medium.access, Csma)
