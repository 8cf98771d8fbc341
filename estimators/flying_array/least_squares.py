"""Least squares over the distances of all modules or of a neighbourhood, and the hand-on where it cannot be solved."""

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
"""Smallest eigenvalue of a scaled information matrix that still gives an estimate.

It lies a hundred times above the noise that float32 messages leave on a singular matrix (about 1e-7), and twenty times
below the smallest one of random arrays of up to 25 modules, at the first round that sees three modules off a line.
"""


def well_conditioned(information: ArrayLike, tolerance: float = WELL_CONDITIONED) -> bool:
    """Whether an information matrix determines the state: its modules are not on one line, and clearly so.

    The matrix is scaled to a unit diagonal, which takes out units, array size and number of modules; the test is that
    its smallest eigenvalue exceeds `tolerance`.

    Args:
        information: CᵀC or P, symmetric, shape (3, 3) [1, m, m²].
        tolerance: bound of the eigenvalue, dimensionless, > 0.
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
    """Least-squares estimate from the distances of a module and those neighbours that it has heard.

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
    """Least-squares estimate from the distances of all modules: the linear optimum that the others are compared to.

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
class HandedEstimate:
    """A state estimate, shape (3,) [m, rad, rad], and how many hops it is from the modules that solved for it."""

    state: NDArray[np.float64]
    hops: int = 0


def hand_on(own: HandedEstimate | None, received: Mapping[str, HandedEstimate]) -> HandedEstimate | None:
    """What a module holds after hearing its neighbours, where it cannot solve by itself.

    It takes the mean of its neighbours nearest to a module that solved, one hop further. It never takes from a
    neighbour that is as far as itself, so that estimates travel outwards only and what is held once everything has
    been heard does not depend on which message came first. Kriegleder 2012, Sec. IV-A.

    Args:
        own: what it holds; hops 0 if it solved by itself, None if it has nothing yet.
        received: neighbour → what that neighbour held.
    Returns:
        What it holds now, `own` if it has heard nothing nearer.
    """
    hops = min((estimate.hops for estimate in received.values()), default=None)
    if hops is None or (own is not None and own.hops <= hops):
        return own
    nearest = [received[name] for name in sorted(received, key=natural_key) if received[name].hops == hops]
    return HandedEstimate(np.mean([estimate.state for estimate in nearest], axis=0), hops + 1)
