"""Distance sensors: a Gaussian one, and an infrared one with its voltage curve, noise, range and calibration.

Every draw is a function of (seed, purpose, agent, index) and of nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt
from typing import Protocol

from ...errors import BadInput
from ...randomness import Stream, stream
from .calibration import Calibration, calibrate

_CACHED_AGENTS = 4096
_TYPICAL = Calibration(a=-0.05, b=0.33, c=0.004)
_LARGEST_VOLTAGE_NOISE = 0.1


class DistanceSensor(Protocol):
    """Converts a true distance to a reading."""

    def reading(self, distance: float, seed: int, agent: str, index: int) -> float | None:
        """The index-th reading [m] of one agent's sensor at a true distance [m], None where it sees nothing."""


@dataclass(frozen=True)
class GaussianDistance:
    """True distance plus independent Gaussian noise of this standard deviation [m], Kriegleder 2012, (9).

    Raises:
        BadInput: noise below 0.
    """

    noise: float

    def __post_init__(self) -> None:
        """Check the noise."""
        if not self.noise >= 0.0:
            raise BadInput(f"noise {self.noise} m must be at least 0")

    def reading(self, distance: float, seed: int, agent: str, index: int) -> float | None:
        """The noisy distance; it has no limits of range."""
        return distance + self.noise * _noise(seed, "distance noise", agent).normal(index)


@dataclass(frozen=True)
class Infrared:
    """An infrared distance sensor of the flying array: voltage by (31), noise in the voltage, own calibration.

    Each module's curve departs from `typical` by Gaussian factors: `spread` of b and of c, relative, and `offset` of a
    [m]. It is calibrated at `references` distances, evenly spaced over its range, each with the mean of `averaged`
    voltages (Kriegleder 2012, Fig. 7). Outside `nearest` to `farthest` [m] there is no reading.

    Raises:
        BadInput: noise below 0 V or above 0.1 V.
    """

    noise: float
    typical: Calibration = _TYPICAL
    spread: float = 0.03
    offset: float = 0.003
    references: int = 10
    averaged: int = 100
    nearest: float = 0.07
    farthest: float = 0.80

    def __post_init__(self) -> None:
        """Check the noise."""
        if not 0.0 <= self.noise <= _LARGEST_VOLTAGE_NOISE:
            raise BadInput(
                f"noise {self.noise} V must be from 0 to {_LARGEST_VOLTAGE_NOISE} V: more leaves nothing to calibrate"
            )

    def reading(self, distance: float, seed: int, agent: str, index: int) -> float | None:
        """The distance by the calibrated curve, None where it is out of the sensor's range."""
        curve, calibrated = curves(self, seed, agent)
        voltage = curve.voltage(distance) + self.noise * _noise(seed, "infrared noise", agent).normal(index)
        if voltage <= 0.0:
            return None
        measured = calibrated.distance(voltage)
        return measured if self.nearest <= measured <= self.farthest else None


@lru_cache(maxsize=_CACHED_AGENTS)
def _noise(seed: int, purpose: str, agent: str) -> Stream:
    """Noise stream of one sensor; cached because it draws in blocks, without effect on the draws."""
    return stream(seed, purpose, agent)


@lru_cache(maxsize=_CACHED_AGENTS)
def curves(sensor: Infrared, seed: int, agent: str) -> tuple[Calibration, Calibration]:
    """True curve and calibrated curve of a module."""
    variation = stream(seed, "infrared curve", agent)
    curve = Calibration(
        sensor.typical.a + sensor.offset * variation.normal(0),
        sensor.typical.b * (1.0 + sensor.spread * variation.normal(1)),
        sensor.typical.c * (1.0 + sensor.spread * variation.normal(2)),
    )
    known = [sensor.farthest * (k + 1) / sensor.references for k in range(sensor.references)]
    error = stream(seed, "infrared calibration", agent)
    remaining = sensor.noise / sqrt(sensor.averaged)
    voltages = [curve.voltage(distance) + remaining * error.normal(k) for k, distance in enumerate(known)]
    return curve, calibrate(voltages, known)
