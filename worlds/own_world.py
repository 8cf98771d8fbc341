"""A user's world in a plan: by the name of its class, with its parameters; what its methods return is checked."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from numbers import Integral, Real
from typing import Any, ClassVar

import numpy as np

from ..errors import BadInput
from ..kinds import OwnKind
from ..quantities import Floats, Quantity, check_quantities
from ..randomness import stream
from ..topologies import Position, natural_key
from ..units import SampleTimes, sample_ns
from .checked_calls import CheckedCalls, called, numbers, shown
from .world import RunningWorld, Surroundings, World
from .world_kinds import WORLDS

_SENSOR = re.compile(r"\w[\w-]*")
_ASKED_TWICE = 3
"""So many samples of each sensor are asked for in two orders."""


@dataclass(frozen=True)
class OwnWorldSettings(OwnKind):
    """What a scenario says of a user's world."""

    needs_places: ClassVar[bool] = False

    def build(self, positions: Mapping[str, Position], seed: int, agents: Sequence[str]) -> OwnWorld | OwnCoupledWorld:
        """The world; without `agents` it says itself who they are.

        Raises:
            BadInput: its own class refuses it, there are no agents, or what it says of itself makes no sense.
        """
        made = self.kind, self.parameters, tuple(agents), dict(positions), seed
        world = OwnCoupledWorld(*made) if WORLDS.find(self.kind).begin is not World.begin else OwnWorld(*made)
        if not agents:
            return self.build(positions, seed, world.told_agents())
        world.check()
        return world


@dataclass(frozen=True)
class _OwnWorld:
    """A user's world: its class by name, and what an object of it is made from; the object is made when it is asked."""

    kind: str
    parameters: Any
    agents: tuple[str, ...]
    positions: Mapping[str, Position]
    seed: int

    @cached_property
    def _calls(self) -> CheckedCalls:
        return CheckedCalls(f"world {self.kind}")

    @cached_property
    def _world(self) -> World:
        made: World = WORLDS.find(self.kind)(Surroundings(self.agents, self.positions, self.seed), self.parameters)
        return made

    @cached_property
    def _sensors(self) -> dict[str, Mapping[str, SampleTimes]]:
        return {}

    @property
    def quantities(self) -> Sequence[Quantity]:
        """What agents estimate, as the world declares it."""
        return self._world.quantities

    @property
    def model(self) -> Any:
        """What agents know of the world before the start."""
        return self._world.model

    def told_agents(self) -> tuple[str, ...]:
        """The agents that a world names which was made without any, in natural order.

        Raises:
            BadInput: it names none.
        """
        if not self._world.agents:
            self._calls.refuse("agents", "are none, and this topology asks the world for them: set them in __init__")
        return tuple(sorted(self._world.agents, key=natural_key))

    def check(self) -> None:
        """Check the quantities, and the sensors of all agents.

        Raises:
            BadInput: they make no sense.
        """
        quantities = self._world.quantities
        try:
            check_quantities(quantities)
        except BadInput as error:
            raise BadInput(f"world {self.kind}: {error}") from error
        for agent in self.agents:
            self.sensors(agent)

    def sensors(self, agent: str) -> Mapping[str, SampleTimes]:
        """Sensor name → when it samples, for one agent.

        Raises:
            BadInput: names, rates or instants that are none.
        """
        if agent not in self._sensors:
            found = self._calls.ask(self._world, "sensors", agent)
            try:
                self._sensors[agent] = _sensors(found)
            except BadInput as error:
                self._calls.refuse(called("sensors", agent), f"returned {shown(found)}: {error}")
        return self._sensors[agent]


