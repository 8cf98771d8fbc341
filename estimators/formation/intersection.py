"""Covariance intersection: fusion of observations whose correlation with the estimate is unknown."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .covariance import solved
from .filter import FormationFilter, Observation
from .model import rows

Weighting = Literal["optimal", "fast"]

LEAST_WEIGHT = 1e-3
"""Smallest weight of the own estimate, which must not vanish, as a message may concern only a part of the state."""

_HALVINGS = 20


def intersect(own: FormationFilter, told: Observation, weighting: Weighting = "optimal") -> float:
    """Update a filter with an observation whose error has an unknown correlation with the own one.

    P⁺⁻¹ = ω P⁻¹ + (1 − ω) HᵀN⁻¹H            Julier and Uhlmann 1997
    which is the Kalman update with P/ω and N/(1 − ω). Whatever the correlation, P⁺ is not smaller than the covariance
    of the error, if P and N are not. If H sees only a part of the state, the rest of P grows by the factor 1/ω.

    Args:
        own: the filter, which is changed unless the observation would increase det P.
        told: the observation.
        weighting: `optimal` for the smallest determinant of P⁺, or `fast` for a closed formula.
    Returns:
        ω in (0, 1]; 1 if the observation was not used.
    """
    seen = own.belief.observed(rows(own.model.vehicles, told.pairs, told.velocities))
    weigh = optimal_weight if weighting == "optimal" else fast_weight
    weight = weigh(seen, told.covariance, own.model.size)
    if weight < 1.0:
        own.belief.inflate(1.0 / weight)
        own.update((Observation(told.pairs, told.values, told.covariance / (1.0 - weight)),))
    return weight


def optimal_weight(seen: ArrayLike, told: ArrayLike, size: int) -> float:
    """The ω that minimises det P⁺.

    With λ_i the eigenvalues of N⁻¹HPHᵀ, log det P⁺ − log det P = −(n − k) log ω − Σ_i log(ω + (1 − ω) λ_i), convex in
    ω. The minimum is at ω = 1 if Σ λ_i ≤ n: an observation helps only if the estimate is much less certain than it.

    Args:
        seen: HPHᵀ, the own covariance of the observed quantities, shape (k, k).
        told: N, covariance of the observation, shape (k, k).
        size: n, length of the state.
    Returns:
        ω, to 10⁻⁶, in [LEAST_WEIGHT, 1].
    """
    root = np.linalg.cholesky(np.asarray(told, dtype=np.float64))
    half = np.linalg.solve(root, np.asarray(seen, dtype=np.float64))
    ratios = np.maximum(np.linalg.eigvalsh(np.linalg.solve(root, half.T)), 0.0)

    def slope(weight: float) -> float:
        return float(-(size - len(ratios)) / weight - ((1.0 - ratios) / (weight + (1.0 - weight) * ratios)).sum())

    if slope(1.0) <= 0.0:
        return 1.0
    low, high = LEAST_WEIGHT, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if slope(middle) > 0.0 else (middle, high)
    return low


def fast_weight(seen: NDArray[np.float64], told: NDArray[np.float64], size: int) -> float:
    """The ω that is optimal if the observation is better by the same factor in every direction.

    ω = (n − k) λ̄ / (n (λ̄ − 1)) with λ̄ = tr(N⁻¹HPHᵀ)/k, and 1 if that is above 1.

    Arguments and result as for `optimal_weight`.
    """
    count = len(seen)
    mean = float(np.trace(solved(told, seen))) / count
    if count * mean <= size:
        return 1.0
    return max(LEAST_WEIGHT, (size - count) * mean / (size * (mean - 1.0)))
