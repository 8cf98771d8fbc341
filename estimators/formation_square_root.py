"""Covariance of a formation's state in square-root form: twice the digits, at a cost of O(N³) per step.

For covariances so wide apart that the Joseph form loses its sign: a radius of kilometres beside one of micrometres.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular

from .formation_covariance import checked_covariance
from .formation_model import Step


class SquareRootCovariance:
    """P = S Sᵀ, kept as its lower triangular root S.

    Args:
        matrix: P, symmetric positive definite, split order, shape (6n, 6n).
    Raises:
        BadInput: wrong shape, not finite, or not positive definite.
    """

    def __init__(self, matrix: ArrayLike) -> None:
        self._root: NDArray[Any] = np.linalg.cholesky(checked_covariance(matrix, None, "covariance of a formation"))

    @property
    def matrix(self) -> NDArray[np.float64]:
        """P, symmetric, split order."""
        product: NDArray[np.float64] = self._root @ self._root.T
        return product

    def predict(self, step: Step) -> None:
        """[S⁺ 0] = [A S, Q^½] Θ with Θ orthogonal            Kaminski, Bryson and Schmidt 1971."""
        half = len(self._root) // 2
        moved = self._root.copy()
        moved[:half] += step.duration_s * self._root[half:]
        self._root = _triangular(np.hstack([moved, step.noise_root]))

    def update(self, rows: NDArray[np.float64], noise: NDArray[np.float64]) -> NDArray[np.float64]:
        """The gain of a measurement, and the covariance after it.

        [[E, 0], [G, S⁺]] = [[R^½, H S], [0, S]] Θ,  L = G E⁻¹            Kaminski, Bryson and Schmidt 1971

        Args:
            rows: H, shape (k, 6n).
            noise: R, symmetric positive definite, shape (k, k).
        Returns:
            Lᵀ, shape (k, 6n).
        """
        count, size = len(noise), len(self._root)
        array = np.zeros((count + size, count + size))
        array[:count, :count] = np.linalg.cholesky(noise)
        array[:count, count:] = rows @ self._root
        array[count:, count:] = self._root
        after = _triangular(array)
        self._root = after[count:, count:]
        gain: NDArray[np.float64] = solve_triangular(
            after[:count, :count], after[count:, :count].T, trans="T", lower=True
        )
        return gain

    def observed(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """H P Hᵀ, symmetric, shape (k, k)."""
        seen = rows @ self._root
        covariance: NDArray[np.float64] = seen @ seen.T
        return covariance

    def inflate(self, factor: float) -> None:
        """P⁺ = factor · P."""
        self._root *= np.sqrt(factor)


def _triangular(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """A lower triangular T with T Tᵀ = M Mᵀ."""
    upper: NDArray[Any] = np.linalg.qr(array.T).R
    return np.ascontiguousarray(upper.T)
