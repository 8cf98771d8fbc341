"""What became of every frame: the entries of its sender and of its receiver, joined and decided here and nowhere else.

A frame is known by link, incarnation of its sender, sequence number and copy, which is 1 for a duplicate. Each sequence
number below the next one of an incarnation was offered once, and has one fate; a duplicate has one if its sender or its
receiver has an entry of it. Where there is no entry, and no known reason for that, the frame is missing.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

from ...agents.journal import Arrived, Batch, Dropped, Heard, Late, Released, Sent
from ...transport.faults import Kill, LinkName
from ...transport.links import ACCESS, COLLISION, CORRUPT, CUT, DELIVERED, HALF_DUPLEX, LOST
from .record import Life, Record

REFUSED, QUEUE = "refused", "queue"
IN_FLIGHT, UNKNOWN, MISSING = "in-flight", "unknown", "missing"
RECEIVER_DOWN, SENDER_DOWN = "receiver-down", "sender-down"


class FateClass(Enum):
    """The meaning of a fate; only delivered frames and those lost on the air were transmitted."""

    DELIVERED = "delivered"
    LOST_ON_AIR = "transmitted, and lost on its way or at its receiver"
    LOST_BEFORE_AIR = "accepted by its link, and lost before it was transmitted"
    DISCARDED = "never on the air: not accepted, or replaced in the queue"
    IN_FLIGHT = "waiting, transmitted or held when the run ended"
    UNKNOWN = "not recorded, as an end of its link was killed from outside"
    MISSING = "not recorded for no known reason: lost by the middleware"


FATES: dict[str, FateClass] = {
    DELIVERED: FateClass.DELIVERED,
    CUT: FateClass.LOST_ON_AIR,
    HALF_DUPLEX: FateClass.LOST_ON_AIR,
    COLLISION: FateClass.LOST_ON_AIR,
    LOST: FateClass.LOST_ON_AIR,
    CORRUPT: FateClass.LOST_ON_AIR,
    RECEIVER_DOWN: FateClass.LOST_ON_AIR,
    ACCESS: FateClass.LOST_BEFORE_AIR,
    SENDER_DOWN: FateClass.LOST_BEFORE_AIR,
    REFUSED: FateClass.DISCARDED,
    QUEUE: FateClass.DISCARDED,
    IN_FLIGHT: FateClass.IN_FLIGHT,
    UNKNOWN: FateClass.UNKNOWN,
    MISSING: FateClass.MISSING,
}
"""Every fate that a frame can have, and its class."""


def is_lost(fate: str) -> bool:
    """Whether a fate is the cause of a loss."""
    return FATES[fate] in (FateClass.LOST_ON_AIR, FateClass.LOST_BEFORE_AIR)


def is_transmitted(fate: str) -> bool:
    """Whether a frame of this fate was on the air, and its way is over."""
    return FATES[fate] in (FateClass.DELIVERED, FateClass.LOST_ON_AIR)


class FrameFate(NamedTuple):
    """One frame. Times in nanoseconds, size in bytes of payload; None where it never came so far, or is not recorded.

    `fate` is one of FATES. `held_until_ns`: when a link that held it back let it go. `arrived_ns`: when it really came,
    by the wall clock as nominal time, in realtime pace only. `handed_ns`: when its receiver was handed it, lost or not:
    in realtime pace by the wall clock, else when it was due or let go. `late_ns`: by how much it really came later than
    that, 0 for in time. `behind_ns`: how far its receiver had passed it already, for a late frame.
    `contradicted`: two entries of this frame cannot both be true.
    """

    source: str
    target: str
    incarnation: int
    sequence: int
    copy: int
    size: int | None
    start_ns: int | None
    airtime_ns: int | None
    due_ns: int | None
    verdict: str | None
    dropped_ns: int | None
    held_until_ns: int | None
    arrived_ns: int | None
    handed_ns: int | None
    late_ns: int | None
    behind_ns: int | None
    fate: str
    contradicted: bool

    @property
    def latency_ns(self) -> int | None:
        """From the last bit out to due, or to when it really came if that was later; without the time it was held."""
        if self.start_ns is None or self.airtime_ns is None or self.due_ns is None:
            return None
        return self.due_ns - self.start_ns - self.airtime_ns + (self.late_ns or 0)


Fates = Mapping[LinkName, Sequence[FrameFate]]
"""Directed link → its frames, in the order of incarnation and sequence number."""
_KNOWN: WeakKeyDictionary[Record, Fates] = WeakKeyDictionary()
"""Those of each record, for as long as anybody holds it: tables and figures ask for them again and again."""


def frame_fates(record: Record) -> Fates:
    """Every frame of each directed link; without those on wires."""
    if record not in _KNOWN:
        _KNOWN[record] = _joined(record)
    return _KNOWN[record]


def _joined(record: Record) -> Fates:
    journals: defaultdict[_LinkLife, _LinkJournal] = defaultdict(_LinkJournal)
    for batch in record.batches.values():
        for source, number, name, entry in _entries(batch):
            journals[source].frame(number).put(name, entry)
    absences = _Absences(record, record.last_ns)
    found: dict[LinkName, list[FrameFate]] = {link: [] for link in record.links()}
    for (link, incarnation), journal in sorted(journals.items(), key=lambda item: item[0][1]):
        if link not in record.plan.wires:
            found[link] += _fates_of((link, incarnation), journal, absences)
    return found


class FateCounts:
    """How many frames have met which fate, batch by batch as agents report; frames that are settled are forgotten."""

    def __init__(self) -> None:
        self._settled: Counter[str] = Counter()
        self._journals: defaultdict[_LinkLife, _LinkJournal] = defaultdict(_LinkJournal)

    def take(self, batch: Batch) -> None:
        """Count what a batch settles."""
        for source, number, name, entry in _entries(batch):
            journal = self._journals[source]
            frame = journal.frame(number)
            frame.put(name, entry)
            if frame.complete:
                self._settled[frame.settled or MISSING] += 1
                del journal.frames[number]

    def so_far(self, record: Record, now_ns: int) -> Counter[str]:
        """Fate → frames; without those that are under way or not reported yet.

        Args:
            record: what happened to the run so far; its batches are not looked at.
            now_ns: nominal time.
        """
        absences = _Absences(record, now_ns)
        fates = Counter(
            _fate(source, journal, frame, absences)
            for source, journal in self._journals.items()
            if source[0] not in record.plan.wires
            for frame in journal.frames.values()
        )
        known = {fate: count for fate, count in fates.items() if is_lost(fate) or is_transmitted(fate)}
        return self._settled + Counter(known)


# -- what the two ends of a link wrote down -----------------------------------------------------------------------

Number = tuple[int, int]
"""Sequence number and copy."""
_LinkLife = tuple[LinkName, int]
"""A directed link and the incarnation of its source."""


def _entries(batch: Batch) -> Iterator[tuple[_LinkLife, Number, str, Any]]:
    """All entries of a batch about frames: link and incarnation, number, field of `_Frame`, and the entry."""
    agent, life = batch.agent, batch.incarnation
    of_receiver = (
        ("released", batch.released),
        ("arrived", batch.arrived),
        ("late", batch.late),
        ("heard", batch.heard),
    )
    for name, entries in of_receiver:
        for entry in entries:
            yield ((entry.source, agent), entry.incarnation), (entry.sequence, entry.copy), name, entry
    for sent in batch.sent:
        yield ((agent, sent.target), life), (sent.sequence, sent.copy), "sent", sent
    for dropped in batch.dropped:
        yield ((agent, dropped.target), life), (dropped.sequence, 0), "dropped", dropped
    for event in batch.events:
        if event["event"] == "queued":
            for sequence in event["sequences"]:
                yield ((agent, event["target"]), life), (sequence, 0), "queued", True
        elif event["event"] == "held":
            for sequence, copy in event["sequences"]:
                yield ((event["source"], agent), event["incarnation"]), (sequence, copy), "holder", life


@dataclass(slots=True)
class _Frame:
    """The entries of one frame. `queued`: it waited at the end of its sender's life.

    `holder`: the life of its receiver that held it back to the last. `repeated`: there are two entries of one kind.
    """

    sent: Sent | None = None
    dropped: Dropped | None = None
    queued: bool = False
    heard: Heard | None = None
    holder: int | None = None
    released: Released | None = None
    arrived: Arrived | None = None
    late: Late | None = None
    repeated: bool = False

    def put(self, name: str, entry: Any) -> None:
        """Add an entry."""
        self.repeated |= name in _ONCE and getattr(self, name) is not None
        setattr(self, name, entry)

    @property
    def settled(self) -> str | None:
        """The fate that its receiver or its sender gave it; None if it follows from their deaths."""
        if self.heard is not None:
            return self.heard.fate
        return None if self.dropped is None else self.dropped.cause

    @property
    def complete(self) -> bool:
        """Whether nothing more is to be expected of it."""
        return self.dropped is not None or (self.sent is not None and self.heard is not None)

    @property
    def contradicted(self) -> bool:
        """Whether two entries cannot both be true; that its sender has none is no contradiction here."""
        if self.repeated or (self.sent is not None) + (self.dropped is not None) + self.queued > 1:
            return True
        if self.heard is None or self.sent is None:
            return False
        lost = self.sent.verdict != DELIVERED
        return self.sent.due_ns != self.heard.due_ns or (self.heard.fate == DELIVERED and lost)


_ONCE = ("sent", "dropped", "heard")
_NO_ENTRY = _Frame()


class _LinkJournal:
    """The entries of one link and incarnation of its source, by frame."""

    def __init__(self) -> None:
        self.frames: dict[Number, _Frame] = {}

    def frame(self, number: Number) -> _Frame:
        """A frame, with no entries if there was none so far."""
        found = self.frames.get(number)
        if found is None:
            found = self.frames[number] = _Frame()
        return found

    @cached_property
    def _newest_heard(self) -> tuple[float, int]:
        """Start and copy of the newest transmission with an entry of its receiver; those without a start are newer."""
        starts = (
            (math.inf if frame.sent is None else frame.sent.start_ns, copy)
            for (_, copy), frame in self.frames.items()
            if frame.heard is not None or frame.holder is not None
        )
        return max(starts, default=(-1, 0))

    def is_last(self, sent: Sent) -> bool:
        """Whether the receiver has no entry of anything transmitted after this frame."""
        return (sent.start_ns, sent.copy) > self._newest_heard

    def numbers(self) -> list[Number]:
        """Every frame that must have a fate: all sequence numbers so far, and the duplicates that have entries."""
        last = max((sequence for sequence, _ in self.frames), default=-1)
        return sorted([*((sequence, 0) for sequence in range(last + 1)), *(one for one in self.frames if one[1])])


# -- what follows from it -----------------------------------------------------------------------------------------


class _Absence(NamedTuple):
    """A span in which an agent was dead; if that was not `injected`, its beginning is not known exactly."""

    from_ns: int
    until_ns: int
    injected: bool


class _Absences:
    """Who was dead when, up to an instant, and whose entries may be incomplete for that."""

    def __init__(self, record: Record, end_ns: int) -> None:
        self.end_ns = end_ns
        self.broken_off = record.broken_off
        self.of: dict[str, list[_Absence]] = defaultdict(list)
        self.kills: Counter[str] = Counter()
        for fault in record.faults:
            if isinstance(fault, Kill) and fault.at_ns < self.end_ns:
                until_ns = self._until_ns(record, (fault.agent, self.kills[fault.agent]))
                self.of[fault.agent].append(_Absence(fault.at_ns, until_ns, True))
                self.kills[fault.agent] += 1
        for life in self.broken_off:
            from_ns = record.batches[life].last_ns if life in record.batches else 0
            self.of[life[0]].append(_Absence(from_ns, self._until_ns(record, life), False))

    def _until_ns(self, record: Record, life: Life) -> int:
        restart_ns = record.restart_ns(*life)
        return self.end_ns if restart_ns is None else restart_ns


def _fates_of(source: _LinkLife, journal: _LinkJournal, absences: _Absences) -> Iterator[FrameFate]:
    for number in journal.numbers():
        frame = journal.frames.get(number, _NO_ENTRY)
        yield _frame_fate(source, number, frame, _fate(source, journal, frame, absences), absences)


def _frame_fate(source: _LinkLife, number: Number, frame: _Frame, fate: str, absences: _Absences) -> FrameFate:
    """All that is known of one frame."""
    (sender, target), incarnation = source
    sent, heard, arrived = frame.sent, frame.heard, frame.arrived
    due_ns = sent.due_ns if sent else heard.due_ns if heard else None
    held_until_ns = frame.released.time_ns if frame.released else None
    expected_ns = due_ns if held_until_ns is None else held_until_ns
    unexplained = heard is not None and sent is None and (sender, incarnation) not in absences.broken_off
    return FrameFate(
        source=sender,
        target=target,
        incarnation=incarnation,
        sequence=number[0],
        copy=number[1],
        size=sent.size if sent else None,
        start_ns=sent.start_ns if sent else None,
        airtime_ns=sent.airtime_ns if sent else None,
        due_ns=due_ns,
        verdict=sent.verdict if sent else None,
        dropped_ns=frame.dropped.time_ns if frame.dropped else None,
        held_until_ns=held_until_ns,
        arrived_ns=arrived.arrived_ns if arrived else None,
        handed_ns=arrived.handed_ns if arrived else expected_ns if heard else None,
        late_ns=max(0, arrived.arrived_ns - (expected_ns or 0)) if arrived else 0 if heard else None,
        behind_ns=frame.late.behind_ns if frame.late else None,
        fate=fate,
        contradicted=frame.contradicted or unexplained,
    )


def _fate(source: _LinkLife, journal: _LinkJournal, frame: _Frame, absences: _Absences) -> str:
    """The fate of a frame: by the entries of its ends, else by their deaths."""
    (sender, target), incarnation = source
    if frame.settled is not None:
        return frame.settled
    if frame.queued:
        return SENDER_DOWN if absences.kills[sender] > incarnation else IN_FLIGHT
    if frame.holder is not None:
        return RECEIVER_DOWN if absences.kills[target] > frame.holder else IN_FLIGHT
    broken_off = (sender, incarnation) in absences.broken_off
    if frame.sent is None:
        return UNKNOWN if broken_off else MISSING
    return _unheard(target, frame.sent, absences, last=journal.is_last(frame.sent), broken_off=broken_off)


def _unheard(target: str, sent: Sent, absences: _Absences, *, last: bool, broken_off: bool) -> str:
    """The fate of a transmitted frame that its receiver has no entry of.

    Args:
        target: its receiver.
        sent: its sender's entry.
        absences: who was dead when.
        last: its receiver has no entry of anything transmitted after it.
        broken_off: its sender's entries may stop before its end.
    """
    if sent.due_ns >= absences.end_ns:
        return IN_FLIGHT
    for absence in absences.of[target]:
        was_due = sent.due_ns >= absence.from_ns or (last and not absence.injected)
        if sent.start_ns < absence.until_ns and was_due:
            return RECEIVER_DOWN if absence.injected else UNKNOWN
    return UNKNOWN if broken_off and last else MISSING
