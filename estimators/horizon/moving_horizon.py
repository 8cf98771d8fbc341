"""Moving horizon estimation of an error-state model: at every point, the window of the last n steps is solved again.

Measurements belong to points of a uniform time grid. They may arrive late, as long as their point is in the window, or
be missing. Letters as in `error_state`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from .error_state import Inputs, Model, completed, covariance, predicted, step_deviations, updated
from .quadratic_programs import Solver
from .windows import Window, smooth

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Estimated:
    """Estimate for the newest point of a window.

    state (S,); covariance (N, N) of its error, ignoring bounds; disturbances (n, M) of the window's steps; bounded:
    whether a bound was active, so that the quadratic program was solved.
    """

    state: Floats
    covariance: Floats
    disturbances: Floats
    bounded: bool


class MovingHorizon:
    """Moving horizon estimation: Bassolillo 2025, (24)–(29), with the errata.

    The model is linearised about the result of the last point, with the newest state predicted; each point takes one
    Gauss-Newton step. The prior of the window's first point, the arrival cost, comes from the extended Kalman filter:
    when a point leaves the window, the filter uses all measurements of this point, late ones included, and predicts the
    next.

    Args:
        model: the error-state model.
        horizon: n, the number of steps in a full window, at least 1.
        state: (S,) at the first point, before its measurements.
        error_covariance: (N, N) of its error.
        solver: of the quadratic program.
    Raises:
        BadInput: a horizon below 1, or an invalid covariance.
    """

    def __init__(
        self, model: Model, horizon: int, state: Floats, error_covariance: Floats, solver: Solver = "daqp"
    ) -> None:
        if horizon < 1:
            raise BadInput(f"horizon is {horizon}, a window has at least 1 step")
        self._model = model
        self._horizon = horizon
        self._solver: Solver = solver
        self._prior = state.copy()
        self._covariance = covariance(error_covariance, len(model.noise.lower))
        self._first = 0
        self._before = model.resting.copy()
        self._states = state[np.newaxis].copy()
        self._disturbances = np.empty((0, len(model.noise.disturbances)))
        self._inputs = _nothing(len(model.resting))
        self._measured = _nothing(len(model.noise.measurements))

    @property
    def first(self) -> int:
        """The oldest point of the window; measurements of earlier ones are too late."""
        return self._first

    @property
    def newest(self) -> int:
        """The newest point of the window."""
        return self._first + len(self._states) - 1

    def take_inputs(self, point: int, where: slice, values: Floats) -> None:
        """Store inputs that were measured at a point of the window."""
        self._inputs[point - self._first, where] = values

    def take(self, point: int, where: slice, values: Floats) -> None:
        """Store values that were measured at a point of the window."""
        self._measured[point - self._first, where] = values

    def advance(self, inputs: Floats, measured: Floats) -> None:
        """Add the next point with its measurements so far; the oldest point leaves a full window.

        Args:
            inputs: (U,), NaN for missing ones.
            measured: (R,), NaN for missing ones.
        """
        if len(self._states) > self._horizon:
            self._leave()
        self._inputs = np.concatenate([self._inputs, inputs[np.newaxis]])
        self._measured = np.concatenate([self._measured, measured[np.newaxis]])
        undisturbed = np.zeros((1, self._disturbances.shape[1]))
        step = completed(self._inputs, self._before).of_steps[-1:]
        following, _, _ = self._model.dynamics(self._states[-1:], step, undisturbed)
        self._states = np.concatenate([self._states, following])
        self._disturbances = np.concatenate([self._disturbances, undisturbed])

    def estimate(self) -> Estimated:
        """Solve the present window.

        Raises:
            RunFailed: the quadratic program has no solution.
        """
        smoothed = smooth(self.window(), self._solver)
        self._states = self._model.retract(self._states, smoothed.errors)
        self._disturbances = smoothed.disturbances
        return Estimated(self._states[-1].copy(), smoothed.covariance, smoothed.disturbances, smoothed.bounded)

    def save(self) -> list[Any]:
        """The whole state of the estimator, as plain values."""
        arrays = (self._prior, self._covariance, self._before)
        tables = (self._states, self._inputs, self._measured, self._disturbances)
        return [self._first, [array.tolist() for array in arrays], [table.tolist() for table in tables]]

    def restore(self, saved: Sequence[Any]) -> None:
        """Restore the state returned by `save`."""
        self._first, arrays, tables = saved
        self._prior, self._covariance, self._before = (np.array(array) for array in arrays)
        self._states, self._inputs, self._measured = (np.array(table) for table in tables[:3])
        self._disturbances = np.array(tables[3]).reshape(-1, self._disturbances.shape[1])

    def window(self) -> Window:
        """The present window, linearised about its reference."""
        model, noise = self._model, self._model.noise
        inputs = completed(self._inputs, self._before)
        following, A, B = model.dynamics(self._states[:-1], inputs.of_steps, self._disturbances)
        expected, C = model.outputs(self._states, inputs.at_points)
        deviations, bounds = step_deviations(noise, inputs.measured)
        missing = np.isnan(self._measured)
        present = model.components(self._states)
        off = model.difference(np.concatenate([self._prior[np.newaxis], following]), self._states)
        return Window(
            A=A,
            B=B,
            defects=off[1:],
            C=C,
            residuals=np.where(missing, 0.0, self._measured - expected),
            weights=np.where(missing, 0.0, 1.0 / noise.measurements),
            mean=off[0],
            factor=np.asarray(np.linalg.cholesky(self._covariance), dtype=np.float64),
            reference=self._disturbances,
            deviations=deviations,
            bounds=bounds,
            lower=noise.lower - present,
            upper=noise.upper - present,
        )

    def _leave(self) -> None:
        """Remove the oldest point: the filter uses its measurements, and predicts the next point."""
        model, noise = self._model, self._model.noise
        inputs: Inputs = completed(self._inputs, self._before)
        reference, w = self._states[:1], self._disturbances[:1]
        expected, C = model.outputs(reference, inputs.at_points[:1])
        error = model.difference(self._prior[np.newaxis], reference)[0]
        error, P = updated(error, self._covariance, C[0], self._measured[0] - expected[0], noise.measurements)
        following, A, B = model.dynamics(reference, inputs.of_steps[:1], w)
        deviations, _ = step_deviations(noise, inputs.measured[:1])
        error = A[0] @ error - B[0] @ w[0] + model.difference(following, self._states[1:2])[0]
        self._covariance = predicted(P, A[0], B[0], deviations[0])
        self._prior = model.retract(self._states[1:2], error[np.newaxis])[0]
        self._before = inputs.at_points[1].copy()
        self._first += 1
        self._states, self._disturbances = self._states[1:], self._disturbances[1:]
        self._inputs, self._measured = self._inputs[1:], self._measured[1:]


def _nothing(size: int) -> Floats:
    return np.full((1, size), np.nan)
