"""Agents that move, and a sensor of the own position; positions are pure functions of seed and time."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...randomness import Stream, stream
from ...topologies import Position
from ...units import check_above_zero, period_ns

SENSOR = "position"
_CACHED_AGENTS = 4096
_SECOND_NS = 1e9


class Motion(Protocol):
    """Motion of agents."""

    @property
    def agents(self) -> tuple[str, ...]:
        """The moving agents, in natural order."""

    def place(self, agent: str, time_ns: int, seed: int) -> NDArray[np.float64]:
        """Position of one agent at an instant, shape (2,) or (3,) [m]."""


@dataclass(frozen=True)
class RandomWaypoint:
    """Random waypoints: straight to a random place at a random speed, a pause, and again (Johnson and Maltz 1996).

    Places are uniform in the box from 0 to `area` [m], speeds uniform from `slowest` to `fastest` [m/s], and each agent
    waits for `pause_ns` at every place but the first. With slowest = 0 the mean speed would go to 0 with time, so that
    is refused (Yoon, Liu and Noble 2003). At time 0 the places are uniform; later the middle is fuller than the rim.

    Raises:
        BadInput: no agents, a side of the area or a speed that is not above 0, speeds that descend, a pause below 0.
    """

    agents: tuple[str, ...]
    area: Position
    slowest: float
    fastest: float
    pause_ns: int = 0

    def __post_init__(self) -> None:
        """Check the bounds."""
        _some(self.agents)
        if len(self.area) not in {2, 3} or not all(0 < side < math.inf for side in self.area):
            raise BadInput(f"area is {list(self.area)} m: give 2 or 3 lengths above 0")
        if not 0 < self.slowest <= self.fastest < math.inf:
            raise BadInput(f"speed is {self.slowest:g} to {self.fastest:g} m/s: it must be above 0 and not descend")
        if self.pause_ns < 0:
            raise BadInput(f"pause is {self.pause_ns} ns, it must be at least 0")

    def place(self, agent: str, time_ns: int, seed: int) -> NDArray[np.float64]:
        """Position between two waypoints, or at one."""
        return _way(self, seed, agent).place(time_ns)


class _Way:
    """Waypoints of one agent, drawn on demand; a draw depends on its index alone."""

    def __init__(self, motion: RandomWaypoint, seed: int, agent: str) -> None:
        self._motion = motion
        self._draws = stream(seed, "random waypoint", agent)
        self._speeds = stream(seed, "random waypoint speed", agent)
        self._points = [self._point(0)]
        self._leaves_ns = [0]
        self._arrives_ns: list[int] = []

    def _point(self, index: int) -> NDArray[np.float64]:
        size = len(self._motion.area)
        draws = (self._draws.uniform(size * index + axis) for axis in range(size))
        return np.array([side * draw for side, draw in zip(self._motion.area, draws, strict=True)])

    def _extend(self) -> None:
        leg = len(self._arrives_ns)
        motion, here, there = self._motion, self._points[leg], self._point(leg + 1)
        speed = motion.slowest + (motion.fastest - motion.slowest) * self._speeds.uniform(leg)
        arrives_ns = self._leaves_ns[leg] + max(1, round(float(np.linalg.norm(there - here)) / speed * _SECOND_NS))
        self._points.append(there)
        self._arrives_ns.append(arrives_ns)
        self._leaves_ns.append(arrives_ns + motion.pause_ns)

    def place(self, time_ns: int) -> NDArray[np.float64]:
        """Where it is at an instant."""
        while self._leaves_ns[-1] <= time_ns:
            self._extend()
        leg = bisect_right(self._leaves_ns, time_ns) - 1
        leaves_ns, arrives_ns = self._leaves_ns[leg], self._arrives_ns[leg]
        share = min(1.0, (time_ns - leaves_ns) / (arrives_ns - leaves_ns))
        here, there = self._points[leg], self._points[leg + 1]
        return np.asarray(here + share * (there - here))


@lru_cache(maxsize=_CACHED_AGENTS)
def _way(motion: RandomWaypoint, seed: int, agent: str) -> _Way:
    """Waypoints of one agent, cached; without effect on their values."""
    return _Way(motion, seed, agent)


@dataclass(frozen=True)
class Paths:
    """Given places at given instants, linear interpolation in between; agents stay at their last place.

    `points`: agent → ((instant [ns], place [m]), …), instants ascending from 0.

    Raises:
        BadInput: no agents, no points, instants that do not ascend from 0, or places of different dimension.
    """

    points: Mapping[str, tuple[tuple[int, Position], ...]]

    def __post_init__(self) -> None:
        """Check times and sizes."""
        _some(self.agents)
        for agent, points in self.points.items():
            times = [time_ns for time_ns, _ in points]
            if times[:1] != [0] or any(after <= before for before, after in pairwise(times)):
                raise BadInput(f"the path of agent {agent} has the times {times} ns: they must ascend from 0")
        sizes = {len(place) for points in self.points.values() for _, place in points}
        if len(sizes) > 1 or not sizes <= {2, 3}:
            raise BadInput(f"places have {' and '.join(map(str, sorted(sizes)))} coordinates: give all 2, or all 3")

    @property
    def agents(self) -> tuple[str, ...]:
        """Agents that have a path."""
        return tuple(self.points)

    def place(self, agent: str, time_ns: int, seed: int) -> NDArray[np.float64]:
        """Position on the line between two points."""
        points = self.points[agent]
        leg = bisect_right(points, time_ns, key=lambda point: point[0]) - 1
        (start_ns, here), (end_ns, there) = points[leg], points[min(leg + 1, len(points) - 1)]
        share = (time_ns - start_ns) / (end_ns - start_ns) if end_ns > start_ns else 0.0
        ends = np.array([here, there])
        return np.asarray(ends[0] + share * (ends[1] - ends[0]))


@dataclass(frozen=True)
class Circle:
    """Agents evenly spaced on a circle about `centre` that turns once in |`period_ns`|.

    Anticlockwise, or clockwise with a period below 0; the first starts on the x axis.

    Raises:
        BadInput: no agents, a radius not above 0, a period of 0.
    """

    agents: tuple[str, ...]
    radius: float
    period_ns: int
    centre: Position = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the bounds."""
        _some(self.agents)
        check_above_zero("radius", self.radius, "m")
        if self.period_ns == 0:
            raise BadInput("period is 0: give the time of one turn")
        if len(self.centre) != 2:
            raise BadInput(f"centre is {list(self.centre)}: give x and y")

    def place(self, agent: str, time_ns: int, seed: int) -> NDArray[np.float64]:
        """Position at its own angle plus that by which the circle has turned."""
        turn = self.agents.index(agent) / len(self.agents) + (time_ns % self.period_ns) / self.period_ns
        angle = 2 * math.pi * turn
        return np.array(self.centre) + self.radius * np.array([math.cos(angle), math.sin(angle)])


