"""How much of the time each medium carried something: a direction, both directions of an edge, or an agent's radio."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...topologies import natural_key
from ...transport.faults import LinkName
from ...transport.media import HalfDuplex, Medium, on_air
from ..record.frame_fates import FrameFate
from ..record.record import Record


def medium_name(link: LinkName, medium: Medium) -> str:
    """What a link goes over: "3>7" a direction of its own, "3-7" the edge in turns, "radio 3" that of its source."""
    if on_air(medium):
        return f"radio {link[0]}"
    if isinstance(medium, HalfDuplex):
        return "-".join(sorted(link, key=natural_key))
    return ">".join(link)


def airtime_utilisation(record: Record, fates: Mapping[LinkName, Sequence[FrameFate]]) -> dict[str, float]:
    """Medium → airtime of all that went over it, over the length of the run; what all neighbours hear counts once."""
    used: dict[str, set[tuple[str, int, int, int]]] = {}
    for link, frames in fates.items():
        mine = used.setdefault(medium_name(link, record.plan.links[link].medium), set())
        mine.update(
            (link[0], frame.incarnation, frame.start_ns, frame.airtime_ns)
            for frame in frames
            if frame.start_ns is not None and frame.airtime_ns is not None
        )
    elapsed = record.last_ns or 1
    return {name: sum(airtime for *_, airtime in once) / elapsed for name, once in used.items()}
