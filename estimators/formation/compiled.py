"""Belief about a formation, with the arithmetic of `joseph` compiled by Numba.

Needs the extra `volery[fast]`. The results agree with those of the default up to rounding but not to the bit, so it is
used only on request (`form: compiled`). The kernels are compiled at their first use, and cached on disk. They are
faster for formations of a few vehicles; for many, BLAS is as fast.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...errors import BadInput
from .covariance import check_finite, check_positive
from .model import Rows, Step

Array = NDArray[np.float64]


class CompiledBelief:
    """Belief with the estimate x̂ and the covariance matrix P.

    state: x̂, split order, shape (6n,) [m, m/s].

    Args:
        state: a fresh array.
        covariance: P, symmetric positive definite, split order, shape (6n, 6n), a fresh array.
    """

    def __init__(self, state: Array, covariance: Array) -> None:
        self.state = state
        self._covariance = np.ascontiguousarray(covariance)

    @property
    def covariance(self) -> Array:
        """P, symmetric, a copy, split order."""
        return (self._covariance + self._covariance.T) / 2

    def predict(self, step: Step, inputs: Array) -> None:
        """x̂⁺ = A x̂ + B u,  P⁺ = A P Aᵀ + Q            Nägeli 2014, Algorithm 1, lines 1 and 2.

        Raises:
            BadInput: u is not finite; nothing is changed then.
        """
        if not _predict(self.state, self._covariance, inputs, step.input_map, step.process_noise, step.duration_s):
            check_finite(inputs, "forces of a formation")

    def update(self, rows: Rows, values: Array, noise: Array) -> None:
        """Update with a measurement z = H x + noise: `JosephBelief.update`, compiled.

        Args:
            rows: H, k rows.
            values: z, shape (k,).
            noise: R, symmetric, shape (k, k).
        Raises:
            BadInput: z is not finite or R not positive definite; nothing is changed then.
        """
        if not _update(self.state, self._covariance, rows.whole, values, noise):
            check_finite(values, "an observation")
            check_positive(noise, "covariance of an observation")
            raise BadInput(f"covariance of a formation is not positive definite: {self._covariance.tolist()}")

    def seen(self, rows: Rows) -> Array:
        """H x̂, shape (k,)."""
        values: Array = rows.whole @ self.state
        return values

    def observed(self, rows: Rows) -> Array:
        """H P Hᵀ, symmetric, shape (k, k)."""
        covariance = rows.whole @ self._covariance @ rows.whole.T
        return (covariance + covariance.T) / 2

    def inflate(self, factor: float) -> None:
        """P⁺ = factor · P, made symmetric: asymmetry by rounding would otherwise grow with every message."""
        self._covariance[...] = (self._covariance + self._covariance.T) * (factor / 2)


@njit(cache=True, error_model="numpy")
def _predict(state, covariance, inputs, input_map, process_noise, seconds):  # type: ignore[no-untyped-def]
    """Predict in place; return False, and change nothing, if a force is not finite."""
    if not _finite(inputs):
        return False
    half = len(state) // 2
    for i in range(half):
        state[i] += seconds * state[half + i]
        for j in range(2 * half):
            covariance[i, j] += seconds * covariance[half + i, j]
    for i in range(2 * half):
        for j in range(len(inputs)):
            state[i] += input_map[i, j] * inputs[j]
        for j in range(half):
            covariance[i, j] += seconds * covariance[i, half + j]
        for j in range(2 * half):
            covariance[i, j] += process_noise[j, i]
    return True


@njit(cache=True, error_model="numpy")
def _update(state, covariance, rows, values, noise):  # type: ignore[no-untyped-def]
    """Update in place, as `JosephBelief.update`; return False, and change nothing, if that is not possible."""
    if not _finite(values) or not _factor(noise.copy()):
        return False
    shared = _product(rows, covariance)
    spread = noise.copy()
    innovation = values.copy()
    for a in range(len(rows)):
        for j in range(len(state)):
            innovation[a] -= rows[a, j] * state[j]
        for b in range(len(rows)):
            for j in range(len(state)):
                spread[a, b] += shared[a, j] * rows[b, j]
    if not _factor(spread):
        return False
    gain = _divided(spread, shared.copy())
    for a in range(len(rows)):
        for j in range(len(state)):
            state[j] += innovation[a] * gain[a, j]
    _add_outer(covariance, gain, shared, -1.0)
    _add_outer(covariance, _product(noise, gain) - _transposed_product(rows, covariance), gain, 1.0)
    return True


@njit(cache=True, error_model="numpy")
def _product(left, right):  # type: ignore[no-untyped-def]
    """A B for a sparse A."""
    result = np.zeros((left.shape[0], right.shape[1]))
    for a in range(left.shape[0]):
        for b in range(left.shape[1]):
            if left[a, b] != 0.0:
                for j in range(right.shape[1]):
                    result[a, j] += left[a, b] * right[b, j]
    return result


@njit(cache=True, error_model="numpy")
def _transposed_product(left, right):  # type: ignore[no-untyped-def]
    """A Bᵀ for a sparse A."""
    result = np.zeros((left.shape[0], right.shape[0]))
    for a in range(left.shape[0]):
        for b in range(left.shape[1]):
            if left[a, b] != 0.0:
                for i in range(right.shape[0]):
                    result[a, i] += left[a, b] * right[i, b]
    return result


@njit(cache=True, error_model="numpy")
def _add_outer(matrix, left, right, factor):  # type: ignore[no-untyped-def]
    """M + factor · AᵀB, in place."""
    for i in range(matrix.shape[0]):
        for a in range(left.shape[0]):
            scaled = factor * left[a, i]
            for j in range(matrix.shape[1]):
                matrix[i, j] += scaled * right[a, j]


@njit(cache=True, error_model="numpy")
def _factor(matrix):  # type: ignore[no-untyped-def]
    """Cholesky factor in the lower triangle, in place; return False if the matrix is not positive definite."""
    for a in range(len(matrix)):
        for b in range(a + 1):
            rest = matrix[a, b]
            for c in range(b):
                rest -= matrix[a, c] * matrix[b, c]
            if a != b:
                matrix[a, b] = rest / matrix[b, b]
            elif rest > 0.0:
                matrix[a, a] = np.sqrt(rest)
            else:
                return False
    return True


@njit(cache=True, error_model="numpy")
def _divided(factor, right):  # type: ignore[no-untyped-def]
    """S⁻¹ B from the Cholesky factor of S, in place of B."""
    for a in range(len(factor)):
        for c in range(a):
            for j in range(right.shape[1]):
                right[a, j] -= factor[a, c] * right[c, j]
        for j in range(right.shape[1]):
            right[a, j] /= factor[a, a]
    for a in range(len(factor) - 1, -1, -1):
        for c in range(a + 1, len(factor)):
            for j in range(right.shape[1]):
                right[a, j] -= factor[c, a] * right[c, j]
        for j in range(right.shape[1]):
            right[a, j] /= factor[a, a]
    return right


@njit(cache=True, error_model="numpy")
def _finite(values):  # type: ignore[no-untyped-def]
    total = 0.0
    for value in values:
        total += value * value
    return np.isfinite(total)
