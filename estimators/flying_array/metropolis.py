"""Consensus on information pairs (P, q), with which every module can solve the least squares of all.

Letters: c = (1, r_Y, −r_X) row of a module, m distance [m], P = cᵀc and q = cᵀm, or averages of them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..averages.averaging import weighted_average
from ..information import InformationPair, pack_pair, packed_size, unpack_pair
from .least_squares import WELL_CONDITIONED, well_conditioned
from .plane import design_row

PACKED_SIZE = packed_size(3)


def initial_pair(position: ArrayLike, distance: float) -> InformationPair:
    """What one module knows by itself.

    P(0) = cᵀc,  q(0) = cᵀm            Kriegleder 2012, (26)

    Args:
        position: (r_X, r_Y), shape (2,) [m].
        distance: measured there [m].
    Raises:
        BadInput: wrong shape or not finite.
    """
    row = design_row(position)
    return InformationPair(np.outer(row, row), row * distance)


def estimate(pair: InformationPair, tolerance: float = WELL_CONDITIONED) -> NDArray[np.float64] | None:
    """The state that a pair tells, or None where P is not well conditioned.

    x̂ = P⁻¹ q            Kriegleder 2012, (21), (30)

    Args:
        pair: P and q averaged over the same modules with the same weights.
        tolerance: as in `well_conditioned`.
    Returns:
        (z, γ, β), shape (3,) [m, rad, rad]; these are also the coefficients that `exact_state` takes.
    """
    if not well_conditioned(pair.P, tolerance):
        return None
    return np.asarray(np.linalg.solve(pair.P, pair.q), dtype=np.float64)


def metropolis_round(
    own: InformationPair, received: Mapping[str, InformationPair], weights: Mapping[str, float]
) -> InformationPair:
    """One round of weighted averaging of information pairs with the neighbours that were heard.

    P⁺ = w_ii P + Σ_j w_ij P_j,  q⁺ likewise            Kriegleder 2012, (24)-(25)

    Args:
        own: the own pair.
        received: neighbour → its pair of this round.
        weights: neighbour → w_ij, dimensionless, ≥ 0, sum ≤ 1.
    Returns:
        The new pair; arguments are untouched.
    Raises:
        BadInput: a neighbour without a weight, a negative weight, or a sum of weights above one.
    """
    vectors = {name: pack_pair(pair) for name, pair in received.items()}
    return unpack_pair(weighted_average(pack_pair(own), vectors, weights))
