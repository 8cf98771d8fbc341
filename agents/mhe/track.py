"""One configuration's moving horizon and the filter beside it, fed by sensors' names and points of a grid in time."""

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
    """What both say of one point: the window, and the state (S,) of the filter."""

    window: Estimated
    filtered: Floats


class Track:
    """The estimators of one configuration from a first point on.

    The window takes what comes late as long as its point is in it; the filter takes a point's samples once, when the
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
        """Write down a sample of a point: in time, late or too late; None where there is no use for it."""
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
        """Go on to a point, with what there is of it and of those before it, and estimate."""
        while self._estimated < point:
            self._go_on()
        return Pair(self._window.estimate(), self._filter.state)

    def _go_on(self) -> None:
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
        """Go on from what `save` gave; the points in between have no samples."""
        self._first, self._estimated, window, filtered = saved
        self._window.restore(window)
        self._filter.restore(filtered)


def widths(sensors: Sequence[str]) -> list[int]:
    """How many values a sample of each sensor has."""
    return [where.stop - where.start for _, where in (PLACES["A"][sensor] for sensor in sensors)]
