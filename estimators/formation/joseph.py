"""Belief about a formation as a covariance matrix, at a cost of O(N²) per step.

Positions and velocities are kept about the first vehicle, so that H P is a difference of rows. BLAS and LAPACK are
called directly, which takes half the time of the same operations in NumPy for three vehicles.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import daxpy, dsyr2k, dsyrk, dtrsm

from .covariance import check_finite, check_positive, factor
from .model import Rows, Step, about_first

_CANCELLED = 1e6
"""Ratio of a prior variance to the noise from which on P⁺ is corrected: up to it 10 of 16 digits are left."""
_BLOCK = 32


class _Both:
    """[P x̂] above a row that is not used, shape (n + 1, n + 1), and views of its parts."""

    __slots__ = ("covariance", "of_places", "of_speeds", "state", "transposed", "triangles", "whole")

    def __init__(self, whole: NDArray[np.float64]) -> None:
        self.whole, self.transposed = whole, whole.T  # the second in Fortran order, as BLAS has it
        self.state, self.covariance = whole[:-1, -1], whole[:-1, :-1]
        self.of_places, self.of_speeds = np.split(whole[:-1].reshape(-1), 2)
        self.triangles = _triangles(self.covariance)

    def mirror(self) -> None:
        """Copy the upper triangle of P to the lower one."""
        for below, above, where in self.triangles:
            np.copyto(below, above, where=where)


class JosephBelief:
    """Belief with the estimate x̂ and the covariance matrix P.

    Both are kept in one matrix, so that a step moves both at once, and so does an update. The update computes the upper
    triangle of P and copies it to the lower one, so that asymmetry by rounding does not grow.

    Args:
        state: x̂, split order, shape (6(N−1),) [m, m/s].
        covariance: P, symmetric positive definite, split order, shape (6(N−1), 6(N−1)).
    """

    def __init__(self, state: NDArray[np.float64], covariance: NDArray[np.float64]) -> None:
        to_first = about_first(len(state) // 6 + 1)
        first = np.zeros((len(to_first) + 1, len(to_first) + 1))
        self._held, self._spare = _Both(first), _Both(np.empty_like(first))
        self._held.state[:] = to_first @ state
        self._held.covariance[:] = to_first @ covariance @ to_first.T
        self._held.mirror()

    @property
    def state(self) -> NDArray[np.float64]:
        """x̂, split order, shape (6(N−1),) [m, m/s]."""
        return _differences(self._held.state)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """P, symmetric, a copy, split order."""
        covariance = _differences(_differences(self._held.covariance).T)
        return (covariance + covariance.T) / 2

    def predict(self, step: Step, inputs: NDArray[np.float64]) -> None:
        """x̂⁺ = A x̂ + B u,  P⁺ = A P Aᵀ + Q            Nägeli 2014, Algorithm 1, lines 1 and 2.

        A adds h times the velocities to the positions: to the rows of [P x̂], and to those of the transpose of A P.

        Raises:
            BadInput: u is not finite; nothing is changed then.
        """
        check_finite(inputs, "forces of a formation")
        before, after, size = self._held, self._spare, self._held.of_places.size
        daxpy(before.of_speeds, before.of_places, size, step.duration_s)
        after.whole[...] = before.transposed
        daxpy(after.of_speeds, after.of_places, size, step.duration_s)
        np.add(before.state, step.input_about_first.dot(inputs), out=after.state)
        after.whole += step.noise_about_first
        self._held, self._spare = after, before

    def update(self, rows: Rows, values: NDArray[np.float64], noise: NDArray[np.float64]) -> None:
        """Update with a measurement z = H x + noise.

        S = H P Hᵀ + R = G Gᵀ,  [W; yᵀ] = [P Hᵀ; (H x̂ − z)ᵀ] G⁻ᵀ,  P⁺ = P − W Wᵀ,  x̂⁺ = x̂ − W y
        Nägeli 2014, Algorithm 1, lines 3 to 5. Where the noise is so small that P − W Wᵀ cancels, it is corrected.

        Args:
            rows: H, k rows.
            values: z, shape (k,).
            noise: R, symmetric, shape (k, k).
        Raises:
            BadInput: z is not finite or R not positive definite; nothing is changed then.
        """
        check_finite(values, "an observation")
        check_positive(noise, "covariance of an observation")
        held = self._held
        shared = _between(held.whole, rows)
        shared[:, -1] -= values
        spread = _between(shared.T, rows)
        spread += noise
        root = factor(spread)
        whitened = dtrsm(1.0, root, shared.T, 1, 1, 1)
        dsyrk(-1.0, whitened, 1.0, held.transposed, 0, 1, 1)
        held.mirror()
        if max(spread.diagonal().tolist()) > _CANCELLED * min(noise.diagonal().tolist()):
            self._correct(rows, noise, dtrsm(1.0, root, whitened, 1, 1))

    def _correct(self, rows: Rows, noise: NDArray[np.float64], gain: NDArray[np.float64]) -> None:
        """Remove the rounding error E of P = P⁺ + E that the measurement can see: P becomes P⁺ + (I − LH) E (I − LH)ᵀ.

        This is the Joseph form of E. As P⁺ Hᵀ = L R, E Hᵀ = −D with D = L R − P Hᵀ, and P − E + (I − LH) E (I − LH)ᵀ =
        P + D'Lᵀ + L D'ᵀ with D' = D − ½ L H D.

        Args:
            rows: H.
            noise: R.
            gain: L, above a row that is not used.
        """
        gain[-1] = 0.0
        error = gain.dot(noise)
        error[:-1] -= _between(self._held.covariance, rows).T
        error -= gain.dot(0.5 * _between(error, rows))
        dsyr2k(1.0, gain, error, 1.0, self._held.transposed, 0, 1, 1)
        self._held.mirror()

    def seen(self, rows: Rows) -> NDArray[np.float64]:
        """H x̂, shape (k,)."""
        return _between(self._held.state, rows)

    def observed(self, rows: Rows) -> NDArray[np.float64]:
        """H P Hᵀ, symmetric, shape (k, k)."""
        covariance = _between(_between(self._held.covariance, rows).T, rows)
        return (covariance + covariance.T) / 2

    def inflate(self, factor: float) -> None:
        """P⁺ = factor · P."""
        self._held.covariance *= factor


def _between(about: NDArray[np.float64], rows: Rows) -> NDArray[np.float64]:
    """H applied to rows about the first vehicle, shape (k, …)."""
    first, second = about.take(rows.ends, 0)
    difference: NDArray[np.float64] = first - second
    return difference


def _differences(about: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows of each vehicle less those of the next, split order, from rows about the first, shape (6N, …)."""
    each = about.reshape(2, -1, 3, *about.shape[1:])
    return (each[:, :-1] - each[:, 1:]).reshape(-1, *about.shape[1:])


_Triangles = list[tuple[NDArray[np.float64], NDArray[np.float64], Any]]
"""Views of the parts of a matrix below the diagonal, of those above, and where the first are to be overwritten."""


def _triangles(matrix: NDArray[np.float64]) -> _Triangles:
    """In blocks that fit into the processor's cache."""
    parts: _Triangles = []
    for start in range(0, len(matrix), _BLOCK):
        end = min(start + _BLOCK, len(matrix))
        block = matrix[start:end, start:end]
        parts.append((block, block.T, np.tri(end - start, k=-1, dtype=bool)))
        if start:
            parts.append((matrix[start:end, :start], matrix[:start, start:end].T, True))
    return parts
