"""Checks of covariances, Cholesky factors, and linear systems with a covariance."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import dposv, dpotrf

from ...errors import BadInput
from ..checks import as_array


def factor(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lower Cholesky factor, in Fortran order; the upper triangle of the result is that of the matrix.

    Raises:
        BadInput: the matrix is not positive definite.
    """
    root, failed = dpotrf(matrix, 1, 0)
    if failed:
        raise BadInput(f"a covariance is not positive definite: {matrix.tolist()}: give one that is, in SI units")
    result: NDArray[np.float64] = root
    return result


def solved(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """S⁻¹ B for a symmetric positive definite S, in Fortran order.

    Raises:
        BadInput: S is not positive definite.
    """
    _, solution, failed = dposv(matrix, right, 1)
    if failed:
        raise BadInput(f"a covariance is not positive definite: {matrix.tolist()}: give one that is, in SI units")
    result: NDArray[np.float64] = solution
    return result


def checked_covariance(matrix: ArrayLike, size: int | None, name: str) -> NDArray[np.float64]:
    """A covariance as a fresh array; must be finite, symmetric, positive definite, and of this size if one is given.

    Raises:
        BadInput: it is not; the message gives `name`.
    """
    array = as_array(matrix, (size, size), name)
    largest = np.abs(array).max(initial=0.0)
    if array.shape[0] != array.shape[1] or np.abs(array - array.T).max(initial=0.0) > 1e-9 * largest:
        raise BadInput(f"{name} is not symmetric: {array.tolist()}")
    check_positive(array, name)
    return array


def check_finite(values: NDArray[np.float64], name: str) -> None:
    """Refuse a vector with a number that is not finite, or whose square overflows.

    Raises:
        BadInput: the message gives `name`.
    """
    if not math.isfinite(values.dot(values)):
        raise BadInput(f"{name} holds a number that is not finite: {values.tolist()}")


def check_positive(matrix: NDArray[np.float64], name: str) -> None:
    """Refuse a symmetric matrix that is not positive definite.

    Raises:
        BadInput: the message gives `name`.
    """
    if not matrix.size or dpotrf(matrix, 1)[1]:
        raise BadInput(f"{name} is not positive definite: {matrix.tolist()}: variances are above 0")
