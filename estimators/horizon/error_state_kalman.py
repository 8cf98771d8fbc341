"""The error-state extended Kalman filter: each sample is used once, when it arrives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .error_state import Model, completed, covariance, predicted, step_deviations, updated

Floats = NDArray[np.float64]


class ErrorStateKalman:
    """A multiplicative extended Kalman filter: the error is estimated, and the state corrected after each update.

    state (S,) and covariance (N, N) are those after the last update.

    Args:
        model: the error-state model.
        state: (S,) at the first point, before its measurements.
        error_covariance: (N, N) of its error.
    Raises:
        BadInput: an invalid covariance.
    """

    def __init__(self, model: Model, state: Floats, error_covariance: Floats) -> None:
        self._model = model
        self.state = state.copy()
        self.covariance = covariance(error_covariance, len(model.noise.lower))
        self._inputs = model.resting.copy()
        self._measured = np.full(len(model.resting), np.nan)

    def predict(self, inputs: Floats) -> None:
        """Predict to the next point, where these inputs (U,) are measured; NaN for missing ones."""
        noise = self._model.noise
        over = completed(np.array([self._measured, inputs]), self._inputs)
        deviations, _ = step_deviations(noise, over.measured)
        undisturbed = np.zeros((1, len(noise.disturbances)))
        following, A, B = self._model.dynamics(self.state[np.newaxis], over.of_steps, undisturbed)
        self.state, self.covariance = following[0], predicted(self.covariance, A[0], B[0], deviations[0])
        self._inputs, self._measured = over.at_points[1], inputs.copy()

    def begin(self, inputs: Floats) -> None:
        """Set the inputs (U,) that are measured at the first point; NaN for missing ones."""
        self._measured = inputs.copy()
        self._inputs = np.where(np.isnan(inputs), self._inputs, inputs)

    def update(self, measured: Floats) -> None:
        """Update with the values (R,) measured at this point; NaN for missing ones."""
        expected, C = self._model.outputs(self.state[np.newaxis], self._inputs[np.newaxis])
        still = np.zeros(len(self.covariance))
        error, self.covariance = updated(
            still, self.covariance, C[0], measured - expected[0], self._model.noise.measurements
        )
        self.state = self._model.retract(self.state[np.newaxis], error[np.newaxis])[0]

    def save(self) -> list[Any]:
        """The whole state of the filter, as plain values."""
        return [array.tolist() for array in (self.state, self.covariance, self._inputs, self._measured)]

    def restore(self, saved: Sequence[Any]) -> None:
        """Restore the state returned by `save`."""
        self.state, self.covariance, self._inputs, self._measured = (np.array(array) for array in saved)