class OwnWorld(_OwnWorld):
    """A user's world that is a function of time."""

    @property
    def moves(self) -> bool:
        """Whether agents move in it."""
        return type(self._world).position is not World.position

    @property
    def measures_frames(self) -> bool:
        """Whether agents measure something from the frames that they receive."""
        return type(self._world).measure_frame is not World.measure_frame

    def check(self) -> None:
        """Check quantities and sensors, and where agents are at the start.

        Raises:
            BadInput: one of them makes no sense.
        """
        super().check()
        for agent in self.agents if self.moves else ():
            self.position(agent, 0)

    def measure(self, agent: str, sensor: str, index: int) -> Floats | None:
        """A sensor's index-th sample, (k,) or (n, k); None where it sees nothing, or where there are not so many.

        Raises:
            BadInput: what the class returned is no sample.
        """
        time_ns = sample_ns(self.sensors(agent)[sensor], index)
        if time_ns is None:
            return None
        return self._calls.vector(self._world, "measure", agent, sensor, index, time_ns, may_have_rows=True)

    def measure_frame(
        self, source: str, target: str, time_ns: int, incarnation: int, sequence: int, copy: int
    ) -> Floats | None:
        """What `target` measures from a frame whose transmission started at an instant, (k,); None if nothing.

        Raises:
            BadInput: what the class returned is no vector.
        """
        noise = stream(self.seed, "frame-sensor", source, target, f"{incarnation}.{sequence}.{copy}")
        return self._calls.vector(self._world, "measure_frame", source, target, time_ns, noise)

    def truth(self, agent: str, quantity: str, time_ns: int) -> Floats | None:
        """What is true of what an agent reports, at an instant, (k,); None if the world does not know.

        Raises:
            BadInput: what the class returned is no vector.
        """
        return self._calls.vector(self._world, "truth", agent, quantity, time_ns)

    def position(self, agent: str, time_ns: int) -> Floats:
        """Where an agent is at an instant, (2,) or (3,) [m].

        Raises:
            BadInput: what the class returned is no place.
        """
        place = self._calls.vector(self._world, "position", agent, time_ns)
        if place is None or len(place) not in (2, 3):
            call, width = called("position", agent, time_ns), 0 if place is None else len(place)
            self._calls.refuse(call, f"returned {width} numbers: return x and y, or x, y and z, in metres")
        return place

    def impurities(self) -> Iterator[str]:
        """A sentence where a sample is another one once it is asked for in another order."""
        again = OwnWorld(self.kind, self.parameters, self.agents, self.positions, self.seed)
        asked = [
            (agent, sensor, index)
            for agent in self.agents
            for sensor in self.sensors(agent)
            for index in range(_ASKED_TWICE)
        ]
        first = {each: self.measure(*each) for each in asked}
        second = {each: again.measure(*each) for each in reversed(asked)}
        for each in asked:
            if not _same(first[each], second[each]):
                yield (
                    f"world {self.kind}: {called('measure', *each)} returns {shown(first[each])}, and another time "
                    f"{shown(second[each])}: let it follow from seed and arguments, draw from self.random by index"
                )
                return


class OwnCoupledWorld(_OwnWorld):
    """A user's world that agents act upon."""

    @property
    def sense_delay_ns(self) -> int:
        """Delay from the taking of a sample to its arrival."""
        return self._world.sense_delay_ns

    @property
    def act_delay_ns(self) -> int:
        """Delay from a command to its effect."""
        return self._world.act_delay_ns

    @property
    def truth_rate(self) -> float:
        """Rate at which the truth is reported [Hz]."""
        return float(self._world.truth_rate)

    def check(self) -> None:
        """Check sensors, delays and rate, and that it can begin.

        Raises:
            BadInput: one of them makes no sense, or it measures frames.
        """
        super().check()
        if type(self._world).measure_frame is not World.measure_frame:
            why = "cannot be: what agents act upon has no past to measure a frame in; give them a sensor instead"
            self._calls.refuse("measure_frame", why)
        for name in ("sense_delay_ns", "act_delay_ns"):
            delay = getattr(self._world, name)
            if not isinstance(delay, Integral) or delay < 1:
                self._calls.refuse(name, f"is {shown(delay)}: it must be whole nanoseconds, at least 1")
        if not _is_rate(self._world.truth_rate):
            self._calls.refuse("truth_rate", f"is {shown(self._world.truth_rate)}: it must be a rate in Hz above 0")
        self.begin().truth()

    def begin(self) -> OwnRunningWorld:
        """The world at instant 0.

        Raises:
            BadInput: the class gives no running world.
        """
        running = self._calls.ask(self._world, "begin")
        if not isinstance(running, RunningWorld):
            self._calls.refuse("begin()", f"returned {shown(running)}: return an object of a subclass of RunningWorld")
        return OwnRunningWorld(self._calls, running)


