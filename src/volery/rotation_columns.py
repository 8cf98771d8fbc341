"""Functions of `rotations` for many bodies at once, in columns; `rotation_stacks` has rows. The convention is the same.

Shapes: quaternions (4, …), matrices (3, 3, …), vectors (3, …), with the same further axes. The functions make as few
NumPy calls as possible, because for few vehicles the number of calls determines the time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_TINY = 1e-300
"""Replaces a divisor of 0 where the quotient is multiplied by 0 anyway."""


def dots(v: Floats, w: Floats) -> Floats:
    """Inner products of vectors or quaternions over the first axis, (…)."""
    return np.asarray(np.add.reduce(v * w))


def norms(v: Floats) -> Floats:
    """Norms of vectors or quaternions, (…)."""
    return np.asarray(np.sqrt(dots(v, v)))


def products(p: Floats, q: Floats) -> Floats:
    """Hamilton products p ⊙ q, (4, …)."""
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
    """Inverse rotations, (4, …)."""
    result = -q
    result[0] = q[0]
    return result


def exponentials(rotvec: Floats) -> Floats:
    """Unit quaternions of rotation vectors [rad], (4, …)."""
    half = 0.5 * norms(rotvec)
    result = np.empty((4, *rotvec.shape[1:]))
    result[0] = np.cos(half)
    result[1:] = (0.5 * np.sin(half) / np.maximum(half, _TINY)) * rotvec
    return result


def matrices(q: Floats) -> Floats:
    """Rotation matrices R(q) of unit quaternions, (3, 3, …)."""
    pairs = (q[:, None] * q).reshape(16, -1)
    return np.asarray((_QUADRATIC @ pairs).reshape(3, 3, *q.shape[1:]))


def _quadratic() -> Floats:
    """Coefficients of the entries of R, such as w² + x² − y² − z², in the products of components, (9, 16)."""
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
    """Vectors Rᵀ v, (3, …): from inertial to body coordinates."""
    return dots(R, v[:, None])
