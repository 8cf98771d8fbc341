"""A rigid body with distance sensors over a plane: the world of the flying array.

Letters: state x = (z, γ, β) altitude [m], roll and pitch [rad]; (r_X, r_Y) position of a module on the body [m].
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import BadInput
from ...randomness import Stream, stream
from ...topologies import Position
from ...units import check_above_zero, period_ns
from ..signals import Signal
from .distance_sensors import DistanceSensor, GaussianDistance

SENSOR = "distance"
GYROSCOPE = "gyroscope"
_AXES = 3


def distances(state: ArrayLike, positions: ArrayLike) -> NDArray[np.float64]:
    """Distances to the ground along the body's downward axis.

    m = (z + r_Y cos β sin γ − r_X sin β) / (cos β cos γ)            Kriegleder 2012, (6)

    Args:
        state: (z, γ, β), shape (3,) [m, rad, rad].
        positions: one row (r_X, r_Y) a module, shape (N, 2) [m].
    Returns:
        Shape (N,) [m]; negative where the module is in the ground.
    Raises:
        BadInput: a tilt of 90° or more, from which the downward axis does not meet the ground.
    """
    altitude, roll, pitch = np.asarray(state, dtype=np.float64).tolist()
    if not (abs(roll) < math.pi / 2 and abs(pitch) < math.pi / 2):
        raise BadInput(f"roll {math.degrees(roll)} deg and pitch {math.degrees(pitch)} deg must be within 90 deg")
    x, y = np.asarray(positions, dtype=np.float64).T
    height = altitude + y * (math.cos(pitch) * math.sin(roll)) - x * math.sin(pitch)
    result: NDArray[np.float64] = height / (math.cos(pitch) * math.cos(roll))
    return result


def turning(before: ArrayLike, now: ArrayLike, period_s: float) -> NDArray[np.float64]:
    """Output of rate gyros that integrate over a period: the mean rate of the body about its own axes.

    p = γ̇,  q = β̇ cos γ,  r = −β̇ sin γ            rate of turning of roll γ and pitch β without yaw
    with the differences of the angles over the period for their rates, and the mean of γ for γ.

    Args:
        before: (γ, β) at the start of the period [rad].
        now: the same at its end [rad].
        period_s: its length [s].
    Returns:
        (p, q, r), shape (3,) [rad/s].
    """
    first, last = np.asarray(before, dtype=np.float64), np.asarray(now, dtype=np.float64)
    roll_rate, pitch_rate = ((last - first) / period_s).tolist()
    roll = float(first[0] + last[0]) / 2
    return np.array([roll_rate, pitch_rate * math.cos(roll), -pitch_rate * math.sin(roll)])


@lru_cache(maxsize=4096)
def _gyroscope_noise(seed: int, agent: str) -> Stream:
    return stream(seed, "gyroscope noise", agent)


@dataclass(frozen=True)
class PlaneModel:
    """What is known of the sensors beforehand: `rate` [Hz], standard deviations of their noise [m, rad/s].

    `distance_noise` is None where it is not the same at all distances, `gyroscope_noise` where there are no gyros.
    """

    rate: float
    distance_noise: float | None
    gyroscope_noise: float | None


@dataclass(frozen=True)
class PlaneWorld:
    """A rigid body over a plane; altitude [m], roll and pitch [rad] are given functions of time.

    `positions` maps agent → (r_X, r_Y) [m]. Every agent has one distance sensor, sampled at `rate` [Hz], and where
    `gyroscope` says with what noise [rad/s], three rate gyros as well. All is a pure function of seed and time, and can
    be pickled.

    Raises:
        BadInput: altitude not above 0, a tilt of 90° or more, a rate not above 0, a noise below 0, no positions, or one
            not a pair.
    """

    altitude: Signal
    roll: Signal
    pitch: Signal
    positions: Mapping[str, Position]
    sensor: DistanceSensor
    seed: int
    rate: float = 20.0
    gyroscope: float | None = None

    def __post_init__(self) -> None:
        """Check rates, noise, positions, and the state over the whole run."""
        lowest, _ = self.altitude.bounds()
        if not lowest > 0.0:
            raise BadInput(f"altitude goes down to {lowest} m: keep it above 0")
        for name, signal in (("roll", self.roll), ("pitch", self.pitch)):
            largest = max(map(abs, signal.bounds()))
            if not largest < math.pi / 2:
                raise BadInput(f"{name} reaches {math.degrees(largest):g} deg: keep it within 90 deg")
        check_above_zero("rate", self.rate, "Hz")
        if self.gyroscope is not None and self.gyroscope < 0.0:
            raise BadInput(f"gyroscope noise {self.gyroscope:g} rad/s must be at least 0")
        if not self.positions:
            raise BadInput("the topology gives no positions of modules: use one that does, such as hexagonal or cells")
        for agent, position in self.positions.items():
            if len(position) != 2:
                raise BadInput(f"position {position} of agent {agent} must be two numbers, x and y on the body")

    @property
    def model(self) -> PlaneModel:
        """What agents know of it beforehand."""
        noise = self.sensor.noise if isinstance(self.sensor, GaussianDistance) else None
        return PlaneModel(self.rate, noise, self.gyroscope)

    def sensors(self, agent: str) -> Mapping[str, float]:
        """The sensors of an agent and their rate [Hz].

        Raises:
            BadInput: an agent that has no position.
        """
        self._position(agent)
        return {SENSOR: self.rate} if self.gyroscope is None else {SENSOR: self.rate, GYROSCOPE: self.rate}

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """The index-th sample of a sensor, taken at floor(index · 10⁹ / rate).

        Args:
            agent: whose sensor.
            sensor: its name, "distance" or "gyroscope".
            index: of the sample, ≥ 0.
        Returns:
            Distance, shape (1,) [m]; None where the sensor sees nothing or the module touches the ground. Of the
            gyroscope, shape (3,) [rad/s], as `turning` says with noise; None at the first sample.
        Raises:
            BadInput: an agent or a sensor that is not there.
        """
        position = self._position(agent)
        if sensor not in self.sensors(agent):
            raise BadInput(f"agent {agent} has no sensor {sensor!r}: it has {', '.join(self.sensors(agent))}")
        if sensor == GYROSCOPE:
            return self._turned(agent, index)
        true = float(distances(self.truth(period_ns(self.rate, index)), [position])[0])
        reading = self.sensor.reading(true, self.seed, agent, index) if true > 0.0 else None
        return None if reading is None else np.array([reading])

    def _turned(self, agent: str, index: int) -> NDArray[np.float64] | None:
        if index == 0 or self.gyroscope is None:
            return None
        before, now = (self.truth(period_ns(self.rate, at)) for at in (index - 1, index))
        draws = _gyroscope_noise(self.seed, agent)
        noise = np.array([draws.normal(_AXES * index + axis) for axis in range(_AXES)])
        return turning(before[1:], now[1:], 1.0 / self.rate) + self.gyroscope * noise

    def truth(self, time_ns: int) -> NDArray[np.float64]:
        """The true state (z, γ, β) at an instant, shape (3,) [m, rad, rad]."""
        return np.array([signal.value(time_ns) for signal in (self.altitude, self.roll, self.pitch)])

    def _position(self, agent: str) -> Position:
        if agent not in self.positions:
            raise BadInput(f"agent {agent!r} has no position in the world: it knows {', '.join(self.positions)}")
        return self.positions[agent]
