"""A coupled world as an agent: it takes samples and commands, and reports the truth.

It is joined to every agent by wires that nothing impairs. A sample that is taken at an instant arrives the sense delay
later, a command takes effect the act delay after it was given.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from ..transport.faults import Fault
from ..transport.latency_settings import Constant
from ..transport.links import LinkSettings
from ..units import SampleTimes, sample_ns
from .agent import Agent, Apply, Context, ContextState, Note, Received, Sample, Send, Timer
from .plan import WORLD, AgentPlan, Plan, Running
from .sensor_samples import Disturbances
from .wires import pack_samples, unpack_commands

KIND = "coupled-world"
_STEP = "step"
_WIDEST = 2**31


def couple(plan: Plan) -> Plan:
    """The plan with its coupled world as an agent of its own, and the wires to it.

    Raises:
        BadInput: an agent has the name that the world is to have.
    """
    world = plan.coupled
    assert world is not None
    names = tuple(agent.name for agent in plan.agents)
    if WORLD in names:
        raise BadInput(f"an agent is called {WORLD}, as what the agents act upon is: call it something else")
    sense, act = _wire(world.sense_delay_ns), _wire(world.act_delay_ns)
    wires = {(WORLD, name): sense for name in names} | {(name, WORLD): act for name in names}
    world_agent = AgentPlan(WORLD, KIND, None, (), {WORLD: 0}, compute_ns=0, wired=names)
    agents = tuple(replace(agent, wired=(WORLD,)) for agent in plan.agents)
    return replace(plan, agents=agents, world_agents=(world_agent,), wires=wires)


def _wire(delay_ns: int) -> LinkSettings:
    return LinkSettings(mtu=_WIDEST, latency=Constant(delay_ns))


class WorldContext(Context):
    """What a coupled world may do and know besides: the plan, the sensor faults, and the wires to the agents."""

    __slots__ = ("_faults", "plan")

    def __init__(self, state: ContextState, plan: Plan, faults: Mapping[str, Fault]) -> None:
        super().__init__(state)
        self.plan = plan
        self._faults = faults

    @property
    def faults(self) -> Iterable[Fault]:
        """The faults that touch the world, live ones included."""
        return self._faults.values()

    def note(self, what: str, **facts: Any) -> None:
        """Journal an event of the world, which has an instant of its own."""
        self._state.effects.append(Note(what, facts))

    def apply(self, agent: str, command: str, value: NDArray[np.float64]) -> None:
        """Journal that a command of an agent takes effect."""
        self._state.effects.append(Apply(agent, command, value.tolist()))

    def wire(self, agent: str, payload: bytes) -> None:
        """Hand a payload to the wire to an agent."""
        self._state.effects.append(Send((agent,), payload, ""))


class CoupledWorld(Agent):
    """Advances the world of its plan to each instant at which an agent senses or acts, or the truth is due.

    It reports every true quantity under its own name at the world's `truth_rate`.
    """

    timers_only = True

    def __init__(self, context: WorldContext, parameters: Any) -> None:
        super().__init__(context, parameters)
        self._wires = context
        plan, world = context.plan, context.plan.coupled
        assert world is not None
        self._running: Running = world.begin()
        self._disturbances = Disturbances(plan.seed)
        self._truth_rate = world.truth_rate
        self._sensors = {agent.name: world.sensors(agent.name) for agent in plan.agents}
        self._next: dict[SampleTimes, int] = dict.fromkeys(
            {times for mine in self._sensors.values() for times in mine.values()}, 0
        )
        self._next_truth = 0

    def start(self) -> None:
        """Take the first samples at once."""
        self._wait()

    def _wait(self) -> None:
        due = (sample_ns(times, index) for times, index in (*self._next.items(), self._truth_due()))
        self.context.set_timer(min(time_ns for time_ns in due if time_ns is not None), _STEP)

    def _truth_due(self) -> tuple[float, int]:
        return self._truth_rate, self._next_truth

    def on_timer(self, timer: Timer) -> None:
        """Take the samples of this instant, then report the truth if that is due."""
        now_ns = timer.time_ns
        self._running.advance(now_ns)
        due = {times: index for times, index in self._next.items() if sample_ns(times, index) == now_ns}
        if due:
            self._sense(due, now_ns)
            self._next.update((times, index + 1) for times, index in due.items())
        if sample_ns(*self._truth_due()) == now_ns:
            self._write_down(now_ns)
            self._next_truth += 1
        self._wait()

    def _sense(self, due: Mapping[SampleTimes, int], now_ns: int) -> None:
        for agent, sensors in self._sensors.items():
            samples = [
                Sample(sensor, due[times], now_ns, self._measured(agent, sensor, due[times], now_ns))
                for sensor, times in sensors.items()
                if times in due
            ]
            if samples:
                self._wires.wire(agent, pack_samples(samples))

    def _measured(self, agent: str, sensor: str, index: int, now_ns: int) -> NDArray[np.float64] | None:
        value = self._running.measure(agent, sensor, index)
        return self._disturbances.disturbed(self._wires.faults, agent, sensor, index, now_ns, value)

    def _write_down(self, now_ns: int) -> None:
        for quantity, value in self._running.truth().items():
            self.context.report(quantity, value, self._next_truth)
        self._note_events()

    def _note_events(self) -> None:
        for event in self._running.events():
            facts = dict(event)
            self.context.note(facts.pop("event"), **facts)

    def on_frame(self, frame: Received) -> None:
        """Let commands take effect."""
        self._running.advance(self.context.now_ns)
        for command, value in unpack_commands(frame.payload).items():
            self._running.act(frame.source, command, value)
            self._wires.apply(frame.source, command, value)
