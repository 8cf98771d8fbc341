"""Rotations of `rotations` for many bodies at once, a column each: the same convention; `rotation_stacks` has rows.

Shapes: quaternions (4, …), matrices (3, 3, …), vectors (3, …), with the same further axes. A few calls on whole arrays
do all of it: for few vehicles the number of calls is what costs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_TINY = 1e-300
"""Divides in the place of 0, where the quotient is multiplied by 0 anyway."""


def dots(v: Floats, w: Floats) -> Floats:
    """The inner products of vectors, or of quaternions, (…): sums over the first axis."""
    return np.asarray(np.add.reduce(v * w))


def norms(v: Floats) -> Floats:
    """The lengths of vectors, or of quaternions, (…)."""
    return np.asarray(np.sqrt(dots(v, v)))


def products(p: Floats, q: Floats) -> Floats:
    """The Hamilton products p ⊙ q, (4, …): each component is a sum of products of two components."""
    pairs = (p[:, None] * q).reshape(16, -1)
    return np.asarray((_HAMILTON @ pairs).reshape(q.shape))


def _hamilton() -> Floats:
    """Component i of p ⊙ q is Σ_j ± p_(i xor j) q_j: the coefficients of the products of components, (4, 16)."""
    minus = ((0, 1), (0, 2), (0, 3), (1, 2), (2, 3), (3, 1))
    rows = np.zeros((4, 4, 4))
    for i in range(4):
        for j in range(4):
            rows[i, i ^ j, j] = -1.0 if (i, j) in minus else 1.0
    return rows.reshape(4, 16)


_HAMILTON = _hamilton()


def conjugates(q: Floats) -> Floats:
    """The inverse rotations, (4, …)."""
    result = -q
    result[0] = q[0]
    return result


def exponentials(rotvec: Floats) -> Floats:
    """The unit quaternions of rotation vectors [rad], (4, …)."""
    half = 0.5 * norms(rotvec)
    result = np.empty((4, *rotvec.shape[1:]))
    result[0] = np.cos(half)
    result[1:] = (0.5 * np.sin(half) / np.maximum(half, _TINY)) * rotvec
    return result


def matrices(q: Floats) -> Floats:
    """The rotation matrices R(q) of unit quaternions, (3, 3, …): each entry is a sum of products of two components."""
    pairs = (q[:, None] * q).reshape(16, -1)
    return np.asarray((_QUADRATIC @ pairs).reshape(3, 3, *q.shape[1:]))


def _quadratic() -> Floats:
    """R = w² + x² − y² − z² and so on, as rows of coefficients of the products of components, (9, 16)."""
    w, x, y, z = range(4)
    rows = np.zeros((3, 3, 4, 4))
    for axis, (own, second, third) in enumerate(((x, y, z), (y, z, x), (z, x, y))):
        for component, sign in ((w, 1.0), (own, 1.0), (second, -1.0), (third, -1.0)):
            rows[axis, axis, component, component] = sign
        rows[axis, second - 1, own, second] = rows[second - 1, axis, own, second] = 2.0
        rows[axis, second - 1, w, third], rows[second - 1, axis, w, third] = -2.0, 2.0
    return rows.reshape(9, 16)


_QUADRATIC = _quadratic()


def turned_back(R: Floats, v: Floats) -> Floats:
    """The vectors Rᵀ v, (3, …): inertial coordinates become the body's."""
    return dots(R, v[:, None])
