"""Settings of a rigid body with measurement units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from ...rotations import euler_to_quaternion
from ...topologies import Position, natural_key
from ...units import Hertz, KilogramSquareMetres, Radians, RadiansPerSecond
from ..signals import Constant, Torques
from ..world_kinds import check_agent
from .body import RigidBody
from .measurement_units import MeasurementUnit, RigidBodyWorld

_NONE = Constant(0.0)


@dataclass(frozen=True)
class RigidBodySettings:
    """A rotating body with measurement units.

    units: agent → its unit, as in {1: {mounting: [135 deg, 0, 0], noise: 0.02 rad, sensors: [accelerometer]}}.
    inertia: principal moments.
    attitude: initial roll, pitch and yaw.
    rates: initial rates about the body's axes.
    torque: about the body's axes.
    rate: of all sensors.
    """

    needs_places: ClassVar[bool] = False

    units: Mapping[str, MeasurementUnit]
    inertia: tuple[KilogramSquareMetres, KilogramSquareMetres, KilogramSquareMetres] = (0.02, 0.03, 0.04)
    attitude: tuple[Radians, Radians, Radians] = (0.0, 0.0, 0.0)
    rates: tuple[RadiansPerSecond, RadiansPerSecond, RadiansPerSecond] = (0.0, 0.0, 0.0)
    torque: tuple[Torques, Torques, Torques] = (_NONE, _NONE, _NONE)
    rate: Hertz = 10.0

    def build(self, positions: Mapping[str, Position], seed: int, agents: Sequence[str]) -> RigidBodyWorld:
        """The world."""
        units = {agent: self.units[agent] for agent in sorted(self.units, key=natural_key)}
        for agent in units:
            check_agent(agent, agents, "units", agent)
        w, i, j, k = euler_to_quaternion(*self.attitude).tolist()
        return RigidBodyWorld(RigidBody(self.inertia, (w, i, j, k), self.rates, self.torque), units, seed, self.rate)
