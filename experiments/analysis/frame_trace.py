"""The journal of a run as lines in the order of time: every frame once, and what faults and deaths came in between.

A frame stands at the start of its transmission, or where it was dropped if it never had one; a frame of which no time
is known stands after the one before it on its link.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from ...topologies import natural_key
from ...transport.faults import Fault, LinkFault, LinkName
from ..record.frame_fates import FATES, FrameFate, frame_fates, is_lost
from ..record.record import Record
from ..scenario.fault_labels import fault_label

ANY_LOSS = "lost"
"""Stands for every cause of a loss."""
SELECTABLE = (*FATES, ANY_LOSS)
"""What lines can be asked for by."""
_OF_AGENTS = ("died", "restarted")


@dataclass(frozen=True)
class Selection:
    """Which lines are wanted: of these links, touching these agents, with these fates, in [from, until); None: any.

    Faults and deaths are shown where they concern one of the links or agents, unless fates are asked for.
    """

    links: frozenset[LinkName] | None = None
    agents: frozenset[str] | None = None
    fates: frozenset[str] | None = None
    from_ns: int = 0
    until_ns: int | None = None

    def wants_link(self, link: LinkName) -> bool:
        """Whether frames of a link are wanted."""
        return (self.links is None or link in self.links) and (self.agents is None or not self.agents.isdisjoint(link))

    def wants_agent(self, agent: str) -> bool:
        """Whether what happens to an agent is wanted."""
        touched = self.links is None or any(agent in link for link in self.links)
        return touched and (self.agents is None or agent in self.agents)

    def wants_fate(self, fate: str) -> bool:
        """Whether frames of a fate are wanted."""
        return self.fates is None or fate in self.fates or (ANY_LOSS in self.fates and is_lost(fate))

    def wants_time(self, time_ns: int) -> bool:
        """Whether an instant lies in the span."""
        return self.from_ns <= time_ns and (self.until_ns is None or time_ns < self.until_ns)


class Entry(NamedTuple):
    """A line of the trace: when, in words, and as plain values."""

    time_ns: int
    text: str
    values: Mapping[str, Any]

    def __str__(self) -> str:
        """The line."""
        return f"{self.time_ns / 1e9:12.6f} s  {self.text}"


def trace(record: Record, selection: Selection) -> list[Entry]:
    """The lines that are wanted, in the order of time, at one instant faults first and links in their order."""
    entries = [*_faults(record, selection), *_events(record, selection)] if selection.fates is None else []
    entries += _frames(record, selection)
    return sorted((entry for entry in entries if selection.wants_time(entry.time_ns)), key=lambda entry: entry.time_ns)


def _frames(record: Record, selection: Selection) -> Iterator[Entry]:
    for link, frames in frame_fates(record).items():
        if not selection.wants_link(link):
            continue
        time_ns = 0
        for frame in frames:
            known = (frame.start_ns, frame.dropped_ns, frame.due_ns)
            time_ns = next((time for time in known if time is not None), time_ns)
            if selection.wants_fate(frame.fate):
                values = {"what": "frame", "time_ns": time_ns, **frame._asdict()}
                yield Entry(time_ns, frame_text(frame), values)


def frame_text(frame: FrameFate) -> str:
    """A frame in words: link, number, size, airtime, due, fate and remarks."""
    link = f"{frame.source}→{frame.target}"
    number = f"#{frame.sequence}" + (f" life {frame.incarnation}" if frame.incarnation else "")
    size = "" if frame.size is None else f"{frame.size} B"
    airtime = "" if frame.airtime_ns is None else f"on air {frame.airtime_ns / 1e6:.3f} ms"
    due = "" if frame.due_ns is None else f"due {frame.due_ns / 1e9:.6f} s"
    notes = [
        (bool(frame.copy), "duplicate"),
        (frame.held_until_ns is not None, f"held until {(frame.held_until_ns or 0) / 1e9:.6f} s"),
        (frame.behind_ns is not None, f"{(frame.behind_ns or 0) / 1e6:.3f} ms late"),
        (frame.contradicted, "accounts contradict each other"),
    ]
    fate = ", ".join([frame.fate, *(text for holds, text in notes if holds)])
    return f"{link:<9} {number:<8} {size:>7}  {airtime:<16}  {due:<18}  {fate}"


def _faults(record: Record, selection: Selection) -> Iterator[Entry]:
    for fault in record.faults:
        if not _concerns(fault, selection):
            continue
        label = fault_label(fault, len(record.plan.links))
        for time_ns, does in ((fault.at_ns, "begins"), (fault.until_ns, "ends")):
            if time_ns is not None and time_ns < record.last_ns:
                values = {"what": "fault", "time_ns": time_ns, "id": fault.id, "does": does, "label": label}
                yield Entry(time_ns, f"fault {fault.id} {does}: {label}", values)


def _concerns(fault: Fault, selection: Selection) -> bool:
    if isinstance(fault, LinkFault):
        return any(selection.wants_link(link) for link in fault.links)
    return selection.wants_agent(fault.agent)


def _events(record: Record, selection: Selection) -> Iterator[Entry]:
    for event in record.events:
        if event["event"] in _OF_AGENTS and selection.wants_agent(event["agent"]):
            why = f": {event['cause']}" if "cause" in event else ""
            text = f"agent {event['agent']} {event['event']}{why}, life {event['incarnation']}"
            yield Entry(event["time_ns"], text, {"what": "agent", **event})


def agents_of(record: Record) -> Collection[str]:
    """The names of the agents, in natural order."""
    return sorted((agent.name for agent in record.plan.agents), key=natural_key)