class OwnRunningWorld:
    """A user's world as it runs."""

    def __init__(self, calls: CheckedCalls, running: RunningWorld) -> None:
        self._calls, self._running = calls, running

    def advance(self, time_ns: int) -> None:
        """Advance to an instant."""
        self._calls.ask(self._running, "advance", time_ns)

    def act(self, agent: str, command: str, value: Floats) -> None:
        """Let an agent's command take effect."""
        self._calls.ask(self._running, "act", agent, command, value)

    def measure(self, agent: str, sensor: str, index: int) -> Floats | None:
        """A sensor's index-th sample, taken now.

        Raises:
            BadInput: what the class returned is no sample.
        """
        return self._calls.vector(self._running, "measure", agent, sensor, index, may_have_rows=True)

    def truth(self) -> Mapping[str, Floats]:
        """Quantity → its true value now, flat.

        Raises:
            BadInput: what the class returned is no mapping of names to numbers.
        """
        found = self._calls.ask(self._running, "truth")
        if not isinstance(found, Mapping):
            self._calls.refuse("truth()", f"returned {shown(found)}: return a mapping, quantity → value")
        values = {}
        for name, value in found.items():
            try:
                values[name] = None if value is None else numbers(value, may_have_rows=True)
            except BadInput as error:
                self._calls.refuse("truth()", f"has for {name!r} {error}")
        return {name: value.ravel() for name, value in values.items() if value is not None}

    def events(self) -> list[dict[str, Any]]:
        """Events since the last call.

        Raises:
            BadInput: what the class returned is no list of events.
        """
        events = self._calls.ask(self._running, "events")
        for event in events:
            if not isinstance(event, Mapping) or "event" not in event:
                self._calls.refuse("events()", f'returned {shown(event)}: each is {{"event": …, "time_ns": …, …}}')
        return [dict(event) for event in events]


def _sensors(found: Any) -> Mapping[str, SampleTimes]:
    if not isinstance(found, Mapping):
        raise BadInput("return a mapping, name → rate in Hz or instants in ns")
    for name in found:
        if not isinstance(name, str) or not _SENSOR.fullmatch(name):
            raise BadInput(f"{shown(name)} cannot name a sensor: use letters, digits, '_' and '-'")
    return {name: _times(times) for name, times in found.items()}


def _times(times: Any) -> SampleTimes:
    if isinstance(times, str) or not isinstance(times, Sequence | np.ndarray):
        if not _is_rate(times):
            raise BadInput(f"{shown(times)} is neither a rate in Hz, above 0, nor instants in ns")
        return float(times)
    for instant in times:
        if not isinstance(instant, Integral) or isinstance(instant, bool):
            raise BadInput(f"{shown(instant)} is no instant: instants are whole nanoseconds")
    instants = tuple(map(int, times))
    for before, after in pairwise((-1, *instants)):
        if after <= before:
            raise BadInput(f"instants must ascend from 0 ns on, and {after} ns comes after {before} ns")
    return instants


def _is_rate(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and 0.0 < float(value) < math.inf


def _same(one: Floats | None, other: Floats | None) -> bool:
    if one is None or other is None:
        return one is other
    return one.shape == other.shape and one.tobytes() == other.tobytes()