def _some(agents: tuple[str, ...]) -> None:
    if not agents:
        raise BadInput("nobody moves: say how many agents there are, by count or by the topology")


@dataclass(frozen=True)
class MovingWorld:
    """A world in which agents move; those with a `rate` [Hz] sense their own position with normal noise [m].

    Raises:
        BadInput: a rate that is not above 0, or noise below 0.
    """

    moves: ClassVar[bool] = True

    motion: Motion
    seed: int
    rate: float | None = None
    noise: float = 0.0

    def __post_init__(self) -> None:
        """Check the sensor."""
        if self.rate is not None:
            check_above_zero("position.rate", self.rate, "Hz")
        if not 0 <= self.noise < math.inf:
            raise BadInput(f"position.noise is {self.noise:g} m, it must be at least 0")

    @property
    def agents(self) -> tuple[str, ...]:
        """The agents, in natural order."""
        return self.motion.agents

    def position(self, agent: str, time_ns: int) -> NDArray[np.float64]:
        """Position of an agent at an instant, shape (2,) or (3,) [m].

        Raises:
            BadInput: no such agent.
        """
        return self.motion.place(self._known(agent), time_ns, self.seed)

    def positions(self, time_ns: int) -> dict[str, NDArray[np.float64]]:
        """Agent → its position at an instant, shape (2,) or (3,) [m]."""
        return {agent: self.motion.place(agent, time_ns, self.seed) for agent in self.agents}

    def sensors(self, agent: str) -> Mapping[str, float]:
        """The sensor of an agent's own position and its rate [Hz], where there is one.

        Raises:
            BadInput: no such agent.
        """
        self._known(agent)
        return {} if self.rate is None else {SENSOR: self.rate}

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """The index-th sample of an agent's position, taken at floor(index · 10⁹ / rate), shape (2,) or (3,) [m].

        Raises:
            BadInput: an agent or a sensor that is not there.
        """
        if sensor not in self.sensors(agent) or self.rate is None:
            raise BadInput(f"agent {agent} has no sensor {sensor!r}: the world gives {SENSOR!r} where it is asked for")
        true = self.position(agent, period_ns(self.rate, index))
        draws = _noise(self.seed, agent)
        return true + self.noise * np.array([draws.normal(len(true) * index + axis) for axis in range(len(true))])

    def truth(self, time_ns: int) -> NDArray[np.float64]:
        """The places of all agents one after the other, shape (2 N,) or (3 N,) [m]."""
        return np.concatenate(list(self.positions(time_ns).values()))

    def _known(self, agent: str) -> str:
        if agent not in self.agents:
            raise BadInput(f"agent {agent!r} is not in the world that moves: it has {', '.join(self.agents)}")
        return agent


@lru_cache(maxsize=_CACHED_AGENTS)
def _noise(seed: int, agent: str) -> Stream:
    """Noise stream of one sensor; cached because it draws in blocks."""
    return stream(seed, "position noise", agent)
