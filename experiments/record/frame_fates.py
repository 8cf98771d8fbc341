"""The whole story of every frame: what its sender and its receiver wrote down, put together into one fate.

A frame is known by link, incarnation of its sender, sequence number and copy, which is 1 for a duplicate. Every number
below an incarnation's next one has exactly one story; where nobody wrote one, and no reason for that is known, the
frame is missing. A duplicate has a story of its own if its sender or its receiver tells of it.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, TypeVar

from ...agents.journal import Dropped, Heard, Late, Sent
from ...transport.faults import Kill, LinkName
from ...transport.links import DELIVERED
from .record import Life, Record, last_ns

_Entry = TypeVar("_Entry", Sent, Dropped, Heard)
REFUSED, QUEUE, ACCESS = "refused", "queue", "access"
IN_FLIGHT, UNKNOWN, MISSING = "in-flight", "unknown", "missing"
RECEIVER_DOWN, SENDER_DOWN = "receiver-down", "sender-down"


class FrameFate(NamedTuple):
    """One frame. Times in nanoseconds, size in bytes of payload; None where it never came so far, or nobody told.

    `fate` is refused, queue, delivered, in-flight, unknown, missing, or the cause of its loss.
    `contradicted`: two accounts of this frame cannot both be true.
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
    behind_ns: int | None
    fate: str
    contradicted: bool


Number = tuple[int, int]
"""Sequence number and copy."""


@dataclass
class _Told:
    """Accounts of the frames of one link and incarnation, by sequence number."""

    sent: dict[Number, Sent] = field(default_factory=dict)
    dropped: dict[Number, Dropped] = field(default_factory=dict)
    queued: set[Number] = field(default_factory=set)
    heard: dict[Number, Heard] = field(default_factory=dict)
    held: dict[Number, int] = field(default_factory=dict)
    """Number → the life of the receiver that held it back to the last."""
    late: dict[Number, Late] = field(default_factory=dict)
    twice: set[Number] = field(default_factory=set)

    @cached_property
    def last_heard(self) -> int:
        """The last sequence number that the receiver wrote down, −1 for none."""
        return max((sequence for sequence, _ in (*self.heard, *self.held)), default=-1)

    @cached_property
    def last_told(self) -> int:
        """The last sequence number that the sender wrote down, −1 for none."""
        return max((sequence for sequence, _ in (*self.sent, *self.dropped, *self.queued)), default=-1)

    @cached_property
    def _newest_heard(self) -> tuple[float, int]:
        """Start and copy of the newest transmission of which the receiver tells; what no sender tells of came later."""
        heard = (*self.heard, *self.held)
        starts = [(self.sent[number].start_ns if number in self.sent else math.inf, number[1]) for number in heard]
        return max(starts, default=(-1, 0))

    def is_last(self, number: Number) -> bool:
        """Whether nothing was heard that was transmitted after this frame."""
        return (self.sent[number].start_ns, number[1]) > self._newest_heard

    def numbers(self) -> list[Number]:
        """Every frame that must have a story: all sequence numbers so far, and the duplicates that are told of."""
        copies = {number for number in (*self.sent, *self.heard, *self.held) if number[1]}
        return sorted({*((sequence, 0) for sequence in range(1 + max(self.last_heard, self.last_told))), *copies})

    def accounts(self, number: Number) -> int:
        """How many accounts the sender gave of a frame: exactly one, if its record is whole."""
        return (number in self.sent) + (number in self.dropped) + (number in self.queued)


def frame_fates(record: Record) -> dict[LinkName, list[FrameFate]]:
    """Every frame of every directed link, in the order of incarnation and sequence number; wires have no stories."""
    told = _gather(record)
    court = _Court(record)
    found: dict[LinkName, list[FrameFate]] = {link: [] for link in record.links()}
    for link, incarnation in sorted(told, key=lambda key: key[1]):
        if link not in record.plan.wires:
            mine = told[link, incarnation]
            found[link] += (court.story(link, incarnation, mine, number) for number in mine.numbers())
    return found


