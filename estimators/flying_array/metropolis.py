"""Consensus on information pairs (P, q), from which every module can solve the least-squares problem of all modules.

Letters: c = (1, r_Y, −r_X) row of a module, m distance [m], P = cᵀc and q = cᵀm, or averages of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..information import InformationPair, packed_size
from .least_squares import WELL_CONDITIONED, well_conditioned
from .plane import design_row

PACKED_SIZE = packed_size(3)


def initial_pair(position: ArrayLike, distance: float) -> InformationPair:
    """Information pair of a single module.

    P(0) = cᵀc,  q(0) = cᵀm            Kriegleder 2012, (26)

    Args:
        position: (r_X, r_Y), shape (2,) [m].
        distance: measured distance [m].
    Raises:
        BadInput: wrong shape or not finite.
    """
    row = design_row(position)
    return InformationPair(np.outer(row, row), row * distance)


def estimate(pair: InformationPair, tolerance: float = WELL_CONDITIONED) -> NDArray[np.float64] | None:
    """The state determined by a pair, or None if P is not well conditioned.

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
