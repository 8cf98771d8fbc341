"""Settings of a vehicle that flies over a room."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from ...errors import BadInput
from ...kinds import Kinds
from ...topologies import Position
from ...units import Metres, MetresPerSecond, Seconds
from ..world_kinds import check_agent
from .altitude_sensors import SENSORS, AltitudeSensor
from .altitude_world import AltitudeWorld
from .room import Obstacle, Room
from .tour import Tour

Point = tuple[Metres, Metres]


@dataclass(frozen=True)
class FlightSettings:
    """The flight; see `tour.Tour`.

    waypoints: the first above the place of take-off, the last above that of landing.
    altitude: of the legs, over the floor.
    speed: mean speed of a leg.
    wait: time on the ground before the take-off, and hovering before the landing.
    take_off: duration of the climb.
    landing: duration of the descent.
    drop: height over the surface from which it falls freely.
    sway: amplitude by which the altitude rises above the reference and back.
    sway_period: approximate period of the sway.
    """

    waypoints: tuple[Point, ...]
    altitude: Metres = 1.4
    speed: MetresPerSecond = 0.5
    wait: Seconds = 2.0
    take_off: Seconds = 4.0
    landing: Seconds = 5.0
    drop: Metres = 0.0
    sway: Metres = 0.05
    sway_period: Seconds = 8.0

    def tour(self, room: Room) -> Tour:
        """The flight over a room, from and to the surface below its ends."""
        if not self.waypoints:
            raise BadInput("no waypoint: write a list of points, as in [[0 m, 0 m], [4 m, 0 m]]", ("waypoints",))
        ground = room.surface(*self.waypoints[0])[0], room.surface(*self.waypoints[-1])[0]
        return Tour(**{**vars(self), "ground": ground})


@dataclass(frozen=True)
class Table:
    """A box on the floor.

    centre: of the box.
    size: along x and y.
    height: of its surface.
    roughness: additional standard deviation of range finders above it.
    """

    uneven: ClassVar[bool] = False

    centre: Point
    size: Point = (1.2, 0.8)
    height: Metres = 0.75
    roughness: Metres = 0.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        self.obstacle()

    def obstacle(self) -> Obstacle:
        """The obstacle in the room."""
        return Obstacle(self.centre, self.size, self.height, self.uneven, self.roughness)


@dataclass(frozen=True)
class Chair(Table):
    """An uneven obstacle: cells that are seat, back rest or a gap to the floor."""

    uneven: ClassVar[bool] = True

    size: Point = (0.5, 0.5)
    height: Metres = 0.45
    roughness: Metres = 0.1


@dataclass(frozen=True)
class Platform(Table):
    """A box to land on."""

    size: Point = (1.4, 1.4)
    height: Metres = 0.47


OBSTACLES = Kinds("obstacle", {"table": Table, "chair": Chair, "platform": Platform})


@dataclass(frozen=True)
class AltitudeSettings:
    """A vehicle that flies over a room, with its sensors on agents.

    flight: take-off, legs and landing.
    sensors: agent → its sensor, as in {imu1: imu, baro: {barometer: {bias: 35 cm}}}.
    obstacles: on the floor, as in [{table: {centre: [2 m, 0 m]}}, {chair: …}, {platform: …}].
    """

    needs_places: ClassVar[bool] = False

    flight: FlightSettings
    sensors: Mapping[str, Annotated[AltitudeSensor, SENSORS]]
    obstacles: tuple[Annotated[Table, OBSTACLES], ...] = ()

    def build(self, positions: Mapping[str, Position], seed: int, agents: Sequence[str]) -> AltitudeWorld:
        """The world."""
        room = Room(tuple(obstacle.obstacle() for obstacle in self.obstacles), seed)
        try:
            tour = self.flight.tour(room)
        except BadInput as error:
            raise BadInput(str(error), ("flight", *error.place)) from error
        for agent in self.sensors:
            check_agent(agent, agents, "sensors", agent)
        return AltitudeWorld(tour, room, tuple(self.sensors.items()), seed)
