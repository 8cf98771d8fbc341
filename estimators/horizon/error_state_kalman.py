"""The extended Kalman filter on an error state: each sample as it comes, and never again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .error_state import Model, completed, covariance, predicted, step_deviations, updated

Floats = NDArray[np.float64]


class ErrorStateKalman:
    """A multiplicative extended Kalman filter: errors are small, states are put right after each update.

    state (S,) and covariance (N, N) are those after the last update.

    Args:
        model: on a grid in time.
        state: (S,) at the first point, before its measurements.
        error_covariance: (N, N) of its error.
    Raises:
        BadInput: a covariance that is not one.
    """

    def __init__(self, model: Model, state: Floats, error_covariance: Floats) -> None:
        self._model = model
        self.state = state.copy()
        self.covariance = covariance(error_covariance, len(model.noise.lower))
        self._inputs = model.resting.copy()
        self._measured = np.full(len(model.resting), np.nan)

    def predict(self, inputs: Floats) -> None:
        """Go on to the next point, where these inputs (U,) are measured, NaN where they are not."""
        noise = self._model.noise
        over = completed(np.array([self._measured, inputs]), self._inputs)
        deviations, _ = step_deviations(noise, over.measured)
        undisturbed = np.zeros((1, len(noise.disturbances)))
        following, A, B = self._model.dynamics(self.state[np.newaxis], over.of_steps, undisturbed)
        self.state, self.covariance = following[0], predicted(self.covariance, A[0], B[0], deviations[0])
        self._inputs, self._measured = over.at_points[1], inputs.copy()

    def begin(self, inputs: Floats) -> None:
        """Take the inputs (U,) that are measured at the first point, NaN where they are not."""
        self._measured = inputs.copy()
        self._inputs = np.where(np.isnan(inputs), self._inputs, inputs)

    def update(self, measured: Floats) -> None:
        """Take what is measured at this point (R,), NaN where nothing is."""
        expected, C = self._model.outputs(self.state[np.newaxis], self._inputs[np.newaxis])
        still = np.zeros(len(self.covariance))
        error, self.covariance = updated(
            still, self.covariance, C[0], measured - expected[0], self._model.noise.measurements
        )
        self.state = self._model.retract(self.state[np.newaxis], error[np.newaxis])[0]

    def save(self) -> list[Any]:
        """All that it has, as plain values."""
        return [array.tolist() for array in (self.state, self.covariance, self._inputs, self._measured)]

    def restore(self, saved: Sequence[Any]) -> None:
        """Go on from what `save` gave."""
        self.state, self.covariance, self._inputs, self._measured = (np.array(array) for array in saved)
