"""Belief about a formation in square-root form: twice the digits, at a cost of O(N³) per step.

For covariances whose entries differ too much for a matrix, such as kilometres and micrometres in one formation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from .covariance import check_finite, check_positive
from .model import Rows, Step


class SquareRootBelief:
    """Belief with the estimate x̂ and the lower triangular root S of P = S Sᵀ.

    state: x̂, split order, shape (6n,) [m, m/s].

    Args:
        state: a fresh array.
        covariance: P, symmetric positive definite, split order, shape (6n, 6n).
    """

    def __init__(self, state: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        self.state = state
        self._root: NDArray[Any] = np.linalg.cholesky(covariance)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """P, symmetric, split order."""
        product: NDArray[np.float64] = self._root @ self._root.T
        return product

    def predict(self, step: Step, inputs: NDArray[np.float64]) -> None:
        """x̂⁺ = A x̂ + B u,  [S⁺ 0] = [A S, Q^½] Θ with Θ orthogonal            Kaminski, Bryson and Schmidt 1971.

        Raises:
            BadInput: u is not finite; nothing is changed then.
        """
        check_finite(inputs, "forces of a formation")
        half = len(self.state) // 2
        self.state[:half] += step.duration_s * self.state[half:]
        self.state += step.input_map.dot(inputs)
        moved = self._root.copy()
        moved[:half] += step.duration_s * self._root[half:]
        self._root = _triangular(np.hstack([moved, step.noise_root]))

    def update(self, rows: Rows, values: NDArray[np.float64], noise: NDArray[np.float64]) -> None:
        """Update with a measurement z = H x + noise.

        [[E, 0], [G, S⁺]] = [[R^½, H S], [0, S]] Θ,  x̂⁺ = x̂ + G E⁻¹ (z − H x̂)            Kaminski, Bryson, Schmidt 1971

        Args:
            rows: H, k rows.
            values: z, shape (k,).
            noise: R, symmetric, shape (k, k).
        Raises:
            BadInput: z is not finite or R not positive definite; nothing is changed then.
        """
        check_finite(values, "an observation")
        check_positive(noise, "covariance of an observation")
        count, size = len(noise), len(self._root)
        array = np.zeros((count + size, count + size))
        array[:count, :count] = np.linalg.cholesky(noise)
        array[:count, count:] = rows.whole @ self._root
        array[count:, count:] = self._root
        after = _triangular(array)
        innovation = solve_triangular(after[:count, :count], values - rows.whole.dot(self.state), lower=True)
        self.state += after[count:, :count].dot(innovation)
        self._root = after[count:, count:]

    def seen(self, rows: Rows) -> NDArray[np.float64]:
        """H x̂, shape (k,)."""
        values: NDArray[np.float64] = rows.whole @ self.state
        return values

    def observed(self, rows: Rows) -> NDArray[np.float64]:
        """H P Hᵀ, symmetric, shape (k, k)."""
        seen = rows.whole @ self._root
        covariance: NDArray[np.float64] = seen @ seen.T
        return covariance

    def inflate(self, factor: float) -> None:
        """P⁺ = factor · P."""
        self._root *= np.sqrt(factor)


def _triangular(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lower triangular T with T Tᵀ = M Mᵀ."""
    upper: NDArray[Any] = np.linalg.qr(array.T).R
    return np.ascontiguousarray(upper.T)