def _gather(record: Record) -> dict[tuple[LinkName, int], _Told]:
    told: dict[tuple[LinkName, int], _Told] = defaultdict(_Told)
    for (agent, incarnation), batch in record.batches.items():
        for sent in batch.sent:
            account = told[(agent, sent.target), incarnation]
            _put(account.sent, (sent.sequence, sent.copy), sent, account)
        for dropped in batch.dropped:
            account = told[(agent, dropped.target), incarnation]
            _put(account.dropped, (dropped.sequence, 0), dropped, account)
        for heard in batch.heard:
            account = told[(heard.source, agent), heard.incarnation]
            _put(account.heard, (heard.sequence, heard.copy), heard, account)
        for late in batch.late:
            told[(late.source, agent), late.incarnation].late[late.sequence, late.copy] = late
        for event in batch.events:
            if event["event"] == "queued":
                waiting = {(sequence, 0) for sequence in event["sequences"]}
                told[(agent, event["target"]), incarnation].queued |= waiting
            elif event["event"] == "held":
                numbers = {(sequence, copy) for sequence, copy in event["sequences"]}
                told[(event["source"], agent), event["incarnation"]].held |= dict.fromkeys(numbers, incarnation)
    return told


def _put(accounts: dict[Number, _Entry], number: Number, entry: _Entry, account: _Told) -> None:
    if number in accounts:
        account.twice.add(number)
    accounts[number] = entry


class _Gone(NamedTuple):
    """A span in which an agent was not there to hear; `meant` by a fault, or else it may have heard some of it."""

    at_ns: int
    back_ns: int
    meant: bool


class _Court:
    """Decides fates, from what is known of the ends of a link."""

    def __init__(self, record: Record) -> None:
        self._end_ns = record.last_ns
        self._broken_off = record.broken_off
        self._gone: dict[str, list[_Gone]] = defaultdict(list)
        self._killed: Counter[str] = Counter()
        for fault in record.faults:
            if isinstance(fault, Kill) and fault.at_ns < self._end_ns:
                back_ns = self._back_ns(record, (fault.agent, self._killed[fault.agent]))
                self._gone[fault.agent].append(_Gone(fault.at_ns, back_ns, True))
                self._killed[fault.agent] += 1
        for life in self._broken_off:
            at_ns = last_ns(record.batches[life]) if life in record.batches else 0
            self._gone[life[0]].append(_Gone(at_ns, self._back_ns(record, life), False))

    def _back_ns(self, record: Record, life: Life) -> int:
        back_ns = record.restart_ns(*life)
        return self._end_ns if back_ns is None else back_ns

    def story(self, link: LinkName, incarnation: int, told: _Told, number: Number) -> FrameFate:
        """All that is known of one frame."""
        sent, heard = told.sent.get(number), told.heard.get(number)
        dropped, late = told.dropped.get(number), told.late.get(number)
        due_ns = sent.due_ns if sent else heard.due_ns if heard else None
        return FrameFate(
            source=link[0],
            target=link[1],
            incarnation=incarnation,
            sequence=number[0],
            copy=number[1],
            size=sent.size if sent else None,
            start_ns=sent.start_ns if sent else None,
            airtime_ns=sent.airtime_ns if sent else None,
            due_ns=due_ns,
            verdict=sent.verdict if sent else None,
            dropped_ns=dropped.time_ns if dropped else None,
            behind_ns=late.behind_ns if late else None,
            fate=self._fate(link, incarnation, told, number),
            contradicted=self._contradicted((link[0], incarnation), told, number),
        )

    def _fate(self, link: LinkName, incarnation: int, told: _Told, number: Number) -> str:
        if number in told.heard:
            return told.heard[number].fate
        if number in told.dropped:
            return told.dropped[number].cause
        if number in told.queued:
            return SENDER_DOWN if self._killed[link[0]] > incarnation else IN_FLIGHT
        if number in told.held:
            return RECEIVER_DOWN if self._killed[link[1]] > told.held[number] else IN_FLIGHT
        broken = (link[0], incarnation) in self._broken_off
        if number in told.sent:
            return self._unheard(link[1], told.sent[number], last=told.is_last(number), broken=broken)
        return UNKNOWN if broken else MISSING

    def _unheard(self, target: str, sent: Sent, *, last: bool, broken: bool) -> str:
        """The fate of a frame that was sent and that nobody wrote down as heard.

        `last`: nothing later was heard from this life of the sender; `broken`: its record may stop before its end.
        """
        if sent.due_ns >= self._end_ns:
            return IN_FLIGHT
        for gone in self._gone[target]:
            if sent.start_ns < gone.back_ns and (sent.due_ns >= gone.at_ns or (last and not gone.meant)):
                return RECEIVER_DOWN if gone.meant else UNKNOWN
        return UNKNOWN if broken and last else MISSING

    def _contradicted(self, life: Life, told: _Told, number: Number) -> bool:
        if number in told.twice or told.accounts(number) > 1:
            return True
        heard, sent = told.heard.get(number), told.sent.get(number)
        if heard is None:
            return False
        if sent is None:
            return life not in self._broken_off
        return sent.due_ns != heard.due_ns or (heard.fate == DELIVERED and sent.verdict != DELIVERED)
