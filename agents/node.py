"""A node carries one agent: its events, its links to the neighbours and the faults that touch them.

A node is pure: it is told what arrives and which events are due, and says what it puts on the wire. The twin runs all
nodes on one heap; a process runs one node on a heap of its own. Both run this same code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from heapq import heappush
from operator import itemgetter
from typing import Any

from ..errors import BadInput
from ..transport import links
from ..transport.events import (
    DATA,
    FAULT,
    FOREVER_NS,
    FRAME,
    HANDLER,
    OFFER,
    RANK,
    SENSE,
    SOURCE,
    TIME,
    TIMER,
    TRANSMIT,
    Event,
)
from ..transport.faults import Fault, Kill, LinkFault, Pause, effective
from ..transport.frames import Frame
from ..units import first_period, period_ns
from .agent import Agent, Received, Sample, Timer
from .context import NodeContext
from .journal import Batch, Dropped, Heard, Late, Sent
from .plan import Plan
from .registry import find

_INCARNATION_SHIFT = 48
_ACCESS_FIELDS = {"medium", "rate", "overhead", "bits_per_byte"}
Put = Callable[[str, Frame], None]


class FrameTooLarge(BadInput):
    """A payload over the MTU of its link."""


class Node:
    """One agent with its links.

    Args:
        plan: what is run.
        name: which of its agents.
        heap: where events go; shared between the nodes of a twin.
        put: called with (neighbour, frame) when a transmission starts.
        incarnation: 0 at first, one more after each restart.
        start_ns: when the agent comes to life.
        index: place among the nodes that share the heap.

    `now_ns` never goes back; `event_ns`, the time of the event in hand, lies before it where that event had to wait.
    """

    def __init__(
        self,
        plan: Plan,
        name: str,
        heap: list[Event],
        put: Put,
        incarnation: int = 0,
        start_ns: int = 0,
        index: int = 0,
    ) -> None:
        me = plan.agent(name)
        self.plan, self.name, self.incarnation, self.index = plan, name, incarnation, index
        self.neighbours = me.neighbours
        self.compute_ns = me.compute_ns
        self.heap = heap
        self.journal = Batch(name, incarnation)
        self.now_ns = self.event_ns = start_ns
        self.dead = False
        self.start_ns = start_ns
        self.faults: dict[str, Fault] = {}
        self.in_frame = False
        self.sent = dict.fromkeys(me.neighbours, 0)
        self.senders = {
            target: links.Sender(plan.seed, name, target, incarnation, plan.links[name, target])
            for target in me.neighbours
        }
        self._put = put
        self._last: Event = (start_ns, FAULT, "", -1, 0, index, self._on_fault, None)
        self._waiting: list[tuple[Event, Callable[[Event], None]]] | None = None
        self._next_start: dict[str, int] = {}
        self._count = 0
        self._fault_instants: set[int] = set()
        kind = find(me.kind)
        self.timers_only = kind.timers_only
        self.agent: Agent = kind(NodeContext(self, me), me.parameters)
        self._begin(start_ns)

    def _begin(self, start_ns: int) -> None:
        for fault in self.plan.faults:
            self.arm(fault)
        if self.plan.world is not None:
            for sensor, rate in self.plan.world.sensors(self.name).items():
                self._schedule_sample(sensor, rate, first_period(rate, start_ns))
        self.agent.start()

    # -- events -------------------------------------------------------------------------------------------------

    def _schedule(
        self, time_ns: int, rank: int, source: str, sequence: int, handler: Callable[[Event], None], data: Any
    ) -> None:
        heappush(self.heap, (time_ns, rank, source, sequence, 0, self.index, handler, data))

    def _schedule_sample(self, sensor: str, rate: float, index: int) -> None:
        self._schedule(
            period_ns(rate, index), SENSE, f"{self.name}.{sensor}", index, self._on_sense, (sensor, rate, index)
        )

    def _on_sense(self, event: Event) -> None:
        if self.dead:
            return
        sensor, rate, index = event[DATA]
        self._schedule_sample(sensor, rate, index + 1)
        self._admit(event, self._sense)

    def _sense(self, event: Event) -> None:
        sensor, _, index = event[DATA]
        assert self.plan.world is not None
        value = self.plan.world.measure(self.name, sensor, index)
        self.agent.on_sample(Sample(sensor, index, event[TIME], value))

    def _on_timer(self, event: Event) -> None:
        self._admit(event, self._ring)

    def _ring(self, event: Event) -> None:
        timer: Timer = event[DATA]
        self.event_ns = timer.time_ns
        self.agent.on_timer(timer)

    def _admit(self, event: Event, act: Callable[[Event], None]) -> None:
        """Let the agent handle an event, unless its processor stands still: then it waits for its turn."""
        if self.dead:
            return
        if self._waiting is not None:
            self.now_ns = max(self.now_ns, event[TIME])
            self._waiting.append((event, act))
            return
        if event > self._last:
            self._last = event
            self.now_ns = event[TIME]
        self._handle(event, act)

    def _handle(self, event: Event, act: Callable[[Event], None]) -> None:
        self.event_ns = event[TIME]
        act(event)

    # -- frames that come in ------------------------------------------------------------------------------------

    def receive(self, source: str, frame: Frame) -> None:
        """Take in a frame as soon as the network has it; it is handled when it is due, or at once if it is late.

        A frame that started before this incarnation came to life is none of its business.
        """
        if frame.start_ns < self.start_ns:
            return
        sequence = (frame.incarnation << _INCARNATION_SHIFT) + frame.sequence
        event = (frame.due_ns, FRAME, source, sequence, 0, self.index, self._on_arrival, frame)
        if event < self._last:
            behind = self.now_ns - frame.due_ns
            self.journal.late.append(Late(source, frame.incarnation, frame.sequence, frame.due_ns, behind))
            self._on_arrival(event)
        else:
            heappush(self.heap, event)

    def _on_arrival(self, event: Event) -> None:
        frame: Frame = event[DATA]
        if self.dead and frame.due_ns >= self.now_ns:
            return
        source = event[SOURCE]
        deaf = self.senders[source].transceiver.deaf(frame.start_ns, frame.start_ns + frame.airtime_ns)
        fate = links.fate(frame.verdict, deaf=deaf)
        self.journal.heard.append(Heard(source, frame.incarnation, frame.sequence, frame.due_ns, fate))
        if fate == links.DELIVERED:
            self._admit(event, self._deliver)

    def _deliver(self, event: Event) -> None:
        frame: Frame = event[DATA]
        self.in_frame = True
        self.agent.on_frame(Received(event[SOURCE], frame.payload, frame.due_ns))
        self.in_frame = False

    # -- frames that go out -------------------------------------------------------------------------------------

    def send(self, target: str, payload: bytes, stream: str) -> None:
        """Hand a payload to a link; it is offered `compute` later.

        Raises:
            FrameTooLarge: the payload is over the MTU; it counts as refused.
        """
        sender = self.senders[target]
        if len(payload) > sender.settings.mtu:
            self.journal.dropped.append(Dropped(target, sender.refuse(), self.now_ns, "refused"))
            raise FrameTooLarge(
                f"agent {self.name}: {len(payload)} B for {target}, the link's MTU is {sender.settings.mtu} B"
            )
        self._count += 1
        self._schedule(self.now_ns + self.compute_ns, OFFER, target, self._count, self._on_offer, (payload, stream))

    def set_timer(self, timer: Timer) -> None:
        """Schedule a timer of the agent; one that is over because the event in hand had to wait rings at once."""
        self._count += 1
        self._schedule(max(timer.time_ns, self.now_ns), TIMER, self.name, self._count, self._on_timer, timer)

    def _on_offer(self, event: Event) -> None:
        if self.dead:
            return
        target = event[SOURCE]
        for sequence in self.senders[target].offer(event[TIME], *event[DATA]):
            self.journal.dropped.append(Dropped(target, sequence, event[TIME], "queue"))
        self._pump(target, event[TIME])

    def _on_transmit(self, event: Event) -> None:
        if self.dead:
            return
        target = event[SOURCE]
        if self.awaits(event):
            del self._next_start[target]
        self._pump(target, event[TIME])

    def _pump(self, target: str, now_ns: int) -> None:
        """Start the next frame if it may start now; while frames wait, there is an event for the next start."""
        sender = self.senders[target]
        start = sender.next_start(now_ns)
        if start is None or start > now_ns:
            self._come_back(target, start)
            return
        frame = sender.transmit(now_ns)
        self._come_back(target, sender.next_start(now_ns))
        self._transmit(target, frame)

    def transmit_ahead(self, before_ns: int) -> None:
        """Put frames on the wire whose start is settled and lies before an instant, as no fault comes in between.

        Their nominal start, and all that follows from it, is the same; the network gains the time until then.
        """
        if self.dead:
            return
        before_ns = min([before_ns, *(instant for instant in self._fault_instants if instant >= self.now_ns)])
        for target, sender in self.senders.items():
            while sender.settled and (start := self._next_start.get(target, before_ns)) < before_ns:
                del self._next_start[target]
                frame = sender.transmit_ahead(start)
                self._come_back(target, sender.next_start(start))
                self._transmit(target, frame)

    def awaits(self, transmit: Event) -> bool:
        """Whether a frame still waits for this start, and was not put on the wire ahead of it."""
        return self._next_start.get(transmit[SOURCE]) == transmit[TIME]

    def _come_back(self, target: str, start: int | None) -> None:
        if start is not None and start < self._next_start.get(target, FOREVER_NS):
            self._next_start[target] = start
            self._count += 1
            self._schedule(start, TRANSMIT, target, self._count, self._on_transmit, None)

    def _transmit(self, target: str, frame: links.Transmission) -> None:
        sequence, payload, start, airtime, due, verdict = frame
        self.journal.sent.append(Sent(target, sequence, len(payload), start, airtime, due, verdict))
        self.sent[target] += 1
        carried = payload if verdict == links.DELIVERED else b""
        self._put(
            target, Frame(self.incarnation, sequence, start, airtime, due, verdict, carried, self.sent[target], None)
        )

    # -- faults -------------------------------------------------------------------------------------------------

    def arm(self, fault: Fault) -> None:
        """Take note of a fault, or of a new end of one that is known; what does not touch this node is passed over."""
        sources = {source for source, _ in fault.links} if isinstance(fault, LinkFault) else {fault.agent}
        if self.name not in sources or (isinstance(fault, Kill) and fault.at_ns < self.start_ns):
            return
        known = self.faults.get(fault.id)
        self.faults[fault.id] = fault
        self._fault_instants |= {fault.at_ns, FOREVER_NS if fault.until_ns is None else fault.until_ns}
        if known is None or known.at_ns != fault.at_ns:
            self._schedule(max(fault.at_ns, self.start_ns), FAULT, fault.id, 0, self._on_fault, fault.id)
        if fault.until_ns is not None and (known is None or known.until_ns != fault.until_ns):
            self._schedule(max(fault.until_ns, self.start_ns), FAULT, fault.id, 1, self._on_fault, fault.id)

    def _on_fault(self, event: Event) -> None:
        if self.dead:
            return
        fault = self.faults[event[DATA]]
        self._last = max(self._last, event)
        self.now_ns = max(self.now_ns, event[TIME])
        if isinstance(fault, LinkFault):
            self._change_links(fault)
        elif isinstance(fault, Pause):
            self._stand_still_or_go_on()
        elif event[TIME] == fault.at_ns:
            self._die()

    def _change_links(self, fault: LinkFault) -> None:
        all_faults = [other for other in self.faults.values() if isinstance(other, LinkFault)]
        for source, target in fault.links:
            if source == self.name:
                settings = effective(self.plan.links[source, target], (source, target), all_faults, self.now_ns)
                sender = self.senders[target]
                sender.change(settings)
                self._come_back(target, sender.next_start(self.now_ns))

    def _die(self) -> None:
        self.finish()
        self.journal.events.append({"event": "killed", "time_ns": self.now_ns})
        self.dead = True

    def _stand_still_or_go_on(self) -> None:
        """Stand still as long as any pause is in force; then handle what came meanwhile, in order."""
        pauses = (fault for fault in self.faults.values() if isinstance(fault, Pause))
        if any(fault.in_force(self.now_ns) for fault in pauses):
            self._waiting = self._waiting or []
        elif self._waiting is not None:
            waiting, self._waiting = self._waiting, None
            for event, act in sorted(waiting, key=itemgetter(0)):
                self._handle(event, act)

    # -- the end, and what can be promised ----------------------------------------------------------------------

    def finish(self) -> None:
        """Write down which frames still wait for their transmitter."""
        for target, sender in self.senders.items():
            if waiting := sender.waiting():
                self.journal.events.append({"event": "queued", "target": target, "sequences": waiting})

    def take_journal(self) -> Batch:
        """The entries since the last call."""
        batch, self.journal = self.journal, Batch(self.name, self.incarnation)
        return batch

    def promises(self, targets: Iterable[str], arrivals_ns: int) -> dict[str, int]:
        """For each target the earliest instant at which the next transmission to it can start, or for ever.

        An agent that stands still may be told to go on at any instant that nobody has passed.

        Args:
            targets: neighbours.
            arrivals_ns: no frame that is yet unheard is due before this.
        """
        if self.dead:
            return dict.fromkeys(targets, FOREVER_NS)
        on_timers = self.timers_only and self._waiting is None
        acts = FOREVER_NS if on_timers else arrivals_ns
        starts, changes = dict.fromkeys(self.senders, FOREVER_NS), dict.fromkeys(self.senders, FOREVER_NS)
        for event in self.heap:
            time_ns, rank = event[TIME], event[RANK]
            if rank >= OFFER:
                starts[event[SOURCE]] = min(time_ns, starts[event[SOURCE]])
            elif time_ns < acts and not (on_timers and event[HANDLER] == self._on_arrival):
                acts = time_ns
            if rank == FAULT:
                for target in self._accesses_changed(self.faults[event[DATA]]):
                    changes[target] = min(time_ns, changes[target])
        ready = {target: min(acts + self.compute_ns, starts[target]) for target in targets}
        return {
            target: min(self.senders[target].earliest_next(ready_ns), changes[target])
            if ready_ns < FOREVER_NS
            else FOREVER_NS
            for target, ready_ns in ready.items()
        }

    def _accesses_changed(self, fault: Fault) -> Iterable[str]:
        """The neighbours to whom frames may start at other instants once a fault begins or ends."""
        if not isinstance(fault, LinkFault) or not _ACCESS_FIELDS & fault.changes.keys():
            return ()
        return (target for source, target in fault.links if source == self.name)
