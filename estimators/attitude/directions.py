"""Attitude from directions known in two frames: the linear constraint, sequential projection, and least squares.

Letters: Q attitude quaternion, b a direction in the frame whose attitude is sought, r the same one in the inertial
frame, H observation matrix, φ one of its rows, α damping, γ relaxation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import BadInput
from ...rotations import unit
from ..checks import as_array

Floats = NDArray[np.float64]
_DETERMINED = 1e-6
"""Least gap between the two smallest eigenvalues of HᵀH, per direction, for which the attitude is determined.

For two exact directions the gap is the square of the angle between them, if that is small: it must be 1 mrad.
"""


def observation_matrix(observed: ArrayLike, references: ArrayLike) -> Floats:
    """The matrix H of the constraint H Q = 0 on the attitude of a frame in which directions were observed.

    Four rows per direction: [0, −(b − r)ᵀ; b − r, −skew(b + r)]            Betanzos 2024, (14), (16)

    Without noise its rank is 2 for one direction and 3 for two that are not parallel.

    Args:
        observed: b, shape (m, 3).
        references: r, shape (m, 3).
    Returns:
        H, shape (4 m, 4).
    Raises:
        BadInput: wrong shape or not finite.
    """
    b = as_array(observed, (None, 3), "observed directions")
    r = as_array(references, (len(b), 3), "reference directions")
    rows = [_rows(*pair) for pair in zip(b.tolist(), r.tolist(), strict=True)]
    return np.array(rows, dtype=np.float64).reshape(4 * len(b), 4)


def learned_quaternion(
    prior: Floats,
    observed: Sequence[Floats],
    references: Sequence[Floats],
    alpha: float = 0.2,
    gamma: float = 1.0,
) -> Floats:
    """Project the prior onto each constraint in turn, and normalise it (learning quaternion sequence, LQS).

    Q ← Q − γ φ (φᵀQ) / (α + φᵀφ) for each row φ of H, then Q / ‖Q‖            Betanzos 2024, (18)–(19)

    The larger α, the smaller the correction by one sample. α > 0 also avoids division by zero for rows that vanish, as
    b − r nearly does near the identity. Components that no direction determines are kept from the prior.

    Args:
        prior: unit quaternion, (4,).
        observed: directions b, (3,) each, of norm about 1.
        references: directions r, (3,) each, of norm 1.
        alpha: α ≥ 0.
        gamma: γ, above 0 and below 2.
    Returns:
        Unit quaternion, (4,), with the sign of the prior.
    Raises:
        BadInput: α or γ out of bounds, α = 0 with a zero row or without directions, a prior that is not of norm 1,
            different numbers of observed and reference directions, or a result of norm 0.
    """
    if not 0.0 <= alpha < math.inf or not 0.0 < gamma < 2.0:
        raise BadInput(f"alpha is {alpha:g} and gamma {gamma:g}: give alpha at least 0 and gamma between 0 and 2")
    if len(observed) != len(references):
        raise BadInput(f"{len(observed)} observed and {len(references)} reference directions: give one for each")
    if alpha == 0.0 and not observed:
        raise BadInput("alpha is 0 and there is no direction to learn from: give an alpha above 0, or a direction")
    q = tuple(unit(prior, "the prior").tolist())
    for b, r in zip(observed, references, strict=True):
        q = _projected(q, b.tolist(), r.tolist(), alpha, gamma)
    w, x, y, z = q
    norm = math.hypot(w, x, y, z)
    if not 0.0 < norm < math.inf:
        raise BadInput(f"the directions leave nothing of the prior (norm {norm:g}): give another one, or alpha above 0")
    return np.array((w / norm, x / norm, y / norm, z / norm))


def least_squares_attitude(observed: ArrayLike, references: ArrayLike) -> Floats | None:
    """The attitude that fits all directions best in the least-squares sense, without a prior.

    The unit Q that minimises ‖H Q‖², the eigenvector of HᵀH with the smallest eigenvalue. For unit directions ‖H Q‖² is
    the cost of Wahba's problem, so that this is Davenport's solution of it.

    Args:
        observed: b, shape (m, 3).
        references: r, shape (m, 3).
    Returns:
        Unit quaternion, (4,), scalar part ≥ 0; None if the directions, such as parallel ones, do not determine it.
    Raises:
        BadInput: wrong shape or not finite.
    """
    H = observation_matrix(observed, references)
    values, vectors = np.linalg.eigh(H.T @ H)
    if not values[1] - values[0] > _DETERMINED * (len(H) // 4):
        return None
    best: Floats = vectors[:, 0].copy()
    return -best if best[0] < 0.0 else best


def _rows(b: Sequence[float], r: Sequence[float]) -> tuple[tuple[float, float, float, float], ...]:
    """The four rows of H of one direction."""
    x, y, z = b[0] - r[0], b[1] - r[1], b[2] - r[2]
    u, v, w = b[0] + r[0], b[1] + r[1], b[2] + r[2]
    return (0.0, -x, -y, -z), (x, 0.0, w, -v), (y, -w, 0.0, u), (z, v, -u, 0.0)


def _projected(
    q: tuple[float, ...], b: Sequence[float], r: Sequence[float], alpha: float, gamma: float
) -> tuple[float, ...]:
    """The quaternion after the four projections of one direction."""
    w, x, y, z = q
    for e, f, g, h in _rows(b, r):
        size = alpha + e * e + f * f + g * g + h * h
        if size == 0.0:
            raise BadInput("alpha is 0 and a constraint is all zeros, since b = r: give an alpha above 0")
        share = gamma * (e * w + f * x + g * y + h * z) / size
        w, x, y, z = w - share * e, x - share * f, y - share * g, z - share * h
    return w, x, y, z
