"""The two paces of a process: when may the next event of its node be handled?

Realtime: when the wall clock has reached it. Lockstep: when every neighbour has promised that nothing earlier comes.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from heapq import heappop

from ..transport.events import DATA, FOREVER_NS, HANDLER, OFFER, RANK, SOURCE, TIME, TRANSMIT, Event
from ..transport.faults import Fault, Kill, LinkFault, kills_of
from ..transport.frames import PROMISE_ONLY, Frame, Message, air_promise, promise
from ..transport.media import AIR
from ..transport.promises import Horizon, lookahead_segments
from ..transport.timerfd import TimerFd
from .burning import Burner
from .mailbox import Mailbox
from .node import Node

_GRACE_S = 0.1
_DRAIN_S = 0.05
"""A killed agent still hears what was due before its end."""
_AHEAD_NS = 8_000_000
"""How far ahead of its start, on the clock, a frame is put on the wire.

Far less than live faults are announced ahead; and not more, so that frames that start later do not stand in the way.
"""
_LATENESS_KEPT = 50_000
_NOBODY = ""

Write = Callable[[str, Message], None]
Guard = Callable[[Callable[[], None]], Callable[[], None]]
"""Makes a function report what it raises."""


@dataclass(frozen=True)
class Beginning:
    """What an agent is told of the run that it joins.

    epoch_ns: where nominal time 0 is on the monotonic clock. end_ns: nominal end. interventions: how often somebody has
    intervened so far. gone: lives that ended from outside.
    """

    epoch_ns: int
    end_ns: int
    interventions: int = 0
    gone: tuple[tuple[str, int], ...] = ()


class Realtime:
    """Handles each event when the wall clock reaches its nominal time, and the work of its own links ahead of it.

    Within `compute` nothing that the agent is yet to do can be offered to its links, and the start of a frame that
    waits for its slot is settled, so a frame is on its way before its nominal start: this, airtime and latency are the
    slack that a busy machine has.
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, write: Write, done: Callable[[], None], guard: Guard, speed: float
    ) -> None:
        self._write = write
        self._outbox: list[tuple[str, Message]] = []
        self.mail = Mailbox()
        self.promises = 0
        self.lateness_ns: list[int] = []
        self._loop = loop
        self._speed = speed
        self._done = done
        self._leaving: asyncio.TimerHandle | None = None
        self._timer = TimerFd(loop, guard(self.advance))
        self._armed_ns = 0
        self._burner = Burner()
        self._burning = 0.0

    def begin(self, node: Node, beginning: Beginning) -> None:
        """Start the clock."""
        self._node = node
        self._epoch_ns = beginning.epoch_ns
        self._end_ns = beginning.end_ns
        self._ahead_ns = int(_AHEAD_NS * self._speed)
        self._early_ns = min(node.compute_ns, self._ahead_ns)
        self.advance()

    def now_ns(self) -> int:
        """Nominal time by the wall clock."""
        return int((time.monotonic_ns() - self._epoch_ns) * self._speed)

    def arrived(self, source: str, frame: Message) -> None:
        """Keep a frame until it is due, or wake up earlier for it; called on Zenoh's thread."""
        if frame.sequence == PROMISE_ONLY:
            return
        self.mail.put(source, frame)
        if self._armed_ns and (due_ns := self._wall_ns(frame.due_ns)) < self._armed_ns:
            self._arm_timer(due_ns)

    def put(self, target: str, frame: Message) -> None:
        """Keep a frame until the turn is over: frames that go out together cost fewer wake-ups of Zenoh's threads."""
        self._outbox.append((target, frame))

    def _send(self) -> None:
        for target, frame in self._outbox:
            self._write(target, frame)
        self._outbox.clear()

    def _wall_ns(self, time_ns: int) -> int:
        """When the monotonic clock reaches a nominal instant."""
        return self._epoch_ns + int(time_ns / self._speed)

    def _arm_timer(self, wall_ns: int) -> None:
        self._armed_ns = wall_ns
        self._timer.set(wall_ns)

    def advance(self) -> None:
        """Handle what is due, then sleep until the next event.

        The mail is looked at again once the timer is set: what came in between may be due before that.
        """
        while True:
            for source, frame in self.mail.take():
                self._node.receive(source, frame)
            self._arm_timer(self._handle_due())
            if not self.mail:
                return

    def _handle_due(self) -> int:
        """Handle every event whose time has come; when the next one has, on the monotonic clock."""
        node, heap = self._node, self._node.heap
        now = self.now_ns()
        limit, link_limit = min(now, self._end_ns - 1), min(now + self._early_ns, self._end_ns - 1)
        if heap and heap[0][TIME] <= limit and len(self.lateness_ns) < _LATENESS_KEPT:
            self.lateness_ns.append(now - heap[0][TIME])
        while heap and (heap[0][TIME] <= limit or (heap[0][RANK] >= OFFER and heap[0][TIME] <= link_limit)):
            event = heappop(heap)
            event[HANDLER](event)
        if node.hogged != self._burning:
            self._burning = node.hogged
            self._burner.burn(self._burning)
        node.transmit_ahead(min(now + self._ahead_ns, self._end_ns))
        while heap and heap[0][RANK] == TRANSMIT and not node.sending.awaits(heap[0]):
            heappop(heap)
        self._send()
        if heap and heap[0][TIME] < self._end_ns and not node.dead:
            return self._wall_ns(self._wake_for(heap[0], now))
        if self._leaving is None:
            remaining_s = max(0.0, (self._end_ns - now) / 1e9 / self._speed)
            self._leaving = self._loop.call_later(_DRAIN_S if node.dead else remaining_s + _GRACE_S, self._done)
        return FOREVER_NS

    def _wake_for(self, event: Event, now_ns: int) -> int:
        """The nominal instant at which there is something to do about the next event."""
        time_ns, rank = event[TIME], event[RANK]
        if rank == TRANSMIT and time_ns - self._ahead_ns > now_ns:
            return time_ns - self._ahead_ns
        return time_ns - self._early_ns if rank >= OFFER else time_ns

    def arm(self, faults: Iterable[Fault], instant_ns: int) -> bool:
        """Arm live faults that change something from an instant on; whether there is time left until then.

        Of a fault that is armed anew for a later start, the earlier one must not have passed either.
        """
        faults, passed_ns = list(faults), self.hold()
        known = self._node.known
        moved = (known[new.id].at_ns for new in faults if new.id in known and known[new.id].at_ns != new.at_ns)
        in_time = min([instant_ns, *moved]) > passed_ns
        for fault in faults:
            self._node.arm(fault)
        self._stay()
        self.advance()
        return in_time

    def _stay(self) -> None:
        """There is something to come after all: when to leave is decided anew."""
        if self._leaving is not None and not self._node.dead:
            self._leaving.cancel()
            self._leaving = None

    def end_at(self, instant_ns: int) -> bool:
        """End the run at an instant; whether it is still to come."""
        in_time = instant_ns > self.hold()
        self._end_ns = instant_ns
        self._stay()
        self.advance()
        return in_time

    def hold(self) -> int:
        """Wall time cannot be held; the instant that nothing handled has passed."""
        return max(self.now_ns() + self._ahead_ns, self._node.now_ns)

    def release(self) -> None:
        """Nothing was held."""

    def gone(self, agent: str, incarnation: int) -> None:
        """Nobody waits for a neighbour here."""

    def close(self) -> None:
        """Stop the timer, and whatever hogs the processor."""
        self._burner.burn(0.0)
        self._timer.close()


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
        self._held = False
        self._blocking = {_NOBODY}
        self._wake = guard(self.advance)

    def begin(self, node: Node, beginning: Beginning) -> None:
        """Make the first promises; the node knows the live faults so far."""
        self._node = node
        self._end_ns = beginning.end_ns
        self._told = dict.fromkeys(node.sending.outlets, 0)
        self._on_air = [source for source in node.neighbours if node.sending.outlet_of[source] == AIR]
        segments = {source: self._segments(source) for source in node.neighbours}
        self._horizon = Horizon(node.name, segments, beginning.interventions, newborn=node.incarnation > 0)
        for source in node.neighbours:
            self._expect(source)
            if node.incarnation and any(kill.in_force(node.start_ns) for kill in self._kills(source)):
                self._horizon.down(source)
        for source, incarnation in beginning.gone:
            self._horizon.gone(source, incarnation)
        self.advance()

    def _segments(self, source: str) -> tuple[tuple[int, int, int], ...]:
        link = (source, self._node.name)
        faults = [fault for fault in self._node.known.values() if isinstance(fault, LinkFault)]
        return lookahead_segments(self._node.plan.links[link], link, faults)

    def _kills(self, source: str) -> list[Kill]:
        return kills_of(self._node.known.values(), source)

    def _expect(self, source: str) -> None:
        """Nothing from the return of a neighbour on is safe before it is heard of, if it returns in the own life."""
        returns = [
            (life, kill.until_ns)
            for life, kill in enumerate(self._kills(source), start=1)
            if kill.until_ns is not None and kill.until_ns >= self._node.start_ns
        ]
        self._horizon.expect(source, returns)

    def now_ns(self) -> int:
        """Nominal time of the last event."""
        return self._node.now_ns

    def put(self, outlet: str, frame: Message) -> None:
        """Keep a frame until the turn is over, when it is known what can be promised with it."""
        self._outbox.append((outlet, frame))

    def _promise(self) -> dict[str, int]:
        """New promises, never behind what was told; but for the one for ever, none reaches past the end of the run."""
        promises = self._node.promises(max(self._horizon.safe_ns(), self._node.start_ns))
        for outlet, promise_ns in promises.items():
            if promise_ns < FOREVER_NS:
                promises[outlet] = max(min(promise_ns, self._end_ns), self._told[outlet])
            else:
                promises[outlet] = self._horizon.forever_ns()
        return promises

    def _speak(self) -> None:
        """Put the frames of this turn, the last of an outlet with its promise; the other outlets are told news only.

        With any other frame goes the promise that nothing starts before itself.
        """
        told, self._told = self._told, self._promise()
        last = {outlet: number for number, (outlet, _) in enumerate(self._outbox)}
        for number, (outlet, frame) in enumerate(self._outbox):
            promise_ns = self._told[outlet] if number == last[outlet] else frame.start_ns
            self._write(outlet, frame._replace(promise_ns=promise_ns))
        self._outbox.clear()
        for outlet, promise_ns in self._told.items():
            if promise_ns > told[outlet] and outlet not in last:
                self._say(outlet)

    def arrived(self, source: str, frame: Message) -> None:
        """Keep a frame or promise until all that stand in the way were heard; called on Zenoh's thread."""
        self.mail.put(source, frame)
        blocking = self._blocking
        if blocking:
            blocking.discard(source)
            if not blocking:
                self._loop.call_soon_threadsafe(self._wake)

    def advance(self) -> None:
        """Handle what is safe, then promise.

        The mail is looked at again once it is known who stands in the way: they may have been heard in between.
        """
        while not self._held:
            for source, frame in self.mail.take():
                self._take(source, frame)
            self._handle_safe()
            self._blocking = self._unheard() or self._horizon.blocking()
            if not self.mail:
                return

    def _take(self, source: str, frame: Message) -> None:
        """Take in what a neighbour says; one that has come back is told at once what holds."""
        back = frame.incarnation > 0 and not self._horizon.knows(source, frame.incarnation)
        if not self._horizon.heard(source, frame):
            return
        if frame.sequence != PROMISE_ONLY:
            self._node.receive(source, frame)
        if back:
            self._say(self._node.sending.outlet_of[source])

    def _say(self, outlet: str) -> None:
        self.promises += 1
        say = air_promise if outlet == AIR else promise
        self._write(outlet, say(self._node.incarnation, self._told[outlet], self._node.sending.sent[outlet]))

    def _handle_safe(self) -> None:
        node, heap = self._node, self._node.heap
        safe = self._horizon.safe_ns()
        limit = min(safe, self._end_ns)
        while heap and heap[0][TIME] < limit and not self._unheard():
            event = heappop(heap)
            event[HANDLER](event)
        self._speak()
        if node.dead or (safe >= self._end_ns and not (heap and heap[0][TIME] < self._end_ns)):
            self._done()

    def _unheard(self) -> set[str]:
        """Who may still transmit while the next frame from the air is on it, or while the radio listens."""
        event = self._node.heap[0] if self._on_air and self._node.heap else None
        if event is None:
            return set()
        if self._node.sending.senses(event):
            return self._horizon.silent_before(event[TIME], self._on_air)
        if not isinstance(event[DATA], Frame) or event[SOURCE] not in self._on_air:
            return set()
        return self._horizon.silent_before(event[DATA].start_ns + event[DATA].airtime_ns, self._on_air)

    def hold(self) -> int:
        """Stand still; the instant that no event handled and no promise given has passed."""
        self._held = True
        promised = max((told for told in self._told.values() if told < FOREVER_NS), default=0)
        return max(promised, self._node.now_ns)

    def release(self) -> None:
        """Go on."""
        self._held = False
        self.advance()

    def end_at(self, instant_ns: int) -> bool:
        """End the run at an instant beyond every promise."""
        self._end_ns = instant_ns
        return instant_ns > self._node.now_ns

    def arm(self, faults: Iterable[Fault], instant_ns: int) -> bool:
        """Arm live faults while held; their instant lies beyond every promise."""
        in_time = instant_ns > self._node.now_ns
        for fault in faults:
            self._node.arm(fault)
        self._horizon.intervene(instant_ns)
        for outlet, told in self._told.items():
            if told >= FOREVER_NS:
                self._told[outlet] = instant_ns
        for source in self._node.neighbours:
            self._horizon.relink(source, self._segments(source))
            self._expect(source)
        return in_time

    def gone(self, agent: str, incarnation: int) -> None:
        """A life ended from outside: nothing of it that has not come yet counts."""
        self._horizon.gone(agent, incarnation)
        self.advance()

    def close(self) -> None:
        """Nothing to give back."""
