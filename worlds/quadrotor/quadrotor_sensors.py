"""The sensors of a quadrotor, and the world of a manoeuvre and its sensors.

Letters as in `quadrotor`; p position of a sensor on the body [m], R₃ the third row of R, h altitude [m].
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...randomness import Stream, stream
from ...units import check_above_zero, period_ns
from .flight import GRAVITY, Airframe, FlightState, Manoeuvre, flight

Floats = NDArray[np.float64]
Place = tuple[float, float, float]

RANGES = MappingProxyType(
    {
        "range_centre": (0.0, 0.0),
        "range_front": (1.0, 0.0),
        "range_right": (0.0, 1.0),
        "range_back": (-1.0, 0.0),
        "range_left": (0.0, -1.0),
    }
)
"""Range sensor → its position, in arm lengths forward and to the right."""

DEVIATIONS = MappingProxyType(
    {
        "gyroscope": math.sqrt(6e-6),
        "accelerometer": math.sqrt(2.5e-3),
        "magnetometer": math.sqrt(2.5e-7),
        "flow": math.sqrt(1e-6),
        **dict.fromkeys(RANGES, math.sqrt(2.6e-7)),
    }
)
"""Sensor → standard deviation of its noise, Bassolillo 2025, Table I [rad/s, m/s², G, m/s, m]."""

FIELD = (0.24, 0.02, 0.39)
"""Magnetic field, north-east-down [G]; ours."""

AS_PRINTED = ("accelerometer", "range")
_CACHED_SENSORS = 4096


@dataclass(frozen=True)
class QuadrotorWorld:
    """A quadrotor in a manoeuvre, its sensors spread over agents.

    carriers: agent → its sensors. rates: sensor → samples per second [Hz].
    noise: factor on all deviations of Table I.
    flow_at: position of the optical-flow camera on the body [m].
    as_printed: sensors that follow the paper's equation exactly as printed: `accelerometer` (13), `range` (17).

    Raises:
        BadInput: no sensor at all, an unknown one, one that two agents have, a rate not above 0, noise below 0.
    """

    manoeuvre: Manoeuvre
    carriers: Mapping[str, tuple[str, ...]]
    seed: int
    rates: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(DEVIATIONS, 100.0))
    airframe: Airframe = field(default_factory=Airframe)
    noise: float = 1.0
    flow_at: Place = (0.1, 0.05, 0.0)
    as_printed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check names and bounds."""
        carried = [sensor for sensors in self.carriers.values() for sensor in sensors]
        if not carried:
            raise BadInput(f"no sensor: give at least one agent one of {', '.join(DEVIATIONS)}")
        for sensor in (*carried, *self.rates):
            if sensor not in DEVIATIONS:
                raise BadInput(f"sensor {sensor!r} is not known: a quadrotor has {', '.join(DEVIATIONS)}")
        for sensor in carried:
            if carried.count(sensor) > 1:
                raise BadInput(f"sensor {sensor} is there {carried.count(sensor)} times: give it to one agent, once")
            check_above_zero(f"rate of {sensor}", self.rates[sensor], "Hz")
        if not 0.0 <= self.noise < math.inf:
            raise BadInput(f"noise is {self.noise:g} times that of Table I, it must be at least 0")
        for name in self.as_printed:
            if name not in AS_PRINTED:
                raise BadInput(f"as_printed names {name!r}: it can name {' and '.join(AS_PRINTED)}")

    def sensors(self, agent: str) -> Mapping[str, float]:
        """Sensor → rate [Hz] of one agent; none where it carries none."""
        return {sensor: self.rates[sensor] for sensor in self.carriers.get(agent, ())}

    def measure(self, agent: str, sensor: str, index: int) -> Floats | None:
        """The index-th sample, taken at floor(index · 10⁹ / rate), with its noise.

        Returns:
            gyroscope (3,) [rad/s], accelerometer (3,) [m/s²], magnetometer (3,) [G], flow (2,) [m/s], a range (1,) [m];
            None where a range sensor does not look down at the ground.
        Raises:
            BadInput: the agent does not carry this sensor.
        """
        if sensor not in self.carriers.get(agent, ()):
            carried = ", ".join(self.carriers.get(agent, ())) or "none"
            raise BadInput(f"agent {agent} has no sensor {sensor!r}: it has {carried}")
        true = self.reading(sensor, self.motion(period_ns(self.rates[sensor], index)))
        if true is None:
            return None
        draws = _noise(self.seed, agent, sensor)
        deviation = self.noise * DEVIATIONS[sensor]
        return true + deviation * np.array([draws.normal(len(true) * index + axis) for axis in range(len(true))])

    def reading(self, sensor: str, motion: FlightState) -> Floats | None:
        """Reading of a sensor without noise.

        Gyroscope ω (12), accelerometer Rᵀ(V̇ − g) for (13), magnetometer Rᵀ M (14), flow the first two of Rᵀ V + ω × p
        for (15), range −(z + R₃·p)/R₃₃ for (17). As printed: accelerometer Rᵀ(V̇ + g), range h / R₃₃ for all.
        """
        R = motion.rotation
        if sensor == "gyroscope":
            return motion.rates
        if sensor == "accelerometer":
            sign = 1.0 if sensor in self.as_printed else -1.0
            return np.asarray(R.T @ (motion.acceleration + np.array([0.0, 0.0, sign * GRAVITY])))
        if sensor == "magnetometer":
            return np.asarray(R.T @ np.array(FIELD))
        if sensor == "flow":
            return np.asarray(R.T @ motion.velocity + np.cross(motion.rates, self.flow_at))[:2]
        return self._range(sensor, motion)

    def _range(self, sensor: str, motion: FlightState) -> Floats | None:
        below = motion.height
        if "range" not in self.as_printed:
            forward, right = RANGES[sensor]
            below -= self.airframe.arm * float(motion.rotation[2] @ (forward, right, 0.0))
        upright = float(motion.rotation[2, 2])
        return np.array([below / upright]) if upright > 0.0 and below > 0.0 else None

    def motion(self, time_ns: int) -> FlightState:
        """The motion at an instant."""
        return flight(self.airframe, self.manoeuvre).at(time_ns)

    def truth(self, time_ns: int) -> Floats:
        """The state (q, V, z) of (6) at an instant, shape (8,) [1, m/s, m]."""
        motion = self.motion(time_ns)
        return np.concatenate([motion.attitude, motion.velocity, [-motion.height]])


@lru_cache(maxsize=_CACHED_SENSORS)
def _noise(seed: int, agent: str, sensor: str) -> Stream:
    """Noise stream of one sensor; cached because it draws in blocks, without effect on the draws."""
    return stream(seed, "quadrotor noise", agent, sensor)
