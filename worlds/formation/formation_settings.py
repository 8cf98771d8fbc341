"""Settings of a formation of vehicles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...topologies import Formation, Position
from ...units import Hertz, Metres, Nanoseconds, Radians
from ..world_kinds import check_agent
from .air import Gust, Random, Scripted, Turbulence
from .camera import Camera
from .formation_world import FormationWorld, headings_to
from .imu import Imu
from .vehicles import Vehicle

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FormationSettings:
    """A formation of micro aerial vehicles, one for each agent of the topology.

    start: initial formation, as in {triangle: 0.9 m}.
    altitude: initial altitude of the vehicles.
    facing: initial headings: towards the next vehicle, the centre, in a direction, or by name towards another one, as
        in {1: 2}.
    vehicle: parameters of all vehicles.
    camera: of each vehicle, or none.
    imu: inertial measurement unit of each vehicle, or none.
    turbulence: an acceleration of each vehicle.
    gusts: accelerations of all vehicles: a list, or parameters of random ones.
    ground: whether contacts with the ground are reported.
    undisturbed: without noise, biases, misses, turbulence and gusts.
    sense_delay: from a sample to its arrival.
    act_delay: from a command to its effect.
    steps: rate of the integration.
    truth_rate: rate at which the truth is recorded.
    """

    needs_places: ClassVar[bool] = False

    start: Formation
    altitude: Metres = 1.5
    facing: Literal["next", "centre"] | Radians | Mapping[str, str | int] = "next"
    vehicle: Vehicle = Vehicle()  # noqa: RUF009 - frozen
    camera: Camera | Literal["none"] = Camera()  # noqa: RUF009 - frozen
    imu: Imu | Literal["none"] = Imu()  # noqa: RUF009 - frozen
    turbulence: Turbulence = Turbulence()  # noqa: RUF009 - frozen
    gusts: tuple[Gust, ...] | Random = ()
    ground: bool = False
    undisturbed: bool = False
    sense_delay: Nanoseconds = 5_000_000
    act_delay: Nanoseconds = 5_000_000
    steps: Hertz = 60.0
    truth_rate: Hertz = 30.0

    def build(self, positions: Mapping[str, Position], seed: int, agents: Sequence[str]) -> FormationWorld:
        """The world."""
        try:
            places = self.start.of(len(agents))
        except BadInput as error:
            raise BadInput(str(error), ("start", *error.place)) from error
        places[:, 2] += self.altitude
        world = FormationWorld(
            tuple(agents),
            tuple((x, y, z) for x, y, z in places.tolist()),
            self._headings(agents, places),
            seed,
            self.vehicle,
            None if self.camera == "none" else self.camera,
            None if self.imu == "none" else self.imu,
            self.turbulence,
            self.gusts if isinstance(self.gusts, Random) else Scripted(self.gusts),
            self.ground,
            self.steps,
            self.sense_delay,
            self.act_delay,
            self.truth_rate,
        )
        return world.undisturbed() if self.undisturbed else world

    def _headings(self, agents: Sequence[str], places: Floats) -> tuple[float, ...]:
        """Headings towards the next vehicle (of the last: the first), the centre or others by name, or at an angle."""
        following = np.roll(places, -1, axis=0)
        if isinstance(self.facing, float):
            return (self.facing,) * len(agents)
        if self.facing == "centre":
            return headings_to(places, np.broadcast_to(places.mean(axis=0), places.shape))
        for seer, other in self.facing.items() if isinstance(self.facing, Mapping) else ():
            seen = str(other)
            for name in (seer, seen):
                check_agent(name, agents, "facing", seer)
            if seer == seen:
                raise BadInput(f"vehicle {seer} cannot face itself", ("facing", seer))
            following[agents.index(seer)] = places[agents.index(seen)]
        return headings_to(places, following)
