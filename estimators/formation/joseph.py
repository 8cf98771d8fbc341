"""Belief about a formation, with the covariance in Joseph form, at a cost of O(N²) per step.

All arrays are in the split order of `model`: A P Aᵀ adds one half of the columns, then of the rows, to the other half,
without products of dense matrices. Arrays are in Fortran order and passed to BLAS and LAPACK directly, which takes half
the time of the same operations in NumPy for 12 rows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import daxpy, dgemm, dtrsm

from .covariance import check_finite, check_positive, factor
from .model import Rows, Step


class _Buffer:
    """A matrix in Fortran order, in which the halves of the columns are contiguous, and views of these."""

    __slots__ = ("blocks", "left", "right", "transposed", "whole")

    def __init__(self, whole: NDArray[np.float64]) -> None:
        self.whole, self.transposed = whole, whole.T
        self.left, self.right = np.split(whole.reshape(-1, order="F"), 2)
        self.blocks = whole.reshape(3 * len(whole), -1, order="F")  # a column for three


class JosephBelief:
    """Belief with the estimate x̂ and the covariance matrix P.

    state: x̂, split order, shape (6n,) [m, m/s].

    Args:
        state: a fresh array.
        covariance: P, symmetric positive definite, split order, shape (6n, 6n), a fresh array.
    """

    def __init__(self, state: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        self.state = state
        self._places, self._speeds = np.split(state, 2)
        first = np.asfortranarray(covariance)
        self._held, self._spare = _Buffer(first), _Buffer(np.empty_like(first))

    @property
    def covariance(self) -> NDArray[np.float64]:
        """P, symmetric, a copy, split order."""
        return (self._held.whole + self._held.whole.T) / 2

    def predict(self, step: Step, inputs: NDArray[np.float64]) -> None:
        """x̂⁺ = A x̂ + B u,  P⁺ = A P Aᵀ + Q            Nägeli 2014, Algorithm 1, lines 1 and 2.

        A adds h times the velocities to the positions: P Aᵀ adds one half of the columns to the other, and A P Aᵀ is
        the transpose of (P Aᵀ)ᵀ Aᵀ.

        Raises:
            BadInput: u is not finite; nothing is changed then.
        """
        check_finite(inputs, "forces of a formation")
        daxpy(self._speeds, self._places, self._places.size, step.duration_s)
        self.state += step.input_map.dot(inputs)
        before, after = self._held, self._spare
        daxpy(before.right, before.left, before.left.size, step.duration_s)
        after.whole[...] = before.transposed
        daxpy(after.right, after.left, after.left.size, step.duration_s)
        after.whole += step.process_noise
        self._held, self._spare = after, before

    def update(self, rows: Rows, values: NDArray[np.float64], noise: NDArray[np.float64]) -> None:
        """Update with a measurement z = H x + noise.

        L = P Hᵀ (H P Hᵀ + R)⁻¹,  x̂⁺ = x̂ + L (z − H x̂),  P⁺ = (I − L H) P (I − L H)ᵀ + L R Lᵀ
        Nägeli 2014, Algorithm 1, lines 3 to 5. P⁺ is computed as Y + L (R Lᵀ − H Y) with Y = P − P Hᵀ Lᵀ, which holds
        for any gain, so that rounding of the gain does no harm; asymmetry of P by rounding decays as the errors of the
        estimate do. H is E ⊗ I₃, so that P Hᵀ needs a third of the products.

        Args:
            rows: H, k rows.
            values: z, shape (k,).
            noise: R, symmetric, shape (k, k).
        Raises:
            BadInput: z is not finite or R not positive definite; nothing is changed then.
        """
        check_finite(values, "an observation")
        check_positive(noise, "covariance of an observation")
        held, size = self._held, len(self.state)
        matrix, whole, chains = held.whole, *rows
        shared = dgemm(1.0, held.blocks, chains).reshape(size, -1, order="F")
        root = factor(dgemm(1.0, whole.T, shared, 1.0, noise, 1))
        gain = dtrsm(1.0, root, dtrsm(1.0, root, shared, 1, 1, 1), 1, 1)
        self.state += gain.dot(values - whole.dot(self.state))
        dgemm(-1.0, shared, gain, 1.0, matrix, 0, 1, 1)
        rest = dgemm(-1.0, whole.T, matrix, 1.0, dgemm(1.0, noise, gain, 0.0, trans_b=1), 1, 0, 1)
        dgemm(1.0, gain, rest, 1.0, matrix, 0, 0, 1)

    def observed(self, rows: Rows) -> NDArray[np.float64]:
        """H P Hᵀ, symmetric, shape (k, k)."""
        covariance = rows.whole @ self._held.whole @ rows.whole.T
        return (covariance + covariance.T) / 2

    def inflate(self, factor: float) -> None:
        """P⁺ = factor · P."""
        self._held.whole *= factor
