"""Covariance intersection: fusion of two beliefs with unknown correlation.

Julier and Uhlmann 1997, "A non-divergent estimation algorithm in the presence of unknown correlations". Letters: (Ω, q)
information pair of a belief; ω weight of the first, in [0, 1].
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...topologies import natural_key
from ..information import InformationPair, pack_pair, unpack_pair
from .filtering import Filter, Moment, Vector
from .gaussian import Gaussian, added, gaussian, information, scaled

_HALVINGS = 40
"""Steps of the bisection for ω, which is exact to 2⁻⁴⁰."""


def intersection(first: InformationPair, second: InformationPair) -> InformationPair:
    """The convex combination of two beliefs with the smallest determinant of its covariance.

    Ω = ω Ω₁ + (1 − ω) Ω₂,  q likewise            Julier and Uhlmann 1997
    log det Ω is concave in ω. With λ the generalised eigenvalues of (Ω₁, Ω₂) its slope is Σ (λ − 1) / (1 + ω (λ − 1)),
    whose zero is found by bisection; if there is none in (0, 1), the better of the two beliefs is returned.

    Args:
        first: positive definite.
        second: positive definite, of the same size.
    """
    factor = np.linalg.cholesky(second.P)
    half = np.linalg.solve(factor, first.P)
    excess = np.linalg.eigvalsh(np.linalg.solve(factor, half.T)) - 1.0
    omega = _best(excess)
    return added([scaled(first, omega), scaled(second, 1.0 - omega)])


def _best(excess: Vector) -> float:
    if excess.sum() <= 0.0:
        return 0.0
    if (excess / (1.0 + excess)).sum() >= 0.0:
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if (excess / (1.0 + middle * excess)).sum() > 0.0:
            low = middle
        else:
            high = middle
    return (low + high) / 2


class CovarianceIntersection(Filter):
    """Correct with the own measurement, then in each round fuse the beliefs of the neighbours one after the other.

    Julier and Uhlmann 1997; in natural order of the neighbours. A message is a packed pair. Never overconfident,
    whatever is lost, late or duplicated.
    """

    def begin(self, moment: Moment) -> None:
        """Predict and correct."""
        super().begin(moment)
        self._pair = added([information(self.belief), self.measured()])

    def message(self, target: str) -> Vector:
        """The belief as a packed pair."""
        return pack_pair(self._pair)

    def forward(self, message: Vector, samples: int) -> Vector | None:
        """Propagate the old belief."""
        return self.propagated_pair(message, samples)

    def hear(self, received: Mapping[str, Vector]) -> None:
        """Fuse the received beliefs one after the other."""
        for name in sorted(received, key=natural_key):
            self._pair = intersection(self._pair, unpack_pair(received[name]))

    def end(self) -> Gaussian:
        """The fused belief."""
        result = gaussian(self._pair)
        assert result is not None, "a convex combination of positive definite matrices"
        self.belief = result
        return result
