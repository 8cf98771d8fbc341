"""Settings of agents that move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from ...errors import BadInput
from ...topologies import Position, natural_key
from ...units import BareMetres, Count, Hertz, Metres, MetresPerSecond, Nanoseconds
from .motions import Circle, Motion, MovingWorld, Paths, RandomWaypoint

Place = tuple[BareMetres, ...]


@dataclass(frozen=True)
class RandomWaypointSettings:
    """Random waypoints: straight to a random place at a random speed, a pause, and again.

    area: the sides of the box in which places are drawn, two or three.
    speed: of all legs, or the slowest and the fastest.
    pause: at every place except the first.
    count: of the agents, where the topology does not say it.
    """

    area: Place
    speed: MetresPerSecond | tuple[MetresPerSecond, MetresPerSecond]
    pause: Nanoseconds = 0
    count: Count | None = None

    def motion(self, agents: Sequence[str]) -> RandomWaypoint:
        """Of these agents."""
        slowest, fastest = self.speed if isinstance(self.speed, tuple) else (self.speed, self.speed)
        return RandomWaypoint(_names(self.count, agents), self.area, slowest, fastest, self.pause)


@dataclass(frozen=True)
class CircleSettings:
    """Agents evenly spaced on a circle that turns.

    radius: of the circle.
    period: of one turn anticlockwise; below 0 it turns clockwise.
    centre: of the circle.
    count: of the agents, where the topology does not say it.
    """

    radius: Metres
    period: Nanoseconds
    centre: Place = (0.0, 0.0)
    count: Count | None = None

    def motion(self, agents: Sequence[str]) -> Circle:
        """Of these agents."""
        return Circle(_names(self.count, agents), self.radius, self.period, self.centre)


@dataclass(frozen=True)
class PositionSensor:
    """Sensor of each agent's own position.

    rate: samples per second.
    noise: standard deviation on each axis.
    """

    rate: Hertz = 10.0
    noise: Metres = 0.0


@dataclass(frozen=True)
class MovingSettings:
    """Agents that move in one of three ways, optionally with a sensor of their position.

    random-waypoint: straight to random places, at random speeds.
    paths: agent → places at instants, as in {1: {0 s: [0 m, 0 m], 5 s: [10 m, 0 m]}}.
    circle: evenly spaced on a circle that turns.
    position: sensor of the own position, for all agents.
    """

    needs_places: ClassVar[bool] = False

    random_waypoint: RandomWaypointSettings | None = field(default=None, metadata={"name": "random-waypoint"})
    paths: Mapping[str, Mapping[Nanoseconds, Place]] | None = None
    circle: CircleSettings | None = None
    position: PositionSensor | None = None

    def __post_init__(self) -> None:
        """Check that there is one motion."""
        ways = {"random-waypoint": self.random_waypoint, "paths": self.paths, "circle": self.circle}
        given = [name for name, way in ways.items() if way is not None]
        if len(given) != 1:
            raise BadInput(f"{' and '.join(given) or 'nobody moves'}: write one of {', '.join(ways)}")

    def build(self, positions: Mapping[str, Position], seed: int, agents: Sequence[str]) -> MovingWorld:
        """The world; without `agents` the motion names them."""
        name = "random-waypoint" if self.random_waypoint else "paths" if self.paths is not None else "circle"
        try:
            motion = self._motion(agents)
        except BadInput as error:
            raise BadInput(str(error), (name,)) from error
        if agents and set(motion.agents) != set(agents):
            text = (
                f"it moves agents {', '.join(motion.agents)}, the topology has {', '.join(agents)}: make them the same"
            )
            raise BadInput(text, (name,))
        if self.position is None:
            return MovingWorld(motion, seed)
        return MovingWorld(motion, seed, self.position.rate, self.position.noise)

    def _motion(self, agents: Sequence[str]) -> Motion:
        way = self.random_waypoint or self.circle
        if way is not None:
            return way.motion(agents)
        paths = self.paths or {}
        return Paths({agent: tuple(sorted(paths[agent].items())) for agent in sorted(paths, key=natural_key)})


def _names(count: int | None, agents: Sequence[str]) -> tuple[str, ...]:
    if count is not None:
        if count < 1:
            raise BadInput(f"count is {count}, it must be at least 1")
        return tuple(str(number) for number in range(1, count + 1))
    if not agents:
        raise BadInput("count is missing: the topology does not say how many agents there are")
    return tuple(agents)
