"""Least squares with the distances of all modules or of a neighbourhood, and forwarded estimates elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import BadInput
from ...topologies import natural_key
from ..checks import as_array
from .plane import design_matrix

WELL_CONDITIONED = 1e-5
"""Smallest eigenvalue of a scaled information matrix for which an estimate is computed.

It is a hundred times the rounding error that float32 messages leave on a singular matrix (about 1e-7), and a twentieth
of the smallest one of random arrays of up to 25 modules, in the first round with three modules that are not on a line.
"""


def well_conditioned(information: ArrayLike, tolerance: float = WELL_CONDITIONED) -> bool:
    """Whether an information matrix determines the state, as it does if its modules are clearly not on one line.

    The matrix is scaled to a unit diagonal, which removes units, array size and number of modules; its smallest
    eigenvalue must then exceed `tolerance`.

    Args:
        information: CᵀC or P, symmetric, shape (3, 3) [1, m, m²].
        tolerance: lower bound of the eigenvalue, dimensionless, > 0.
    Raises:
        BadInput: wrong shape or not finite.
    """
    matrix = as_array(information, (3, 3), "information")
    diagonal = matrix.diagonal()
    if (diagonal <= 0.0).any():
        return False
    scale = np.sqrt(diagonal)
    smallest: float = np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0]
    return bool(smallest > tolerance)


def noncollinear(positions: ArrayLike) -> bool:
    """Whether modules at these positions, shape (N, 2) [m], determine altitude, roll and pitch.

    Raises:
        BadInput: wrong shape or not finite.
    """
    rows = design_matrix(positions)
    return well_conditioned(rows.T @ rows)


def neighbourhood_estimate(positions: ArrayLike, distances: ArrayLike) -> NDArray[np.float64] | None:
    """Least-squares estimate from the distances of a module and of the neighbours that sent theirs.

    x̂_i = (C_iᵀC_i)⁻¹ C_iᵀ ŷ_i            Kriegleder 2012, (16)-(17) with (12)

    Args:
        positions: of the module and its neighbours, shape (n, 2) [m].
        distances: measured there, shape (n,) [m].
    Returns:
        (z, γ, β), shape (3,) [m, rad, rad], or None where the modules are on one line.
    Raises:
        BadInput: wrong shape or not finite.
    """
    rows = design_matrix(positions)
    measured = as_array(distances, (len(rows),), "distances")
    if not well_conditioned(rows.T @ rows):
        return None
    return np.asarray(np.linalg.lstsq(rows, measured, rcond=None)[0], dtype=np.float64)


def centralised_estimate(positions: ArrayLike, distances: ArrayLike) -> NDArray[np.float64]:
    """Least-squares estimate from the distances of all modules: the linear optimum, the reference of the others.

    x̂ = (CᵀC)⁻¹ Cᵀ ŷ            Kriegleder 2012, (12)

    Args:
        positions: shape (N, 2) [m].
        distances: shape (N,) [m].
    Returns:
        (z, γ, β), shape (3,) [m, rad, rad].
    Raises:
        BadInput: the modules are on one line; wrong shape or not finite.
    """
    estimate = neighbourhood_estimate(positions, distances)
    if estimate is None:
        raise BadInput(_on_one_line(len(design_matrix(positions))))
    return estimate


def covariance(positions: ArrayLike, noise: float) -> NDArray[np.float64]:
    """Covariance of the least-squares estimate from modules at these positions.

    Q = (CᵀC)⁻¹ σ²            Kriegleder 2012, (14), for a neighbourhood (17)

    Args:
        positions: of all modules or of a neighbourhood, shape (N, 2) [m].
        noise: standard deviation σ of one distance [m].
    Returns:
        Q, shape (3, 3), symmetric positive definite [m, rad, rad squared].
    Raises:
        BadInput: the modules are on one line; wrong shape or not finite.
    """
    rows = design_matrix(positions)
    if not well_conditioned(rows.T @ rows):
        raise BadInput(_on_one_line(len(rows)))
    half = noise * np.linalg.solve(np.linalg.qr(rows, mode="r"), np.eye(3))
    return half @ half.T


def _on_one_line(count: int) -> str:
    return f"{count} modules on one line cannot tell altitude, roll and pitch apart: add a module off the line"


@dataclass(frozen=True, eq=False)
class ForwardedEstimate:
    """A state estimate, shape (3,) [m, rad, rad], and its number of hops from a module that computed it."""

    state: NDArray[np.float64]
    hops: int = 0


def forwarded_estimate(
    own: ForwardedEstimate | None, received: Mapping[str, ForwardedEstimate]
) -> ForwardedEstimate | None:
    """Estimate of a module that cannot compute one itself, from those of its neighbours.

    The mean of the estimates with the fewest hops, one hop further. A module ignores neighbours that have as many hops
    as itself, so that estimates travel only outwards and the final result does not depend on the order of messages.
    Kriegleder 2012, Sec. IV-A.

    Args:
        own: the present estimate; 0 hops if the module computed it itself, None if there is none yet.
        received: neighbour → its estimate.
    Returns:
        The new estimate; `own` if no neighbour has fewer hops.
    """
    hops = min((estimate.hops for estimate in received.values()), default=None)
    if hops is None or (own is not None and own.hops <= hops):
        return own
    nearest = [received[name] for name in sorted(received, key=natural_key) if received[name].hops == hops]
    return ForwardedEstimate(np.mean([estimate.state for estimate in nearest], axis=0), hops + 1)
