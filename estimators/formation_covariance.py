"""Covariance of a formation's state in Joseph form, at a cost of O(N²) a step: as many as the matrix has entries.

Everything here is in the split order of `formation_model`: A P Aᵀ adds one half of the columns, then of the rows, to
the other, and never multiplies dense matrices. Arrays are in Fortran's order and handed to BLAS and LAPACK as they
are, which takes half the time of the same operations in NumPy where a matrix has 12 rows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.blas import daxpy, dgemm
from scipy.linalg.lapack import dposv, dpotrf

from ..errors import BadInput
from .checks import as_array
from .formation_model import Step


class _Buffer:
    """A matrix in Fortran's order, where the halves of its columns lie one after the other, and views of them."""

    __slots__ = ("left", "right", "transposed", "whole")

    def __init__(self, whole: NDArray[np.float64]) -> None:
        self.whole, self.transposed = whole, whole.T
        self.left, self.right = np.split(whole.reshape(-1, order="F"), 2)


class JosephCovariance:
    """P, kept as a matrix.

    Args:
        matrix: symmetric positive definite, split order, shape (6n, 6n).
    Raises:
        BadInput: wrong shape, not finite, or not positive definite.
    """

    def __init__(self, matrix: ArrayLike) -> None:
        first = np.asfortranarray(checked_covariance(matrix, None, "covariance of a formation"))
        self._held, self._spare = _Buffer(first), _Buffer(np.empty_like(first))

    @property
    def matrix(self) -> NDArray[np.float64]:
        """P, symmetric, a copy, split order."""
        return (self._held.whole + self._held.whole.T) / 2

    def predict(self, step: Step) -> None:
        """P⁺ = A P Aᵀ + Q            Nägeli 2014, Algorithm 1, line 2.

        A adds h times the velocities to the positions: P Aᵀ adds one half of the columns to the other, and (P Aᵀ)ᵀ Aᵀ,
        after a transposition, is A P Aᵀ.
        """
        before, after = self._held, self._spare
        daxpy(before.right, before.left, before.left.size, step.duration_s)
        after.whole[...] = before.transposed
        daxpy(after.right, after.left, after.left.size, step.duration_s)
        after.whole += step.process_noise
        self._held, self._spare = after, before

    def update(self, rows: NDArray[np.float64], noise: NDArray[np.float64]) -> NDArray[np.float64]:
        """The gain of a measurement, and the covariance after it.

        L = P Hᵀ (H P Hᵀ + R)⁻¹,  P⁺ = (I − L H) P (I − L H)ᵀ + L R Lᵀ            Nägeli 2014, Algorithm 1, 3 and 5
        The second is computed as Y + L (R Lᵀ − H Y) with Y = P − P Hᵀ Lᵀ: of any gain it is the covariance, so that the
        rounding of the gain does no harm.

        Args:
            rows: H, shape (k, 6n).
            noise: R, symmetric positive definite, shape (k, k).
        Returns:
            Lᵀ, shape (k, 6n).
        """
        matrix, columns = self._held.whole, rows.T
        shared = dgemm(1.0, matrix, columns)
        gain = solved(dgemm(1.0, columns, shared, 1.0, noise, 1), shared.T)
        dgemm(-1.0, shared, gain, 1.0, matrix, 0, 0, 1)
        correction = dgemm(-1.0, columns, matrix, 1.0, dgemm(1.0, noise, gain), 1, 0, 1)
        dgemm(1.0, gain, correction, 1.0, matrix, 1, 0, 1)
        return gain

    def observed(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """H P Hᵀ, symmetric, shape (k, k)."""
        covariance = rows @ self._held.whole @ rows.T
        return (covariance + covariance.T) / 2

    def inflate(self, factor: float) -> None:
        """P⁺ = factor · P."""
        self._held.whole *= factor


def solved(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """S⁻¹ B by Cholesky's factor of a symmetric positive definite S, in Fortran's order.

    Raises:
        BadInput: S is not positive definite, so a covariance was none.
    """
    _, solution, failed = dposv(matrix, right, 1)
    if failed:
        raise BadInput(f"a covariance is not positive definite: {matrix.tolist()}: give one that is, in SI units")
    result: NDArray[np.float64] = solution
    return result


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
    if not matrix.size or dpotrf(matrix, 1)[1]:
        raise BadInput(f"{name} is not positive definite: {matrix.tolist()}: variances are above 0")
