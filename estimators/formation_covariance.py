"""Covariance of a formation's state in Joseph form, by blocks: a step costs O(N²), the number of its entries.

Everything here is in the split order of `formation_model`: H P is then a sum of a few rows of P, and A P Aᵀ adds one
half of the rows and of the columns to the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import dposv, dpotrf

from ..errors import BadInput
from .checks import as_array
from .formation_model import Block, Step, picked


class JosephCovariance:
    """P, kept as a matrix.

    Args:
        matrix: symmetric positive definite, split order, shape (6n, 6n).
    Raises:
        BadInput: wrong shape, not finite, or not positive definite.
    """

    def __init__(self, matrix: ArrayLike) -> None:
        self._matrix = checked_covariance(matrix, None, "covariance of a formation")
        self._spare = np.empty_like(self._matrix)
        half = len(self._matrix) // 2
        self._row_sum = np.empty((half, 2 * half))
        self._column_sum = np.empty((2 * half, half))

    @property
    def matrix(self) -> NDArray[np.float64]:
        """P, symmetric, a copy, split order."""
        return (self._matrix + self._matrix.T) / 2

    def predict(self, step: Step) -> None:
        """P⁺ = A P Aᵀ + Q            Nägeli 2014, Algorithm 1, line 2."""
        matrix, half = self._matrix, len(self._row_sum)
        np.multiply(matrix[half:], step.duration_s, out=self._row_sum)
        matrix[:half] += self._row_sum
        np.multiply(matrix[:, half:], step.duration_s, out=self._column_sum)
        matrix[:, :half] += self._column_sum
        matrix += step.process_noise

    def update(self, chosen: tuple[Block, ...], noise: NDArray[np.float64]) -> NDArray[np.float64]:
        """The gain of a measurement, and the covariance after it.

        L = P Hᵀ (H P Hᵀ + R)⁻¹,  P⁺ = (I − L H) P (I − L H)ᵀ + L R Lᵀ            Nägeli 2014, Algorithm 1, lines 3 and
        5 The second is computed as Y + L (R Lᵀ − H Y) with Y = P − P Hᵀ Lᵀ, and made symmetric: of any gain, not only
        of the optimal one, it is the covariance.

        Args:
            chosen: the rows of H.
            noise: R, symmetric positive definite, shape (k, k).
        Returns:
            Lᵀ, shape (k, 6n).
        """
        matrix, spare = self._matrix, self._spare
        shared = picked(matrix, chosen)
        gain = solved(picked(shared.T, chosen) + noise, shared)
        np.dot(shared.T, gain, out=spare)
        matrix -= spare
        correction = np.dot(noise, gain)
        correction -= picked(matrix, chosen)
        np.dot(gain.T, correction, out=spare)
        matrix += spare
        np.add(matrix, matrix.T, out=spare)
        np.multiply(spare, 0.5, out=matrix)
        return gain

    def observed(self, chosen: tuple[Block, ...]) -> NDArray[np.float64]:
        """H P Hᵀ, symmetric, shape (k, k)."""
        covariance = picked(picked(self._matrix, chosen).T, chosen)
        return (covariance + covariance.T) / 2

    def inflate(self, factor: float) -> None:
        """P⁺ = factor · P."""
        self._matrix *= factor


def solved(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """S⁻¹ B by Cholesky's factor of a symmetric positive definite S.

    Raises:
        BadInput: S is not positive definite, so a covariance was none.
    """
    _, solution, failed = dposv(matrix, right, lower=1)
    if failed:
        raise BadInput(f"a covariance is not positive definite: {matrix.tolist()}: give one that is, in SI units")
    return np.asarray(solution)


def checked_covariance(matrix: ArrayLike, size: int | None, name: str) -> NDArray[np.float64]:
    """A covariance as a fresh array: finite, of this size if it is given, symmetric to rounding and positive definite.

    Raises:
        BadInput: otherwise, with `name`.
    """
    array = as_array(matrix, (size, size), name)
    largest = np.abs(array).max(initial=0.0)
    if array.shape[0] != array.shape[1] or np.abs(array - array.T).max(initial=0.0) > 1e-9 * largest:
        raise BadInput(f"{name} is not symmetric: {array.tolist()}")
    check_positive(array, name)
    return array


def check_positive(matrix: NDArray[np.float64], name: str) -> None:
    """Refuse a symmetric matrix that is not positive definite.

    Raises:
        BadInput: with `name`.
    """
    if not matrix.size or dpotrf(matrix, lower=1)[1]:
        raise BadInput(f"{name} is not positive definite: {matrix.tolist()}: variances are above 0")
