"""A node carries one agent: its events, its links to the neighbours and the faults that touch them.

A node is pure: it is told what arrives and which events are due, and says what it puts on the wire. The twin runs all
nodes on one heap; a process runs one node on a heap of its own. Both run this same code. `sender` has its
transmitters, `receiver` what comes in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from heapq import heappush
from operator import itemgetter
from typing import Any

import msgpack

from ..transport.clock import Clock
from ..transport.events import (
    DATA,
    FAULT,
    FOREVER_NS,
    HANDLER,
    OFFER,
    OVER_NS,
    RANK,
    SENSE,
    SOURCE,
    TIME,
    TIMER,
    TRANSMIT,
    Event,
)
from ..transport.faults import ClockFault, Fault, Hog, Kill, LinkFault, Pause, SensorFault, effective
from ..transport.frames import Frame, Message
from ..transport.links import LinkSettings
from ..units import first_period, period_ns
from .agent import Agent, Received, Sample, Timer
from .context import NodeContext
from .journal import Batch
from .plan import WORLD, Plan
from .receiver import Receiver
from .registry import find
from .sender import Put, Sender
from .sensor_samples import measured
from .wires import unpack_samples

_ACCESS_FIELDS = {"medium", "rate", "overhead", "bits_per_byte", "bucket"}
_GRAPH = "graph"


class Node:
    """One agent with its links.

    Args:
        plan: what is run.
        name: which of its agents.
        heap: where events go; shared between the nodes of a twin.
        put: called with (outlet, message) when a transmission starts.
        incarnation: 0 at first, one more after each restart.
        start_ns: when the agent comes to life.
        index: place among the nodes that share the heap.
        saved: what the agent's last life has left, where that is kept.

    `now_ns` never goes back; `event_ns`, the time of the event in hand, lies before it where that event had to wait.
    `neighbours` are all that it ever has, those to whom it is wired included, `present` those in the graph now. `known`
    are all faults of the run that it was told of, `faults` those that touch it. `hogged` is the share of its processor
    that something else takes, which nothing but the wall clock notices.
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
        saved: bytes | None = None,
    ) -> None:
        me = plan.agent(name)
        self.plan, self.name, self.incarnation, self.index = plan, name, incarnation, index
        self.wired = me.wired
        self.neighbours = me.neighbours + me.wired
        self.present = plan.present(name, start_ns)
        self.degrees = plan.degrees(name, start_ns)
        self.compute_ns = me.compute_ns
        self.heap = heap
        self.journal = Batch(name, incarnation)
        self.now_ns = self.event_ns = start_ns
        self.dead = False
        self.start_ns = start_ns
        self.known: dict[str, Fault] = {}
        self.faults: dict[str, Fault] = {}
        self.clock = Clock()
        self.in_frame = False
        self.hogged = 0.0
        self._last: Event = (start_ns, FAULT, "", -1, 0, index, self._on_fault, None)
        self._waiting: list[tuple[Event, int, Callable[[Event], None]]] | None = None
        self._timers: dict[int, tuple[int, Timer]] = {}
        self._count = 0
        self._changes_ns: set[int] = set()
        self.sender = Sender(self, put)
        self.receiver = Receiver(self)
        kind = find(me.kind)
        self.timers_only = kind.timers_only
        self.agent: Agent = kind(NodeContext(self, me), me.parameters)
        self.saved = saved
        self._begin(start_ns)

    def _begin(self, start_ns: int) -> None:
        for fault in self.plan.faults:
            self.arm(fault)
        self._read_clock()
        self.event_ns = self.clock.reading(start_ns)
        for source in self.neighbours:
            self._hold_or_release(source)
        for number, time_ns in enumerate(self.plan.graph_changes(self.name)):
            if time_ns > start_ns:
                self._changes_ns.add(time_ns)
                self.schedule(time_ns, FAULT, _GRAPH, number, self._on_graph, None)
        if self.plan.world is not None:
            for sensor, rate in self.plan.world.sensors(self.name).items():
                self._schedule_sample(sensor, rate, first_period(rate, start_ns))
        self.agent.start()
        if self.saved is not None:
            self.agent.restore(msgpack.unpackb(self.saved))

    # -- events -------------------------------------------------------------------------------------------------

    def schedule(
        self, time_ns: int, rank: int, source: str, sequence: int, handler: Callable[[Event], None], data: Any
    ) -> None:
        """Put an event of this node into the heap."""
        heappush(self.heap, (time_ns, rank, source, sequence, 0, self.index, handler, data))

    def push(self, event: Event) -> None:
        """Put an event into the heap whose key is made already."""
        heappush(self.heap, event)

    def has_passed(self, event: Event) -> bool:
        """Whether something later was handled already."""
        return event < self._last

    def _schedule_sample(self, sensor: str, rate: float, index: int) -> None:
        self.schedule(
            period_ns(rate, index), SENSE, f"{self.name}.{sensor}", index, self._on_sense, (sensor, rate, index)
        )

    def _on_sense(self, event: Event) -> None:
        if self.dead:
            return
        sensor, rate, index = event[DATA]
        self._schedule_sample(sensor, rate, index + 1)
        self.admit(event, self._sense)

    def _sense(self, event: Event) -> None:
        sensor, _, index = event[DATA]
        value = measured(self.plan, self.faults.values(), self.name, sensor, index)
        self.agent.on_sample(Sample(sensor, index, self.event_ns, value))

    def clock_jumps(self) -> bool:
        """Whether the agent's own clock may have jumped over an instant that it planned for."""
        return any(isinstance(fault, ClockFault) and fault.at_ns <= self.now_ns for fault in self.faults.values())

    def set_timer(self, timer: Timer) -> None:
        """Schedule a timer by the agent's own clock; one that is over rings at once."""
        self._count += 1
        self._arm_timer(self._count, timer)

    def _arm_timer(self, count: int, timer: Timer) -> None:
        time_ns = self.clock.when(timer.time_ns, self.now_ns)
        self._timers[count] = time_ns, timer
        self.schedule(time_ns, TIMER, self.name, count, self._on_timer, count)

    def _on_timer(self, event: Event) -> None:
        time_ns, timer = self._timers.get(event[DATA], (-1, None))
        if time_ns == event[TIME]:
            del self._timers[event[DATA]]
            self.admit((*event[:DATA], timer), self._ring)

    def _ring(self, event: Event) -> None:
        timer: Timer = event[DATA]
        self.event_ns = timer.time_ns
        self.agent.on_timer(timer)

    def admit(self, event: Event, act: Callable[[Event], None]) -> None:
        """Let the agent handle an event, unless its processor stands still: then it waits for its turn."""
        if self.dead:
            return
        if self._waiting is not None:
            self.now_ns = max(self.now_ns, event[TIME])
            self._waiting.append((event, self.clock.reading(event[TIME]), act))
            return
        if event > self._last:
            self._last = event
            self.now_ns = event[TIME]
        self.event_ns = self.clock.reading(event[TIME])
        act(event)

    # -- frames -------------------------------------------------------------------------------------------------

    def receive(self, source: str, message: Message) -> None:
        """Take in a message as soon as the network has it."""
        self.receiver.receive(source, message)

    def deliver(self, event: Event) -> None:
        """Hand a frame to the agent; its stamp is that of the agent's own clock."""
        frame: Frame = event[DATA]
        if event[SOURCE] == WORLD:
            for sample in unpack_samples(frame.payload, self.clock.reading):
                self.agent.on_sample(sample)
            return
        self.in_frame = True
        self.agent.on_frame(Received(event[SOURCE], frame.payload, self.event_ns))
        self.in_frame = False

    def transmit_ahead(self, before_ns: int) -> None:
        """Put frames on the wire whose start lies before an instant, as far as nothing changes until then."""
        if not self.dead:
            changes = (instant for instant in self._changes_ns if instant >= self.now_ns)
            self.sender.transmit_ahead(min([before_ns, *changes]))

    # -- faults and the graph -----------------------------------------------------------------------------------

    def arm(self, fault: Fault) -> None:
        """Take note of a fault, or of a new end of one that is known; what does not touch this node is only known."""
        self.known[fault.id] = fault
        if not self._touches(fault) or (isinstance(fault, Kill) and fault.at_ns < self.start_ns):
            return
        known = self.faults.get(fault.id)
        self.faults[fault.id] = fault
        self._changes_ns |= {fault.at_ns, FOREVER_NS if fault.until_ns is None else fault.until_ns}
        if known is None or known.at_ns != fault.at_ns:
            self.schedule(max(fault.at_ns, self.start_ns), FAULT, fault.id, 0, self._on_fault, fault.id)
        if fault.until_ns is not None and (known is None or known.until_ns != fault.until_ns):
            self.schedule(max(fault.until_ns, self.start_ns), FAULT, fault.id, 1, self._on_fault, fault.id)

    def _touches(self, fault: Fault) -> bool:
        """A link's settings are its source's business, and frames are held back at its target."""
        if isinstance(fault, SensorFault) and self.plan.world_agents:
            return self.name == WORLD
        if not isinstance(fault, LinkFault):
            return fault.agent == self.name
        ends = {source for source, _ in fault.links}
        if "hold" in fault.changes:
            ends |= {target for _, target in fault.links}
        return self.name in ends

    def _on_fault(self, event: Event) -> None:
        if self.dead:
            return
        fault = self.faults[event[DATA]]
        self._note_time(event)
        if isinstance(fault, LinkFault):
            self._change_links(fault)
        elif isinstance(fault, Pause):
            self._stand_still_or_go_on()
        elif isinstance(fault, ClockFault):
            self._set_clock()
        elif isinstance(fault, Hog):
            hogs = (other for other in self.faults.values() if isinstance(other, Hog))
            self.hogged = max((hog.share for hog in hogs if hog.in_force(self.now_ns)), default=0.0)
        elif isinstance(fault, Kill) and event[TIME] == fault.at_ns:
            self._die(fault)

    def _note_time(self, event: Event) -> None:
        self._last = max(self._last, event)
        self.now_ns = max(self.now_ns, event[TIME])

    def settings(self, target: str) -> LinkSettings:
        """Of the link to a neighbour, now: its own, changed by the faults in force and by the graph."""
        settings = self._effective((self.name, target))
        return settings if target in self.present or target in self.wired else replace(settings, present=False)

    def _effective(self, link: tuple[str, str]) -> LinkSettings:
        faults = [fault for fault in self.faults.values() if isinstance(fault, LinkFault)]
        return effective(self.plan.settings(link), link, faults, self.now_ns)

    def _change_links(self, fault: LinkFault) -> None:
        for source, target in fault.links:
            if source == self.name:
                self.sender.change(target, self.settings(target))
            elif target == self.name and "hold" in fault.changes:
                self._hold_or_release(source)

    def holds(self, source: str) -> bool:
        """Whether the link from a neighbour holds frames back now."""
        return self._effective((source, self.name)).hold

    def _hold_or_release(self, source: str) -> None:
        if self.holds(source):
            self.receiver.hold(source)
        else:
            self.receiver.release(source)

    def _on_graph(self, event: Event) -> None:
        """Neighbours come and go."""
        if self.dead:
            return
        self._note_time(event)
        self.present = self.plan.present(self.name, event[TIME])
        self.degrees = self.plan.degrees(self.name, event[TIME])
        for target in self.neighbours:
            self.sender.change(target, self.settings(target))
        self.admit(event, lambda _event: self.agent.on_neighbours())

    def _set_clock(self) -> None:
        """Another reading from now on: pending timers are armed anew."""
        self._read_clock()
        self.sender.set_clock(self.clock)
        for count, (_, timer) in list(self._timers.items()):
            self._arm_timer(count, timer)

    def _read_clock(self) -> None:
        faults = (fault for fault in self.faults.values() if isinstance(fault, ClockFault))
        self.clock = Clock(fault for fault in faults if fault.in_force(self.now_ns))

    def _die(self, kill: Kill) -> None:
        self.finish()
        if kill.keep_state:
            self.saved = msgpack.packb(self.agent.save())
            self.journal.events.append({"event": "state", "state": self.saved.hex()})
        self.journal.events.append({"event": "killed", "time_ns": self.now_ns})
        self.dead = True

    def _stand_still_or_go_on(self) -> None:
        """Stand still as long as any pause is in force; then handle what came meanwhile, in order."""
        pauses = (fault for fault in self.faults.values() if isinstance(fault, Pause))
        if any(fault.in_force(self.now_ns) for fault in pauses):
            self._waiting = self._waiting or []
        elif self._waiting is not None:
            waiting, self._waiting = self._waiting, None
            for event, reading_ns, act in sorted(waiting, key=itemgetter(0)):
                self.event_ns = reading_ns
                act(event)

    def gone(self, agent: str, incarnation: int) -> None:
        """The life of an agent ended from outside."""
        if agent in self.neighbours:
            self.receiver.gone(agent, incarnation)

    # -- the end, and what can be promised ----------------------------------------------------------------------

    def finish(self) -> None:
        """Write down which frames still wait for their transmitter, and which are held back."""
        self.sender.finish()
        self.receiver.finish()

    def take_journal(self) -> Batch:
        """The entries since the last call."""
        batch, self.journal = self.journal, Batch(self.name, self.incarnation)
        return batch

    def heeded(self) -> tuple[str, ...]:
        """Whose frames may make the agent act: everybody's, or the world's alone if it acts on samples and timers."""
        if not self.timers_only or self._waiting is not None:
            return self.neighbours
        return tuple(name for name in self.wired if name == WORLD)

    def promises(self, arrivals_ns: int) -> dict[str, int]:
        """For each outlet the earliest instant at which its next transmission can start, or for ever.

        An agent that stands still may be told to go on at any instant that nobody has passed.

        Args:
            arrivals_ns: no frame of those who are heeded that is yet unheard is due before this.
        """
        if self.dead:
            return dict.fromkeys(self.sender.outlets, OVER_NS)
        heeded = self.heeded()
        acts = arrivals_ns
        starts, changes = (dict.fromkeys(self.sender.outlets, FOREVER_NS) for _ in range(2))
        for event in self.heap:
            time_ns, rank = event[TIME], event[RANK]
            if rank >= OFFER and not (rank == TRANSMIT and self.sender.contends(event[SOURCE])):
                starts[event[SOURCE]] = min(time_ns, starts[event[SOURCE]])
            elif rank < OFFER and time_ns < acts and (event[SOURCE] in heeded or not isinstance(event[DATA], Frame)):
                acts = time_ns
            if rank == FAULT:
                for name in self._accesses_changed(event):
                    changes[name] = min(time_ns, changes[name])
        ready = {name: min(acts + self.compute_ns, start) for name, start in starts.items()}
        return {name: min(start, changes[name]) for name, start in self.sender.earliest_starts(ready).items()}

    def _accesses_changed(self, event: Event) -> Iterable[str]:
        """The outlets whose frames may start at other instants once a fault begins or ends."""
        fault = self.faults.get(event[DATA]) if event[HANDLER] == self._on_fault else None
        if isinstance(fault, ClockFault):
            return self.sender.outlets
        if not isinstance(fault, LinkFault) or not _ACCESS_FIELDS & fault.changes.keys():
            return ()
        return {self.sender.outlet_of[target] for source, target in fault.links if source == self.name}
