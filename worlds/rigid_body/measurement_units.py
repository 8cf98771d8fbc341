"""Measurement units on a rigid body: accelerometers and magnetometers that measure directions, each in its own frame.

Letters: Q attitude of the body, M mounting of a unit (unit → body), r a direction in the inertial frame, b the same one
in the frame of a unit. The inertial frame has z along gravity and x along the horizontal part of the magnetic field.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...randomness import Stream, stream
from ...rotations import conjugate, euler_to_quaternion, quaternion_product, rotate
from ...units import Radians, check_above_zero, period_ns
from .body import RigidBody, Triple, turning

Floats = NDArray[np.float64]

ACCELEROMETER: Final = "accelerometer"
MAGNETOMETER: Final = "magnetometer"
_DIP = math.atan2(0.348, 0.337)
DIRECTIONS: Mapping[str, Triple] = MappingProxyType(
    {ACCELEROMETER: (0.0, 0.0, 1.0), MAGNETOMETER: (math.cos(_DIP), 0.0, math.sin(_DIP))}
)
"""Sensor → the direction that it sees, in the inertial frame: r₁ and r₂ of Betanzos 2024, Sec. 3.1, at norm 1."""
_CACHED_SENSORS = 4096


@dataclass(frozen=True)
class MeasurementUnit:
    """One unit: its mounting, noise and sensors.

    mounting: roll, pitch and yaw of its frame in the body frame [rad].
    noise: standard deviation of each component of a direction [rad].
    sensors: of `accelerometer` and `magnetometer`.

    Raises:
        BadInput: noise below 0, an unknown sensor, or one twice.
    """

    mounting: tuple[Radians, Radians, Radians] = (0.0, 0.0, 0.0)
    noise: Radians = 0.0
    sensors: tuple[Literal["accelerometer", "magnetometer"], ...] = (ACCELEROMETER, MAGNETOMETER)

    def __post_init__(self) -> None:
        """Check noise and sensors."""
        if not 0.0 <= self.noise < math.inf:
            raise BadInput(f"noise is {self.noise:g} rad, it must be at least 0")
        for sensor in self.sensors:
            if sensor not in DIRECTIONS:
                raise BadInput(f"sensor {sensor!r} is not known: a unit has {' and '.join(DIRECTIONS)}")
            if self.sensors.count(sensor) > 1:
                raise BadInput(f"sensor {sensor} is there twice: a unit has one")


@dataclass(frozen=True)
class RigidBodyWorld:
    """A rotating body with measurement units; agents without a unit have no sensor.

    units: agent → its unit. rate: samples per second of all sensors, at common instants [Hz].

    Raises:
        BadInput: a rate not above 0, or no sensor at all.
    """

    body: RigidBody
    units: Mapping[str, MeasurementUnit]
    seed: int
    rate: float = 10.0

    def __post_init__(self) -> None:
        """Check the rate, and that there is a sensor."""
        check_above_zero("rate", self.rate, "Hz")
        if not any(unit.sensors for unit in self.units.values()):
            raise BadInput("no unit has a sensor, so nothing tells the attitude: give one an accelerometer")

    def sensors(self, agent: str) -> Mapping[str, float]:
        """Sensor → rate [Hz] of one agent; none where it has no unit."""
        return dict.fromkeys(self.units[agent].sensors, self.rate) if agent in self.units else {}

    def measure(self, agent: str, sensor: str, index: int) -> Floats:
        """The index-th sample, taken at floor(index · 10⁹ / rate): a direction in the frame of the unit.

        b = R(Q ⊙ M)ᵀ r + n            Betanzos 2024, (11); n normal, independent in each component

        Returns:
            Shape (3,), of norm 1 but for the noise.
        Raises:
            BadInput: the agent has no such sensor.
        """
        if sensor not in self.sensors(agent):
            has = ", ".join(self.sensors(agent)) or "none"
            raise BadInput(f"agent {agent} has no sensor {sensor!r}: it has {has}")
        unit = self.units[agent]
        frame = quaternion_product(self.attitude(period_ns(self.rate, index)), euler_to_quaternion(*unit.mounting))
        draws = _noise(self.seed, agent, sensor)
        noise = [unit.noise * draws.normal(3 * index + axis) for axis in range(3)]
        return rotate(conjugate(frame), np.array(DIRECTIONS[sensor])) + noise

    def attitude(self, time_ns: int) -> Floats:
        """The attitude Q of the body at an instant, unit quaternion, (4,)."""
        return self.truth(time_ns)[:4].copy()

    def truth(self, time_ns: int) -> Floats:
        """Attitude Q and body rates ω [rad/s] at an instant, (7,)."""
        return turning(self.body).at(time_ns)


@lru_cache(maxsize=_CACHED_SENSORS)
def _noise(seed: int, agent: str, sensor: str) -> Stream:
    return stream(seed, f"{sensor} noise", agent)
