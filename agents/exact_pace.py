"""Exact pace: an event is handled when every neighbour has promised that nothing earlier comes, and at its time.

Its time is that of the wall clock; without a clock all goes as fast as promises allow, which is lockstep.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from heapq import heappop
from typing import TYPE_CHECKING, Any, Protocol

from ..transport.events import DATA, FOREVER_NS, HANDLER, OVER_NS, SOURCE, TIME, Event
from ..transport.faults import Fault, Kill, LinkFault, kills_of
from ..transport.frames import PROMISE_ONLY, Frame, Message, air_promise, promise
from ..transport.media_settings import AIR
from ..transport.promises import NeighbourPromises, lookahead_segments
from .mailbox import Mailbox
from .node import Node, matters
from .run_start import LATENESS_KEPT, Guard, RunStart, Write

if TYPE_CHECKING:
    import asyncio

_AHEAD_NS, _SPREAD_NS = 20_000_000, 12_000_000
"""How long before its start, on the clock, a frame is put on the wire, and how much later than that it may be.

So the frames of some milliseconds cost one wake-up, and the network still has time.
"""
_CREDIT_NS = 1_000_000_000
"""How far an agent may run ahead of what a neighbour says to have handled; neighbours say so twice as often."""


class Clock(Protocol):
    """Nominal time by the wall clock, with an alarm."""

    epoch_ns: int
    speed: float

    def now_ns(self) -> int:
        """Nominal time now."""

    def wake_at(self, time_ns: int) -> None:
        """Set the alarm."""

    def close(self) -> None:
        """End it."""


class Exact:
    """Handles an event when every neighbour has promised that nothing earlier can come, and the clock has reached it.

    An agent that its neighbours do not hold back, such as one with sensors alone, would run away from a slow receiver:
    it waits until every neighbour has said to have handled all but the last second.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        write: Write,
        done: Callable[[], None],
        guard: Guard,
        clock_of: Callable[[Callable[[], None]], Clock] | None = None,
    ) -> None:
        self.mail = Mailbox()
        self.promises = 0
        self.lateness_ns: list[int] = []
        self.behind_ns = self.end_behind_ns = self._lately_behind_ns = 0
        self._loop = loop
        self._write = write
        self._outbox: list[tuple[str, Message]] = []
        self._done = done
        self._frozen = True
        self._ended = False
        self._lives: dict[str, int] = {}
        self._handled_ns = self._started_ns = 0
        self._barrier_ns = FOREVER_NS
        self._blocking: list[set[str]] = []
        self._urgent: set[str] = set()
        self._due_ns = 0
        self._wake = guard(self.advance)
        self._clock = None if clock_of is None else clock_of(self._wake)

    def begin(self, node: Node, run_start: RunStart) -> None:
        """Make the first promises; the node knows the live faults so far."""
        self._node, self._state = node, node.state
        self._state.part()
        self._end_ns = run_start.end_ns
        self._ahead_ns = self._spread_ns = 0
        if self._clock is not None:
            self._clock.epoch_ns = run_start.epoch_ns
            self._ahead_ns, self._spread_ns = (int(ns * self._clock.speed) for ns in (_AHEAD_NS, _SPREAD_NS))
        self._told = dict.fromkeys(node.sender.outlets, 0)
        self._shown = dict.fromkeys(node.sender.outlets, self._state.start_ns)
        self._on_air = [source for source in self._state.neighbours if node.sender.outlet_of[source] == AIR]
        segments = {source: self._segments(source) for source in self._state.neighbours}
        restarted = self._state.incarnation > 0
        first = {source: self._first_incarnation(source) for source in segments} if restarted else None
        self._neighbours = NeighbourPromises(
            self._state.name,
            segments,
            run_start.interventions,
            incarnations=first,
            start_ns=self._state.start_ns,
        )
        # a live fault may revoke promises from the own present on
        node.receiver.unheard_ns = lambda: min(self._neighbours.unstarted_ns(), self._state.now_ns)
        for source in self._state.neighbours:
            self._expect(source)
            if self._is_down(source):
                self._neighbours.down(source)
        for source, incarnation in run_start.external_kills:
            self._take_external_kill(source, incarnation)
        self.thaw()

    def _segments(self, source: str) -> tuple[tuple[int, int, int], ...]:
        link = (source, self._state.name)
        faults = [fault for fault in self._node.known.values() if isinstance(fault, LinkFault)]
        return lookahead_segments(self._node.plan.settings(link), link, faults)

    def _kills(self, source: str) -> list[Kill]:
        return kills_of(self._node.known.values(), source)

    def _first_incarnation(self, source: str) -> int:
        """The first incarnation of a neighbour that has not ended when the own one starts; it may be yet to come."""
        return sum(kill.at_ns < self._state.start_ns for kill in self._kills(source))

    def _is_down(self, source: str) -> bool:
        """Whether a neighbour has died before the own incarnation starts, and has not returned by then."""
        start_ns = self._state.start_ns
        return any(kill.at_ns < start_ns and kill.in_force(start_ns) for kill in self._kills(source))

    def _expect(self, source: str) -> None:
        """Expect a neighbour's returns from the own start on: nothing later is safe before the return is heard."""
        returns = [
            (incarnation, kill.until_ns)
            for incarnation, kill in enumerate(self._kills(source), start=1)
            if kill.until_ns is not None and kill.until_ns >= self._state.start_ns
        ]
        self._neighbours.expect(source, returns)

    def now_ns(self) -> int:
        """Nominal time: of the last event, or of the clock where nothing is to be done before."""
        if self._not_started():
            return 0
        if self._clock is None:
            return self._state.now_ns
        return max(self._state.now_ns, min(self._clock.now_ns(), self._progress_ns()))

    def _progress_ns(self) -> int:
        """Every event before this instant has been handled."""
        heads = (heap[0][TIME] for heap in (self._state.heap, self._state.sending) if heap)
        return min(self._neighbours.safe_ns(), self._end_ns, self._barrier_ns, *heads)

    def put(self, outlet: str, frame: Message) -> None:
        """Keep a frame until the turn is over, when it is known what can be promised with it."""
        self._outbox.append((outlet, frame))

    def _promise(self) -> dict[str, int]:
        """New promises, never before what was promised; but for those for ever, none is beyond the end of the run."""
        start_ns = self._state.start_ns
        if self._not_started():
            return dict.fromkeys(self._told, start_ns)
        promises = self._node.promises(max(self._neighbours.safe_ns(self._node.triggers()), start_ns))
        for outlet, promise_ns in promises.items():
            if promise_ns < FOREVER_NS:
                promises[outlet] = max(min(promise_ns, self._end_ns), self._told[outlet])
            elif promise_ns < OVER_NS:
                promises[outlet] = FOREVER_NS
        return promises

    def _not_started(self) -> bool:
        """Whether nobody has reached the start of the own incarnation, before which it transmits nothing."""
        start_ns = self._state.start_ns
        return 0 < start_ns >= max([self._neighbours.safe_ns(), *self._told.values()])

    def _send(self) -> None:
        """Put the frames of this turn, the last of an outlet with its promise; other outlets get new promises alone.

        Every other frame carries the promise that nothing starts before itself. Neighbours that have heard nothing for
        half of what they may run ahead are told how far this agent has come.
        """
        told, self._told = self._told, self._promise()
        known = len(self._neighbours.interventions)
        last = {outlet: number for number, (outlet, _) in enumerate(self._outbox)}
        for number, (outlet, frame) in enumerate(self._outbox):
            promise_ns = self._told[outlet] if number == last[outlet] else frame.start_ns
            self._write(outlet, frame._replace(promise_ns=promise_ns, interventions=known))
            self._shown[outlet] = frame.start_ns
            self._started_ns = max(self._started_ns, frame.start_ns)
        self._outbox.clear()
        progress_ns = self._progress_ns()
        for outlet, promise_ns in self._told.items():
            if (promise_ns > told[outlet] and outlet not in last) or self._owes_progress(outlet, progress_ns):
                self._send_promise(outlet)

    def _owes_progress(self, outlet: str, time_ns: int) -> bool:
        return time_ns >= self._shown[outlet] + _CREDIT_NS // 2

    def arrived(self, source: str, frame: Message) -> None:
        """Keep a frame or promise until all that this agent waits for have been heard; called on Zenoh's thread."""
        self.mail.put(source, frame)
        if self._calls(source, frame):
            self._loop.call_soon_threadsafe(self._wake)

    def _calls(self, source: str, frame: Message) -> bool:
        """Whether a frame or promise is the last that this agent waits for, and its alarm will not be soon enough.

        A neighbour that returns is answered at once.
        """
        calls = frame.incarnation > self._lives.get(source, 0)
        for blocking in (self._urgent, *self._blocking):
            if source in blocking:
                blocking.discard(source)
                calls = calls or (not blocking and (blocking is self._urgent or self._has_reached(self._due_ns)))
        return calls

    def advance(self) -> None:
        """Handle what is safe and due, promise, and say what to wait for, which may have come in between."""
        while not self._frozen:
            for source, frame, _ in self.mail.take():
                self._take(source, frame)
            self._handle_safe()
            self._await_next()
            calls = [self._calls(source, frame) for source, frame, _ in self.mail.waiting()]
            if not any(calls):
                return

    def _take(self, source: str, frame: Message) -> None:
        """Take in a frame or promise; a neighbour that has returned gets the current promise at once."""
        returned = frame.incarnation > 0 and not self._neighbours.knows(source, frame.incarnation)
        self._lives[source] = frame.incarnation
        if not self._neighbours.heard(source, frame):
            return
        if frame.sequence != PROMISE_ONLY:
            self._node.receiver.receive(source, frame)
        if returned:
            self._send_promise(self._node.sender.outlet_of[source])

    def _send_promise(self, outlet: str) -> None:
        self.promises += 1
        progress_ns = self._shown[outlet] = max(self._shown[outlet], self._progress_ns())
        say = air_promise if outlet == AIR else promise
        sent, known = self._node.sender.sent[outlet], len(self._neighbours.interventions)
        self._write(outlet, say(self._state.incarnation, self._told[outlet], sent, progress_ns, known))

    def _handle_safe(self) -> None:
        triggers = self._node.triggers()
        safe = self._neighbours.safe_ns()
        limit = min(safe, self._end_ns, self._barrier_ns, self._neighbours.credit_ns() + _CREDIT_NS)
        timed = self._clock is None
        self._transmit_settled()
        while (heap := self._next_heap()) and heap[0][TIME] < limit and self._may_handle(heap[0], triggers):
            event = heappop(heap)
            if not timed and matters(event, triggers):
                self._note_behind(event[TIME])
                timed = True
            self._handled_ns = event[TIME]
            event[HANDLER](event)
            self._transmit_settled()
        self._send()
        if self._state.dead:
            self._ended = True
            self._done()
        elif safe >= self._end_ns and self._has_reached(self._end_ns) and self._progress_ns() >= self._end_ns:
            if not self._ended:
                self.end_behind_ns = self._behind_ns(self._end_ns)
                self.behind_ns = max(self.behind_ns, self.end_behind_ns)
            self._ended = True
            self._done()

    def _next_heap(self) -> list[Event]:
        """The heap with the next event whose turn depends on what is heard: carrier sense does, other starts do not."""
        heap, sending = self._state.heap, self._state.sending
        if sending and self._node.sender.contends(sending[0][SOURCE]) and (not heap or sending[0] < heap[0]):
            return sending
        return heap

    def _may_handle(self, event: Event, triggers: Collection[str]) -> bool:
        """Whether the clock has reached an event, and no transmission that decides on it is unheard.

        What does not matter is handled a little early, as it lies before transmissions that are.
        """
        due_ns = event[TIME] if matters(event, triggers) else event[TIME] - self._ahead_ns
        return self._has_reached(due_ns) and not self._unheard(event)

    def _transmit_settled(self) -> None:
        """Offer and start what nothing that is yet to come can change, on the clock a little early.

        Nothing is put for a neighbour that is yet to return, as its process may not run yet.
        """
        sending = self._state.sending
        if not sending:
            return
        settled_ns = self._settled_ns()
        while sending and sending[0][TIME] < settled_ns and self._has_reached(sending[0][TIME] - self._ahead_ns):
            if self._node.sender.contends(sending[0][SOURCE]):
                return
            event = heappop(sending)
            event[HANDLER](event)

    def _settled_ns(self) -> int:
        arrivals_ns = max(self._neighbours.safe_ns(self._node.triggers()), self._state.start_ns)
        settled_ns = self._node.settled_ns(arrivals_ns)
        return min(settled_ns, self._neighbours.awaited_ns(), self._end_ns, self._barrier_ns)

    def _has_reached(self, time_ns: int) -> bool:
        return self._clock is None or self._clock.now_ns() >= time_ns

    def _behind_ns(self, time_ns: int) -> int:
        """By how much wall time the clock has passed an instant."""
        clock = self._clock
        return 0 if clock is None else max(0, int((clock.now_ns() - time_ns) / clock.speed))

    def _note_behind(self, time_ns: int) -> None:
        behind_ns = self._behind_ns(time_ns)
        self.behind_ns = max(self.behind_ns, behind_ns)
        self._lately_behind_ns = max(self._lately_behind_ns, behind_ns)
        if len(self.lateness_ns) < LATENESS_KEPT:
            self.lateness_ns.append(behind_ns)

    def _await_next(self) -> None:
        """Say who must be heard before the next event that matters is safe, and set the alarm for it.

        Until then nothing that comes changes what this agent does or can promise, but for neighbours whose frames make
        it act, and until it has started: hearing those that hold it back most allows a further promise.
        """
        neighbours, triggers = self._neighbours, self._node.triggers()
        next_ns = min(self._next_ns(triggers), self._end_ns)
        owed_ns = min(self._shown.values(), default=FOREVER_NS) + _CREDIT_NS // 2
        self._due_ns = min(next_ns, owed_ns)
        blocking, urgent = [self._unheard(), neighbours.blocking(self._due_ns)], set[str]()
        holding = None if self._not_started() else triggers
        if holding != () and (safe := neighbours.safe_ns(holding)) <= next_ns:
            urgent = neighbours.blocking(safe, holding)
        if next_ns < self._end_ns and not any(blocking) and not urgent:
            blocking.append(neighbours.behind(next_ns - _CREDIT_NS + 1))
        self._blocking, self._urgent = blocking, urgent
        if self._clock is not None and not self._ended:
            waits = self._due_ns >= self._barrier_ns or (any(blocking) and self._has_reached(self._due_ns))
            self._clock.wake_at(min(FOREVER_NS if waits else self._due_ns, self._next_start_ns()))

    def _next_ns(self, triggers: Collection[str]) -> int:
        """The next event that matters; the next one at all where carrier sense has to be decided."""
        heap = self._next_heap()
        if not heap or matters(heap[0], triggers):
            return heap[0][TIME] if heap else FOREVER_NS
        return min((event[TIME] for event in heap if matters(event, triggers)), default=FOREVER_NS)

    def _next_start_ns(self) -> int:
        """When to wake up for a transmission that is settled, with those of the next milliseconds."""
        sending = self._state.sending
        if not sending or self._node.sender.contends(sending[0][SOURCE]) or sending[0][TIME] >= self._settled_ns():
            return FOREVER_NS
        return sending[0][TIME] - self._ahead_ns + self._spread_ns

    def _unheard(self, event: Event | None = None) -> set[str]:
        """Neighbours that may still transmit during a frame from the air, or while the radio listens.

        Of an event, or of the next one.
        """
        if not self._on_air:
            return set()
        if event is None:
            heap = self._next_heap()
            if not heap:
                return set()
            event = heap[0]
        if self._node.sender.senses(event):
            return self._neighbours.silent_before(event[TIME], self._on_air)
        if not isinstance(event[DATA], Frame) or event[SOURCE] not in self._on_air:
            return set()
        return self._neighbours.silent_before(event[DATA].start_ns + event[DATA].airtime_ns, self._on_air)

    def freeze(self) -> int:
        """Handle nothing until `thaw`; the last instant at which something was handled or transmitted."""
        self._frozen = True
        return self._passed_ns()

    def _passed_ns(self) -> int:
        return 0 if self._not_started() else max(self._started_ns, self._handled_ns, self._state.now_ns)

    def prepare(self, instant_ns: int) -> bool:
        """Handle nothing from an instant on until `arm` or `thaw`; whether nothing of that was handled already."""
        if self._passed_ns() >= instant_ns:
            return False
        self._barrier_ns = instant_ns
        return True

    def thaw(self) -> None:
        """Go on."""
        self._frozen, self._barrier_ns = False, FOREVER_NS
        self.advance()

    def end_at(self, instant_ns: int) -> bool:
        """End the run at an instant beyond every promise."""
        self._end_ns = instant_ns
        return instant_ns > self._state.now_ns

    def arm(self, faults: Iterable[Fault], instant_ns: int) -> bool:
        """Arm live faults, frozen or prepared for their instant; whether nothing beyond it was handled.

        All promises end there, the own ones too, unless they are those of the dead.
        """
        in_time = instant_ns > self._passed_ns()
        for fault in faults:
            self._node.arm(fault)
        self._neighbours.intervene(instant_ns)
        for outlet, told in self._told.items():
            if told < OVER_NS:
                self._told[outlet] = min(told, instant_ns)
        for source in self._state.neighbours:
            self._neighbours.relink(source, self._segments(source))
            self._expect(source)
        self._barrier_ns = FOREVER_NS
        self.advance()
        return in_time

    def external_kill(self, agent: str, incarnation: int) -> None:
        """Ignore further messages of an incarnation that was killed externally."""
        self._take_external_kill(agent, incarnation)
        self.advance()

    def _take_external_kill(self, agent: str, incarnation: int) -> None:
        self._neighbours.external_kill(agent, incarnation)
        self._node.receiver.external_kill(agent, incarnation)

    def close(self) -> None:
        """Stop the clock."""
        if self._clock is not None:
            self._clock.close()

    def take_behind_ns(self) -> int:
        """The most that it has been behind the clock since the last call, in wall time."""
        behind_ns, self._lately_behind_ns = self._lately_behind_ns, 0
        return behind_ns

    def timing(self) -> dict[str, Any]:
        """How far behind the clock, in wall time: all of the events that matter, the most, and at the end."""
        return {"lateness_ns": self.lateness_ns, "behind_ns": self.behind_ns, "end_behind_ns": self.end_behind_ns}
