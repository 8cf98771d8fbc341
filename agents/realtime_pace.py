"""Realtime pace: an event is handled when the wall clock has reached it."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterable
from heapq import heappop
from typing import Any

from ..transport.events import FOREVER_NS, HANDLER, OFFER, RANK, TIME, TRANSMIT, Event
from ..transport.faults import Fault
from ..transport.frames import PROMISE_ONLY, Message
from .cpu_hog import Burner
from .mailbox import Mailbox
from .node import Node
from .run_start import AHEAD_NS, LATENESS_KEPT, Guard, RunStart, Write
from .wall_clock import WallClock

_GRACE_S = 0.1
_DRAIN_S = 0.05
"""How long a killed agent still receives what was due before its end."""


class Realtime:
    """Handles each event when the wall clock reaches its nominal time, and transmissions a little earlier.

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
        self._done = done
        self._shutdown: asyncio.TimerHandle | None = None
        self._clock = WallClock(loop, guard(self.advance), speed)
        self._armed_ns = 0
        self._burner = Burner()
        self._burning = 0.0

    def begin(self, node: Node, run_start: RunStart) -> None:
        """Start the clock."""
        self._node, self._state = node, node.state
        node.receiver.wall_ns = self.now_ns
        self._clock.epoch_ns = run_start.epoch_ns
        self._end_ns = run_start.end_ns
        self._ahead_ns = int(AHEAD_NS * self._clock.speed)
        self._early_ns = min(node.state.compute_ns, self._ahead_ns)
        for source, incarnation in run_start.external_kills:
            self.external_kill(source, incarnation)
        self.advance()

    def now_ns(self) -> int:
        """Nominal time by the wall clock."""
        return self._clock.now_ns()

    def arrived(self, source: str, frame: Message) -> None:
        """Keep a frame until it is due, or wake up earlier for it; called on Zenoh's thread."""
        if frame.sequence == PROMISE_ONLY:
            return
        self.mail.put(source, frame, time.monotonic_ns())
        if self._armed_ns and frame.due_ns < self._armed_ns:
            self._arm_timer(frame.due_ns)

    def put(self, target: str, frame: Message) -> None:
        """Keep a frame until the turn is over: frames sent together cost fewer wake-ups of Zenoh's threads."""
        self._outbox.append((target, frame))

    def _send(self) -> None:
        for target, frame in self._outbox:
            self._write(target, frame)
        self._outbox.clear()

    def _arm_timer(self, time_ns: int) -> None:
        self._armed_ns = time_ns
        self._clock.wake_at(time_ns)

    def advance(self) -> None:
        """Handle what is due, then sleep until the next event.

        The mail is read again once the timer is set: what came in between may be due before that.
        """
        while True:
            for source, frame, arrived_ns in self.mail.take():
                self._node.receiver.receive(source, frame, self._clock.nominal_ns(arrived_ns))
            self._arm_timer(self._handle_due())
            if not self.mail:
                return

    def _handle_due(self) -> int:
        """Handle every event whose time has come; the nominal instant at which the next one needs attention."""
        node, heap = self._node, self._state.heap
        now = self.now_ns()
        limit, link_limit = min(now, self._end_ns - 1), min(now + self._early_ns, self._end_ns - 1)
        if heap and heap[0][TIME] <= limit and len(self.lateness_ns) < LATENESS_KEPT:
            self.lateness_ns.append(now - heap[0][TIME])
        while heap and (heap[0][TIME] <= limit or (heap[0][RANK] >= OFFER and heap[0][TIME] <= link_limit)):
            event = heappop(heap)
            event[HANDLER](event)
        if node.hogged != self._burning:
            self._burning = node.hogged
            self._burner.burn(self._burning)
        node.transmit_ahead(min(now + self._ahead_ns, self._end_ns))
        while heap and heap[0][RANK] == TRANSMIT and not node.sender.awaits(heap[0]):
            heappop(heap)
        self._send()
        if heap and heap[0][TIME] < self._end_ns and not node.state.dead:
            return self._wake_for(heap[0], now)
        if self._shutdown is None:
            remaining_s = max(0.0, (self._end_ns - now) / 1e9 / self._clock.speed)
            self._shutdown = self._loop.call_later(_DRAIN_S if node.state.dead else remaining_s + _GRACE_S, self._done)
        return FOREVER_NS

    def _wake_for(self, event: Event, now_ns: int) -> int:
        """The nominal instant at which the next event needs attention."""
        time_ns, rank = event[TIME], event[RANK]
        if rank == TRANSMIT and time_ns - self._ahead_ns > now_ns:
            return time_ns - self._ahead_ns
        return time_ns - self._early_ns if rank >= OFFER else time_ns

    def arm(self, faults: Iterable[Fault], instant_ns: int) -> bool:
        """Arm live faults that change something from an instant on; whether there is time left until then.

        Of a fault that is armed anew for a later start, the earlier one must not have passed either.
        """
        faults, passed_ns = list(faults), self.freeze()
        known = self._node.known
        moved = (known[new.id].at_ns for new in faults if new.id in known and known[new.id].at_ns != new.at_ns)
        in_time = min([instant_ns, *moved]) > passed_ns
        for fault in faults:
            self._node.arm(fault)
        self._cancel_shutdown()
        self.advance()
        return in_time

    def _cancel_shutdown(self) -> None:
        """Cancel the pending shutdown."""
        if self._shutdown is not None and not self._state.dead:
            self._shutdown.cancel()
            self._shutdown = None

    def end_at(self, instant_ns: int) -> bool:
        """End the run at an instant; whether it is still to come."""
        in_time = instant_ns > self.freeze()
        self._end_ns = instant_ns
        self._cancel_shutdown()
        self.advance()
        return in_time

    def freeze(self) -> int:
        """The instant that no event handled so far has passed; wall time cannot be frozen."""
        return max(self.now_ns() + self._ahead_ns, self._state.now_ns)

    def prepare(self, instant_ns: int) -> bool:
        """Whether an instant is still to come; wall time does not wait for it."""
        return instant_ns > self.freeze()

    def thaw(self) -> None:
        """Nothing was frozen."""

    def external_kill(self, agent: str, incarnation: int) -> None:
        """Note an incarnation that was killed externally; in this pace nobody waits for it."""
        self._node.receiver.external_kill(agent, incarnation)

    def close(self) -> None:
        """Stop the timer, and whatever hogs the processor."""
        self._burner.burn(0.0)
        self._clock.close()

    def take_behind_ns(self) -> int:
        """Nothing: in this pace, what is behind is late, and journalled."""
        return 0

    def timing(self) -> dict[str, Any]:
        """By how much later than due events were handled, in nominal time."""
        return {"lateness_ns": self.lateness_ns}
