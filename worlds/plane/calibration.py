"""Calibration of an infrared distance sensor: distance as a function of voltage, fitted at known distances."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...errors import BadInput


@dataclass(frozen=True)
class Calibration:
    """The curve m = a + b/V + c/V² of one sensor, Kriegleder 2012, (31), with a [m], b [m V], c [m V²]."""

    a: float
    b: float
    c: float

    def distance(self, voltage: float) -> float:
        """Distance [m] at a voltage [V].

        Raises:
            BadInput: a voltage that is not above 0.
        """
        if not voltage > 0.0:
            raise BadInput(f"voltage {voltage} V must be above 0 to stand for a distance")
        return self.a + (self.b + self.c / voltage) / voltage

    def voltage(self, distance: float) -> float:
        """Voltage [V] at a distance [m], on the branch where it falls as the distance grows.

        1/V is the root of c u² + b u + (a − m) = 0 at which the curve rises in u, so b + 2 c u > 0.

        Raises:
            BadInput: the curve does not reach this distance on that branch.
        """
        above = distance - self.a
        slope_squared = self.b**2 + 4.0 * self.c * above
        if not slope_squared > 0.0 or not (denominator := self.b + math.sqrt(slope_squared)) * above > 0.0:
            raise BadInput(f"distance {distance} m is not on the calibration curve a={self.a}, b={self.b}, c={self.c}")
        return denominator / (2.0 * above)


def calibrate(voltages: ArrayLike, distances: ArrayLike) -> Calibration:
    """Fit the curve by linear least squares in the distance.

    m_k ≈ a + b/V_k + c/V_k²            Kriegleder 2012, (31)

    Args:
        voltages: averaged readings, shape (K,), at least three different, each > 0 [V].
        distances: the known distances, shape (K,) [m].
    Raises:
        BadInput: other shapes, a voltage that is not above 0, or fewer than three different ones.
    """
    readings = np.asarray(voltages, dtype=np.float64)
    known = np.asarray(distances, dtype=np.float64)
    if readings.ndim != 1 or readings.shape != known.shape:
        raise BadInput(f"voltages have shape {readings.shape}, distances {known.shape}: give one distance a voltage")
    if not (readings > 0.0).all() or len(np.unique(readings)) < 3:
        raise BadInput(f"voltages {readings.tolist()} V must be above 0, and three of them different: add references")
    rows = np.column_stack([np.ones_like(readings), 1.0 / readings, 1.0 / readings**2])
    a, b, c = np.linalg.lstsq(rows, known, rcond=None)[0].tolist()
    return Calibration(a, b, c)
