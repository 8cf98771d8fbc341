"""Lockstep pace: an event is handled when every neighbour has promised that nothing earlier comes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from heapq import heappop
from typing import TYPE_CHECKING

from ..transport.events import DATA, FOREVER_NS, HANDLER, OVER_NS, SOURCE, TIME
from ..transport.faults import Fault, Kill, LinkFault, kills_of
from ..transport.frames import PROMISE_ONLY, Frame, Message, air_promise, promise
from ..transport.media_settings import AIR
from ..transport.promises import NeighbourPromises, lookahead_segments
from .mailbox import Mailbox
from .node import Node
from .run_start import Guard, RunStart, Write

if TYPE_CHECKING:
    import asyncio

_NOBODY = ""


class Lockstep:
    """Handles an event when every neighbour has promised that nothing earlier can come."""

    def __init__(self, loop: asyncio.AbstractEventLoop, write: Write, done: Callable[[], None], guard: Guard) -> None:
        self.mail = Mailbox()
        self.promises = 0
        self.lateness_ns: list[int] = []
        self._loop = loop
        self._write = write
        self._outbox: list[tuple[str, Message]] = []
        self._done = done
        self._frozen = False
        self._blocking = [{_NOBODY}]
        self._wake = guard(self.advance)

    def begin(self, node: Node, run_start: RunStart) -> None:
        """Make the first promises; the node knows the live faults so far."""
        self._node, self._state = node, node.state
        self._end_ns = run_start.end_ns
        self._told = dict.fromkeys(node.sender.outlets, 0)
        self._on_air = [source for source in self._state.neighbours if node.sender.outlet_of[source] == AIR]
        segments = {source: self._segments(source) for source in self._state.neighbours}
        restarted = self._state.incarnation > 0
        first = {source: self._first_incarnation(source) for source in segments} if restarted else None
        self._neighbours = NeighbourPromises(self._state.name, segments, run_start.interventions, incarnations=first)
        node.receiver.unheard_ns = self._neighbours.unstarted_ns
        for source in self._state.neighbours:
            self._expect(source)
            if self._is_down(source):
                self._neighbours.down(source)
        for source, incarnation in run_start.external_kills:
            self._take_external_kill(source, incarnation)
        self.advance()

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
        """Nominal time of the last event."""
        return 0 if self._not_started() else self._state.now_ns

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
                promises[outlet] = self._neighbours.forever_ns()
        return promises

    def _not_started(self) -> bool:
        """Whether nobody has reached the start of the own incarnation, before which it transmits nothing."""
        start_ns = self._state.start_ns
        return 0 < start_ns >= max([self._neighbours.safe_ns(), *self._told.values()])

    def _send(self) -> None:
        """Put the frames of this turn, the last of an outlet with its promise; other outlets get new promises alone.

        Every other frame carries the promise that nothing starts before itself.
        """
        told, self._told = self._told, self._promise()
        last = {outlet: number for number, (outlet, _) in enumerate(self._outbox)}
        for number, (outlet, frame) in enumerate(self._outbox):
            promise_ns = self._told[outlet] if number == last[outlet] else frame.start_ns
            self._write(outlet, frame._replace(promise_ns=promise_ns))
        self._outbox.clear()
        for outlet, promise_ns in self._told.items():
            if promise_ns > told[outlet] and outlet not in last:
                self._send_promise(outlet)

    def arrived(self, source: str, frame: Message) -> None:
        """Keep a frame or promise until all neighbours that block progress were heard; called on Zenoh's thread."""
        self.mail.put(source, frame)
        for blocking in self._blocking:
            if source in blocking:
                blocking.discard(source)
                if not blocking:
                    self._loop.call_soon_threadsafe(self._wake)

    def advance(self) -> None:
        """Handle what is safe, then promise.

        The mail is read again once the blocking neighbours are known: they may have been heard in between. Those that
        block the next event need not be those that block a further promise.
        """
        while not self._frozen:
            for source, frame, _ in self.mail.take():
                self._take(source, frame)
            self._handle_safe()
            self._blocking = [self._unheard(), self._neighbours.blocking()]
            if not self.mail:
                return

    def _take(self, source: str, frame: Message) -> None:
        """Take in a frame or promise; a neighbour that has returned gets the current promise at once."""
        returned = frame.incarnation > 0 and not self._neighbours.knows(source, frame.incarnation)
        if not self._neighbours.heard(source, frame):
            return
        if frame.sequence != PROMISE_ONLY:
            self._node.receiver.receive(source, frame)
        if returned:
            self._send_promise(self._node.sender.outlet_of[source])

    def _send_promise(self, outlet: str) -> None:
        self.promises += 1
        say = air_promise if outlet == AIR else promise
        self._write(outlet, say(self._state.incarnation, self._told[outlet], self._node.sender.sent[outlet]))

    def _handle_safe(self) -> None:
        node, heap = self._node, self._state.heap
        safe = self._neighbours.safe_ns()
        limit = min(safe, self._end_ns)
        while heap and heap[0][TIME] < limit and not self._unheard():
            event = heappop(heap)
            event[HANDLER](event)
        self._send()
        if node.state.dead or (safe >= self._end_ns and not (heap and heap[0][TIME] < self._end_ns)):
            self._done()

    def _unheard(self) -> set[str]:
        """Neighbours that may still transmit during the next frame from the air, or while the radio listens."""
        event = self._state.heap[0] if self._on_air and self._state.heap else None
        if event is None:
            return set()
        if self._node.sender.senses(event):
            return self._neighbours.silent_before(event[TIME], self._on_air)
        if not isinstance(event[DATA], Frame) or event[SOURCE] not in self._on_air:
            return set()
        return self._neighbours.silent_before(event[DATA].start_ns + event[DATA].airtime_ns, self._on_air)

    def freeze(self) -> int:
        """Handle nothing until `thaw`; the instant that no event handled and no promise given has passed."""
        self._frozen = True
        if self._not_started():
            return 0
        promised = max((told for told in self._told.values() if told < FOREVER_NS), default=0)
        return max(promised, self._state.now_ns)

    def thaw(self) -> None:
        """Go on."""
        self._frozen = False
        self.advance()

    def end_at(self, instant_ns: int) -> bool:
        """End the run at an instant beyond every promise."""
        self._end_ns = instant_ns
        return instant_ns > self._state.now_ns

    def arm(self, faults: Iterable[Fault], instant_ns: int) -> bool:
        """Arm live faults while frozen; their instant lies beyond every promise."""
        in_time = instant_ns > self._state.now_ns or self._not_started()
        for fault in faults:
            self._node.arm(fault)
        self._neighbours.intervene(instant_ns)
        for outlet, told in self._told.items():
            if FOREVER_NS <= told < OVER_NS:
                self._told[outlet] = instant_ns
        for source in self._state.neighbours:
            self._neighbours.relink(source, self._segments(source))
            self._expect(source)
        return in_time

    def external_kill(self, agent: str, incarnation: int) -> None:
        """Ignore further messages of an incarnation that was killed externally."""
        self._take_external_kill(agent, incarnation)
        self.advance()

    def _take_external_kill(self, agent: str, incarnation: int) -> None:
        self._neighbours.external_kill(agent, incarnation)
        self._node.receiver.external_kill(agent, incarnation)

    def close(self) -> None:
        """Nothing to give back."""
