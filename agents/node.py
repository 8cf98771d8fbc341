"""A node runs one agent: its events, its links to the neighbours and the faults that touch them.

A node is pure: it is told what arrives and which events are due, and says what it puts on the wire. The twin runs all
nodes on one heap; a process runs one node on a heap of its own. Its `sender` has the transmitters, its `receiver` what
comes in; both share its `state`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import replace
from operator import itemgetter
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput, RunFailed, VoleryError
from ..transport.clock import Clock
from ..transport.events import (
    DATA,
    FAULT,
    FOREVER_NS,
    HANDLER,
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
from ..transport.media import Ether
from ..units import SampleTimes, first_sample, sample_ns
from ..user_code import described
from .agent import Agent, Apply, Command, Context, ContextState, Note, Received, Report, Sample, Send, Timer
from .call_checks import plain
from .coupled_world import KIND as COUPLED_WORLD
from .coupled_world import WorldContext
from .journal import NOTED, Batch, Commanded, Estimate, Measured, Payload, Taken
from .node_state import NodeState
from .plan import WORLD, Plan, frame_measuring
from .receiver import Receiver
from .registry import find
from .sender import Put, Sender
from .sensor_samples import measured
from .wires import pack_commands, unpack_samples

_ACCESS_FIELDS = {"medium", "rate", "overhead", "bits_per_byte", "bucket"}
_GRAPH = "graph"
_MOST_RINGS = 20_000
"""So many timers may ring at one instant, as after a pause; more of them are an agent that holds time up."""


class Node:
    """One agent with its links.

    Args:
        plan: what is run.
        name: which of its agents.
        heap: where events go; shared between the nodes of a twin.
        put: called with (outlet, message) when a transmission starts.
        incarnation: 0 at first, one more after each restart.
        start_ns: when this incarnation starts.
        index: place among the nodes that share the heap.
        saved: what the incarnation before has saved, if it was to.

    `present` are the neighbours in the graph now. `known` are all faults of the run so far, `faults` those that touch
    this node. `hogged` is the share of its processor that something else takes, which nothing but the wall clock
    notices. `saved` is what the agent has saved when it was killed.
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
        self.state = NodeState(me, heap, incarnation, start_ns, index)
        self.known: dict[str, Fault] = {}
        self.faults: dict[str, Fault] = {}
        self.hogged = 0.0
        self.saved = saved
        self.plan = plan
        self.present = plan.present(name, start_ns)
        self._clock = Clock()
        self._waiting: list[tuple[Event, int, Callable[[Event], None]]] | None = None
        self._timers: dict[int, tuple[int, Timer]] = {}
        self._timer_count = 0
        self._rung = (-1, 0)
        self._changes_ns: set[int] = set()
        self._put_on_wire = put
        self._measuring = frame_measuring(plan.world)
        ether = Ether()
        settings = {target: self._settings(target) for target in self.state.neighbours}
        self.sender = Sender(self.state, plan, settings, ether, self._put)
        self.receiver = Receiver(self.state, self.sender, ether, self._on_delivery)
        kind = find(me.kind)
        self._timers_only = kind.timers_only
        briefing = self._call("briefing", kind.briefing, plan.public, name)
        self._told = ContextState(
            name,
            incarnation,
            plan.seed,
            swarm=tuple(agent.name for agent in plan.agents),
            position=me.position,
            briefing=briefing,
            commands_world=WORLD in me.wired,
            outlet_of=self.sender.outlet_of,
            mtus=self.sender.mtus,
            neighbours=self.present,
            degrees=plan.degrees(name, start_ns),
            now_ns=start_ns,
            event_ns=start_ns,
        )
        context = WorldContext(self._told, plan, self.faults) if me.kind == COUPLED_WORLD else Context(self._told)
        self.agent: Agent = self._call("__init__", kind, context, me.parameters)
        if getattr(self.agent, "context", None) is not context:
            raise RunFailed(
                f"agent {name} failed: {kind.__name__}.__init__ must call super().__init__(context, parameters)"
            )
        self._start()

    def _start(self) -> None:
        start_ns = self.state.start_ns
        for fault in self.plan.faults:
            self.arm(fault)
        self._read_clock()
        for source in self.state.neighbours:
            self._update_hold(source)
        for number, time_ns in enumerate(self.plan.graph_changes(self.state.name)):
            if time_ns > start_ns:
                self._changes_ns.add(time_ns)
                self.state.schedule(time_ns, FAULT, _GRAPH, number, self._on_graph, None)
        if self.plan.world is not None:
            for sensor, times in self.plan.world.sensors(self.state.name).items():
                self._schedule_sample(sensor, times, first_sample(times, start_ns))
        self._told.event_ns = self._clock.reading(start_ns)
        self.run_handler(self.agent.start)
        if self.saved is not None:
            self.run_handler(self.agent.restore, msgpack.unpackb(self.saved))

    # -- the agent ----------------------------------------------------------------------------------------------

    def run_handler(self, handler: Callable[..., None], *arguments: Any) -> None:
        """Run a handler of the agent, then carry out what it has asked for, even if it fails."""
        told = self._told
        told.now_ns = self._clock.reading(self.state.now_ns)
        try:
            self._call(handler.__name__, handler, *arguments)
        finally:
            if told.effects:
                self._carry_out()

    def _call(self, name: str, method: Callable[..., Any], *arguments: Any) -> Any:
        """What a method of the agent returns; what it raises becomes a sentence with the lines of the user's code.

        Errors of a coupled world name the world, which is no agent of the user's.
        """
        try:
            return method(*arguments)
        except (Exception, SystemExit) as error:
            if self.state.name == WORLD and isinstance(error, VoleryError):
                raise RunFailed(str(error)) from error
            raise RunFailed(f"agent {self.state.name} failed in {name}: {described(error)}") from error

    def _told_by_world(self, ask: Callable[..., Any], *arguments: Any) -> Any:
        """What the world measures; an error in a user's world names the agent, too."""
        try:
            return ask(*arguments)
        except BadInput as error:
            raise RunFailed(f"agent {self.state.name}: {error}") from error

    def _carry_out(self) -> None:
        effects, self._told.effects = self._told.effects, []
        journal, now_ns = self.state.journal, self.state.now_ns
        for effect in effects:
            if isinstance(effect, Send):
                self.sender.offer(*effect)
            elif isinstance(effect, Report):
                journal.estimates.append(Estimate(now_ns, *effect))
            elif isinstance(effect, Timer):
                self._timer_count += 1
                self._arm_timer(self._timer_count, effect)
            elif isinstance(effect, Command):
                self.sender.offer((WORLD,), pack_commands(effect.commands), "")
            elif isinstance(effect, Apply):
                journal.commands.append(Commanded(now_ns, *effect))
            elif isinstance(effect, Note):
                journal.events.append({"event": NOTED, "what": effect.what, "time_ns": now_ns, **effect.facts})
            else:
                self.sender.refuse(effect.targets)

    def _admit(self, event: Event, act: Callable[[Event], None]) -> None:
        """Let the agent handle an event; during a pause it waits."""
        state = self.state
        if state.dead:
            return
        if self._waiting is not None:
            state.now_ns = max(state.now_ns, event[TIME])
            self._waiting.append((event, self._clock.reading(event[TIME]), act))
            return
        state.advance(event)
        self._told.event_ns = self._clock.reading(event[TIME])
        act(event)

    # -- samples, timers and frames -----------------------------------------------------------------------------

    def _schedule_sample(self, sensor: str, times: SampleTimes, index: int) -> None:
        if (time_ns := sample_ns(times, index)) is not None:
            source = f"{self.state.name}.{sensor}"
            self.state.schedule(time_ns, SENSE, source, index, self._on_sense, (sensor, times, index))

    def _on_sense(self, event: Event) -> None:
        if self.state.dead:
            return
        sensor, times, index = event[DATA]
        self._schedule_sample(sensor, times, index + 1)
        self._admit(event, self._sense)

    def _sense(self, event: Event) -> None:
        sensor, _, index = event[DATA]
        value = self._told_by_world(measured, self.plan, self.faults.values(), self.state.name, sensor, index)
        self._take_sample(Sample(sensor, index, event[TIME], value), self._told.event_ns)

    def _take_sample(self, sample: Sample, reading_ns: int) -> None:
        """Journal a sample in nominal time, and hand it to the agent with the reading of its own clock."""
        self.state.journal.samples.append(Taken.of(sample))
        self.run_handler(self.agent.on_sample, replace(sample, time_ns=reading_ns))

    def _arm_timer(self, count: int, timer: Timer) -> None:
        """Schedule a timer by the agent's own clock; one that is over rings at once."""
        time_ns = self._clock.when(timer.time_ns, self.state.now_ns)
        self._timers[count] = time_ns, timer
        self.state.schedule(time_ns, TIMER, self.state.name, count, self._on_timer, count)

    def _on_timer(self, event: Event) -> None:
        time_ns, timer = self._timers.get(event[DATA], (-1, None))
        if time_ns == event[TIME]:
            del self._timers[event[DATA]]
            self._admit((*event[:DATA], timer), self._ring)

    def _ring(self, event: Event) -> None:
        timer: Timer = event[DATA]
        now_ns, rung = self._rung
        rung = rung + 1 if now_ns == self.state.now_ns else 1
        self._rung = self.state.now_ns, rung
        if rung > _MOST_RINGS:
            remedy = "so that time does not pass: set timers later than context.now_ns"
            raise RunFailed(
                f"agent {self.state.name}: {_MOST_RINGS:,} timers have rung at {self.state.now_ns} ns, {remedy}"
            )
        self._told.event_ns = timer.time_ns
        self.run_handler(self.agent.on_timer, timer)

    def _on_delivery(self, event: Event) -> None:
        self._admit(event, self._take_samples if event[SOURCE] == WORLD else self._take_frame)

    def _take_frame(self, event: Event) -> None:
        """Hand a frame to the agent, stamped by the agent's own clock."""
        source, frame = event[SOURCE], event[DATA]
        if self.plan.keeps_payloads:
            self.state.journal.payloads.append(Payload(event[TIME], source, frame.payload.hex()))
        received = Received(source, frame.payload, self._told.event_ns, self._measured(event[TIME], source, frame))
        self._told.may_act = not self._timers_only
        self.run_handler(self.agent.on_frame, received)
        self._told.may_act = True

    def _measured(self, time_ns: int, source: str, frame: Frame) -> NDArray[np.float64] | None:
        """Journal what is measured from a delivered frame: a function of the plan and of the frame's header."""
        if (world := self._measuring) is None:
            return None
        name = frame.incarnation, frame.sequence, frame.copy
        value: NDArray[np.float64] | None = self._told_by_world(
            world.measure_frame, source, self.state.name, frame.start_ns, *name
        )
        flat = None if value is None else value.tolist()
        self.state.journal.measured.append(Measured(time_ns, source, *name, flat))
        return value

    def _take_samples(self, event: Event) -> None:
        """Hand samples that a coupled world has taken to the agent."""
        for sample in unpack_samples(event[DATA].payload):
            self._take_sample(sample, self._clock.reading(sample.time_ns))

    def _put(self, outlet: str, message: Message) -> None:
        self.receiver.note_transmission()
        self._put_on_wire(outlet, message)

    def transmit_ahead(self, before_ns: int) -> None:
        """Put frames on the wire early whose start lies before an instant, as far as nothing changes until then."""
        if not self.state.dead:
            changes = (instant for instant in self._changes_ns if instant >= self.state.now_ns)
            self.sender.transmit_ahead(min([before_ns, *changes]))

    # -- faults and the graph -----------------------------------------------------------------------------------

    def arm(self, fault: Fault) -> None:
        """Note a fault, or a new start or end of a known one, and schedule it if it touches this node."""
        self.known[fault.id] = fault
        start_ns, schedule = self.state.start_ns, self.state.schedule
        if not self._touches(fault) or (isinstance(fault, Kill) and fault.at_ns < start_ns):
            return
        known = self.faults.get(fault.id)
        self.faults[fault.id] = fault
        self._changes_ns |= {fault.at_ns, FOREVER_NS if fault.until_ns is None else fault.until_ns}
        if known is None or known.at_ns != fault.at_ns:
            schedule(max(fault.at_ns, start_ns), FAULT, fault.id, 0, self._on_fault, fault.id)
        if fault.until_ns is not None and (known is None or known.until_ns != fault.until_ns):
            schedule(max(fault.until_ns, start_ns), FAULT, fault.id, 1, self._on_fault, fault.id)

    def _touches(self, fault: Fault) -> bool:
        """Whether a fault concerns this node: a link's settings act at its source, `hold` at its target."""
        name = self.state.name
        if isinstance(fault, SensorFault) and self.plan.world_agents:
            return name == WORLD
        if not isinstance(fault, LinkFault):
            return fault.agent == name
        ends = {source for source, _ in fault.links}
        if "hold" in fault.changes:
            ends |= {target for _, target in fault.links}
        return name in ends

    def _on_fault(self, event: Event) -> None:
        if self.state.dead:
            return
        fault = self.faults[event[DATA]]
        self.state.advance(event)
        if isinstance(fault, LinkFault):
            self._change_links(fault)
        elif isinstance(fault, Pause):
            self._pause_or_resume()
        elif isinstance(fault, ClockFault):
            self._set_clock()
        elif isinstance(fault, Hog):
            hogs = (other for other in self.faults.values() if isinstance(other, Hog))
            self.hogged = max((hog.share for hog in hogs if hog.in_force(self.state.now_ns)), default=0.0)
        elif isinstance(fault, Kill) and event[TIME] == fault.at_ns:
            self._die(fault)

    def _settings(self, target: str) -> LinkSettings:
        """Settings of the link to a neighbour now: its own, changed by the faults in force and by the graph."""
        settings = self._effective((self.state.name, target))
        return settings if target in self.present or target in self.state.wired else replace(settings, present=False)

    def _effective(self, link: tuple[str, str]) -> LinkSettings:
        faults = [fault for fault in self.faults.values() if isinstance(fault, LinkFault)]
        return effective(self.plan.settings(link), link, faults, self.state.now_ns)

    def _change_links(self, fault: LinkFault) -> None:
        for source, target in fault.links:
            if source == self.state.name:
                self.sender.change(target, self._settings(target))
            elif target == self.state.name and "hold" in fault.changes:
                self._update_hold(source)

    def _update_hold(self, source: str) -> None:
        self.receiver.set_hold(source, hold=self._effective((source, self.state.name)).hold)

    def _on_graph(self, event: Event) -> None:
        """Neighbours come and go."""
        if self.state.dead:
            return
        self.state.advance(event)
        name, time_ns = self.state.name, event[TIME]
        self.present = self._told.neighbours = self.plan.present(name, time_ns)
        self._told.degrees = self.plan.degrees(name, time_ns)
        for target in self.state.neighbours:
            self.sender.change(target, self._settings(target))
        self._admit(event, lambda _event: self.run_handler(self.agent.on_neighbours))

    def _set_clock(self) -> None:
        """Let the clock show another reading from now on, and arm pending timers anew."""
        self._read_clock()
        self.sender.set_clock(self._clock)
        for count, (_, timer) in list(self._timers.items()):
            self._arm_timer(count, timer)

    def _read_clock(self) -> None:
        faults = [fault for fault in self.faults.values() if isinstance(fault, ClockFault)]
        now_ns = self.state.now_ns
        self._clock = Clock(fault for fault in faults if fault.in_force(now_ns))
        self._told.clock_jumped = any(fault.at_ns <= now_ns for fault in faults)

    def _die(self, kill: Kill) -> None:
        self.finish()
        events = self.state.journal.events
        if kill.keep_state:
            self.saved = self._call("save", self._packed_state)
            events.append({"event": "state", "state": self.saved.hex()})
        events.append({"event": "killed", "time_ns": self.state.now_ns})
        self.state.dead = True

    def _packed_state(self) -> bytes:
        packed: bytes = msgpack.packb(plain(self.agent.save(), "the returned value", "state", binary=True))
        return packed

    def _pause_or_resume(self) -> None:
        """Pause as long as any pause is in force; then handle what came meanwhile, in order."""
        pauses = (fault for fault in self.faults.values() if isinstance(fault, Pause))
        if any(fault.in_force(self.state.now_ns) for fault in pauses):
            self._waiting = self._waiting or []
        elif self._waiting is not None:
            waiting, self._waiting = self._waiting, None
            for event, reading_ns, act in sorted(waiting, key=itemgetter(0)):
                self._told.event_ns = reading_ns
                act(event)

    # -- the end, and what can be promised ----------------------------------------------------------------------

    def finish(self) -> None:
        """Journal which frames still wait for their transmitter, and which are held back."""
        self.sender.finish()
        self.receiver.finish()

    def take_journal(self) -> Batch:
        """The entries since the last call."""
        state = self.state
        batch, state.journal = state.journal, Batch(state.name, state.incarnation)
        return batch

    def triggers(self) -> tuple[str, ...]:
        """Neighbours whose frames may make the agent act: all, or the world alone if it acts on samples and timers."""
        if not self._timers_only or self._waiting is not None:
            return self.state.neighbours
        return tuple(name for name in self.state.wired if name == WORLD)

    def acts_ns(self, arrivals_ns: int) -> int:
        """The earliest instant at which the agent may act; `arrivals_ns` as for `promises`."""
        triggers = self.triggers()
        return min([arrivals_ns, *(event[TIME] for event in self.state.heap if matters(event, triggers))])

    def settled_ns(self, arrivals_ns: int) -> int:
        """Before this instant nothing that is yet to come changes what the agent transmits, and when.

        What it does takes `compute` to be offered; a fault has its effect at once.
        """
        faults = (event[TIME] for event in self.state.heap if event[RANK] == FAULT)
        return min([self.acts_ns(arrivals_ns) + self.state.compute_ns, *faults])

    def promises(self, arrivals_ns: int) -> dict[str, int]:
        """For each outlet the earliest instant at which its next transmission can start; FOREVER_NS if none can.

        An agent that is paused may be resumed at any instant that nobody has passed.

        Args:
            arrivals_ns: no frame of `triggers` that is yet unheard is due before this.
        """
        outlets = self.sender.outlets
        if self.state.dead:
            return dict.fromkeys(outlets, OVER_NS)
        acts = self.acts_ns(arrivals_ns)
        starts, changes = (dict.fromkeys(outlets, FOREVER_NS) for _ in range(2))
        for event in self.state.sending:
            if not (event[RANK] == TRANSMIT and self.sender.contends(event[SOURCE])):
                starts[event[SOURCE]] = min(event[TIME], starts[event[SOURCE]])
        for event in self.state.heap:
            if event[RANK] == FAULT:
                for name in self._changes_access(event):
                    changes[name] = min(event[TIME], changes[name])
        ready = {name: min(acts + self.state.compute_ns, start) for name, start in starts.items()}
        return {name: min(start, changes[name]) for name, start in self.sender.earliest_starts(ready).items()}

    def _changes_access(self, event: Event) -> Iterable[str]:
        """Outlets whose frames may start at other instants once a fault begins or ends."""
        fault = self.faults.get(event[DATA]) if event[HANDLER] == self._on_fault else None
        if isinstance(fault, ClockFault):
            return self.sender.outlets
        if not isinstance(fault, LinkFault) or not _ACCESS_FIELDS & fault.changes.keys():
            return ()
        return {self.sender.outlet_of[target] for source, target in fault.links if source == self.state.name}


def matters(event: Event, triggers: Collection[str]) -> bool:
    """Whether an event can make an agent act that frames of `triggers` make act: others than frames always can."""
    return not isinstance(event[DATA], Frame) or event[SOURCE] in triggers
