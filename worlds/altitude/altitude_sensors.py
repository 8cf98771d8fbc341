"""Sensors of a vehicle that flies over a room: inertial measurement unit, barometer, range finder.

Each is a pure function of seed, agent and index. Letters: z height, φ roll, θ pitch, f specific force, R body→inertial.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...kinds import Kinds
from ...randomness import Stream, stream
from ...units import (
    Hertz,
    Metres,
    MetresPerRootSecond,
    MetresPerSecondSquared,
    MetresPerSecondSquaredPerRootSecond,
    Radians,
    RadiansPerSecond,
    check_above_zero,
    period_ns,
)
from ..random_walks import walk
from .room import Room
from .tour import GRAVITY, Pose, Tour

_KEPT = 256
_SETTLING_NS = 1_000_000_000
"""Duration of the shift of a barometer's bias after the take-off."""


class AltitudeSensor(Protocol):
    """One sensor of the vehicle."""

    name: ClassVar[str]

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""

    def reading(self, tour: Tour, room: Room, seed: int, agent: str, index: int) -> NDArray[np.float64] | None:
        """The index-th sample, None where it sees nothing."""


@dataclass(frozen=True)
class ImuSensor:
    """Specific force along the body's z axis, roll, pitch, and the body's roll and pitch rate, (5,) [m/s², rad, rad/s].

    (24), (27) and (30) of Bavle 2017, without the approximation of small tilts. Noise in the same units; the bias of
    the accelerometer walks by `bias_walk` [m/s²/√s], and it shows no more than `saturation` [m/s²] in either direction.

    Raises:
        BadInput: a rate not above 0, or a noise below 0.
    """

    name: ClassVar[str] = "imu"

    rate: Hertz = 100.0
    acceleration_noise: MetresPerSecondSquared = 0.2
    attitude_noise: Radians = math.radians(0.5)
    gyro_noise: RadiansPerSecond = 0.02
    bias: MetresPerSecondSquared = 0.1
    bias_walk: MetresPerSecondSquaredPerRootSecond = 0.002
    saturation: MetresPerSecondSquared = 16 * GRAVITY

    def __post_init__(self) -> None:
        """Check the bounds."""
        _check(self.rate, self.acceleration_noise, self.attitude_noise, self.gyro_noise, self.bias_walk)
        if not self.saturation > GRAVITY:
            raise BadInput(
                f"saturation is {self.saturation:g} m/s², it must be above {GRAVITY} m/s², which is there at rest"
            )

    def reading(self, tour: Tour, room: Room, seed: int, agent: str, index: int) -> NDArray[np.float64]:
        """The index-th sample."""
        time_ns = period_ns(self.rate, index)
        pose = tour.pose(time_ns)
        bias = self.bias + self.bias_walk * walk(seed, "accelerometer bias", agent, time_ns)
        true = (pose.specific_force + bias, pose.roll, pose.pitch, pose.roll_rate, pose.pitch_rate)
        noise = (self.acceleration_noise, *[self.attitude_noise] * 2, *[self.gyro_noise] * 2)
        draws = _stream(seed, "imu", agent)
        normal = [draws.normal(5 * index + component) for component in range(5)]
        values = np.array(true) + np.array(noise) * normal
        values[0] = min(max(values[0], -self.saturation), self.saturation)
        return values


@dataclass(frozen=True)
class BarometerSensor:
    """Height over the floor with a bias, (1,) [m], Bavle 2017, (36), in steps of `resolution`.

    The bias is `bias`, walks by `bias_walk` [m/√s], and has shifted by `shift` a second after the take-off, as the
    rotors change the pressure around it [m].

    Raises:
        BadInput: a rate not above 0, or a noise or resolution below 0.
    """

    name: ClassVar[str] = "barometer"

    rate: Hertz = 20.0
    noise: Metres = 0.2
    bias: Metres = 0.35
    bias_walk: MetresPerRootSecond = 0.01
    shift: Metres = 0.2
    resolution: Metres = 0.1

    def __post_init__(self) -> None:
        """Check the bounds."""
        _check(self.rate, self.noise, self.bias_walk, self.resolution)

    def offset(self, tour: Tour, seed: int, agent: str, time_ns: int) -> float:
        """The true bias at an instant [m]."""
        shifted = min(max((time_ns - tour.take_off_ns) / _SETTLING_NS, 0.0), 1.0)
        return self.bias + self.shift * shifted + self.bias_walk * walk(seed, "barometer bias", agent, time_ns)

    def reading(self, tour: Tour, room: Room, seed: int, agent: str, index: int) -> NDArray[np.float64]:
        """The index-th sample."""
        time_ns = period_ns(self.rate, index)
        height = float(tour.pose(time_ns).position[2]) + self.offset(tour, seed, agent, time_ns)
        return _rounded(height + self.noise * _stream(seed, "barometer", agent).normal(index), self.resolution)


@dataclass(frozen=True)
class RangeSensor:
    """Distance to the surface along the body's downward axis, (1,) [m], Bavle 2017, (38), in steps of `resolution`.

    It reads nothing below 0, and sees nothing beyond `farthest` [m]. Obstacles may add to its noise.

    Raises:
        BadInput: a rate not above 0, or a noise, resolution or farthest distance below 0.
    """

    name: ClassVar[str] = "range"

    rate: Hertz = 20.0
    noise: Metres = 0.03
    resolution: Metres = 0.01
    farthest: Metres = 25.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        _check(self.rate, self.noise, self.resolution, self.farthest)

    def reading(self, tour: Tour, room: Room, seed: int, agent: str, index: int) -> NDArray[np.float64] | None:
        """The index-th sample, None beyond the farthest distance."""
        pose = tour.pose(period_ns(self.rate, index))
        x, y, z = pose.position.tolist()
        true, roughness = room.beam((x, y, z), downward(pose))
        reading = true + math.hypot(self.noise, roughness) * _stream(seed, "range", agent).normal(index)
        return _rounded(max(reading, 0.0), self.resolution) if reading <= self.farthest else None


SENSORS = Kinds("sensor", {"imu": ImuSensor, "barometer": BarometerSensor, "range": RangeSensor})


def downward(pose: Pose) -> tuple[float, float, float]:
    """The body's downward axis −R e₃ in the inertial frame, of unit length."""
    across = math.cos(pose.roll)
    return (-math.sin(pose.pitch) * across, math.sin(pose.roll), -math.cos(pose.pitch) * across)


def _check(rate: float, *sizes: float) -> None:
    check_above_zero("rate", rate, "Hz")
    if any(not size >= 0 for size in sizes):
        raise BadInput(f"noises, walks and resolutions are {', '.join(f'{size:g}' for size in sizes)}: none is below 0")


def _rounded(value: float, resolution: float) -> NDArray[np.float64]:
    return np.array([round(value / resolution) * resolution if resolution else value])


@lru_cache(maxsize=_KEPT)
def _stream(seed: int, purpose: str, agent: str) -> Stream:
    """Noise stream of one sensor; cached because it draws in blocks, without effect on the draws."""
    return stream(seed, purpose, agent)
