"""Moving horizon estimator and Kalman filter of one configuration, fed by sensor name and point of a time grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...estimators.horizon.error_state_kalman import ErrorStateKalman
from ...estimators.horizon.moving_horizon import Estimated, MovingHorizon
from .mhe_settings import PLACES, Configuration, MheParameters

Floats = NDArray[np.float64]
IN_TIME, LATE, TOO_LATE = "in time", "late", "too late"


@dataclass(frozen=True)
class Pair:
    """Estimates of one point: the window, and the state (S,) of the filter."""

    window: Estimated
    filtered: Floats


class Track:
    """Estimators of one configuration, starting at a point.

    The window takes late samples as long as their point is in it; the filter takes those that have arrived when their
    point is estimated.
    """

    def __init__(self, parameters: MheParameters, configuration: Configuration, first: int) -> None:
        model = parameters.model(configuration)
        state, covariance = parameters.start(configuration, lost=first > 0)
        self._places = PLACES[configuration]
        self._first = first
        self._window = MovingHorizon(model, parameters.horizon, state, covariance, parameters.solver)
        self._filter = ErrorStateKalman(model, state, covariance)
        self._sizes = len(model.resting), len(model.noise.measurements)
        self._waiting: dict[int, list[tuple[str, Floats]]] = {}
        self._estimated = first - 1

    def put(self, sensor: str, point: int, values: Floats) -> str | None:
        """Add a sample of a point; whether it was in time, late or too late, None where the model does not use it."""
        if sensor not in self._places:
            return None
        if point > self._estimated:
            self._waiting.setdefault(point, []).append((sensor, values))
            return IN_TIME
        if point < self._first + self._window.first:
            return TOO_LATE
        is_input, where = self._places[sensor]
        take = self._window.take_inputs if is_input else self._window.take
        take(point - self._first, where, values)
        return LATE

    def estimate(self, point: int) -> Pair:
        """Advance to a point, with the samples so far, and estimate it."""
        while self._estimated < point:
            self._advance()
        return Pair(self._window.estimate(), self._filter.state)

    def _advance(self) -> None:
        self._estimated += 1
        inputs, measured = (np.full(size, np.nan) for size in self._sizes)
        for sensor, values in self._waiting.pop(self._estimated, ()):
            is_input, where = self._places[sensor]
            (inputs if is_input else measured)[where] = values
        if self._estimated == self._first:
            self._window.take_inputs(0, slice(None), inputs)
            self._window.take(0, slice(None), measured)
            self._filter.begin(inputs)
        else:
            self._window.advance(inputs, measured)
            self._filter.predict(inputs)
        self._filter.update(measured)

    def save(self) -> list[Any]:
        """Window and filter as plain values; samples of points that are still to come are not kept."""
        return [self._first, self._estimated, self._window.save(), self._filter.save()]

    def restore(self, saved: Sequence[Any]) -> None:
        """Restore what `save` gave; the points in between have no samples."""
        self._first, self._estimated, window, filtered = saved
        self._window.restore(window)
        self._filter.restore(filtered)


def widths(sensors: Sequence[str]) -> list[int]:
    """Number of values in a sample of each sensor."""
    return [where.stop - where.start for _, where in (PLACES["A"][sensor] for sensor in sensors)]
