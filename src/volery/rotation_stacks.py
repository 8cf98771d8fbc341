"""Rotations of `rotations` for n at once, for estimators that work on all points of a window: the same convention.

Arrays are float64 with the rotation along the first axis: quaternions (n, 4), vectors (n, 3), matrices (n, 3, 3). What
is meant, and the equations, stand in `rotations` under the singular of each name. `rotation_columns` has them along the
last axis, for worlds of few bodies.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_SMALL_ANGLE = 1e-2
"""Up to here two terms of (θ − sin θ)/θ³ are exact to 2e-12; below it the difference itself loses digits."""
_LEAST = float(np.finfo(np.float64).tiny)
"""A squared length counts for no less, so that one can divide by lengths: sin x / x of its root is 1."""
_IDENTITY = np.eye(3)
_GENERATORS = np.zeros((3, 9))
"""Vectors → the nine entries of their skew matrices."""
_GENERATORS[[0, 0, 1, 1, 2, 2], [7, 5, 2, 6, 3, 1]] = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0]
_PRODUCT = np.array(
    [
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
        [[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]],
        [[0, 0, 1, 0], [0, 0, 0, -1], [-1, 0, 0, 0], [0, 1, 0, 0]],
        [[0, 0, 0, 1], [0, 0, 1, 0], [0, -1, 0, 0], [-1, 0, 0, 0]],
    ],
    dtype=np.float64,
)
"""Hamilton's table: unit i times unit j, as a quaternion."""


def quaternion_products(p: Floats, q: Floats) -> Floats:
    """P ⊙ q, row by row."""
    left = (p @ _PRODUCT.reshape(4, 16)).reshape(-1, 4, 4)
    return np.asarray((q[:, np.newaxis, :] @ left)[:, 0, :])


def conjugates(q: Floats) -> Floats:
    """Quaternions with their vector parts turned round."""
    return q * (1.0, -1.0, -1.0, -1.0)


def normalised_rows(q: Floats) -> Floats:
    """Unit quaternions in the directions of q; what is not finite stays so."""
    return np.asarray(q / np.sqrt(np.vecdot(q, q))[:, np.newaxis])


def exp_quaternions(rotvecs: Floats) -> Floats:
    """Unit quaternions of rotation vectors [rad]."""
    angles = _lengths(rotvecs)
    half = 0.5 * angles
    return np.concatenate([np.cos(half), np.sin(half) / angles * rotvecs], axis=1)


def log_quaternions(q: Floats) -> Floats:
    """Rotation vectors [rad] of unit quaternions, the shorter way round."""
    cosines, vectors = q[:, :1], q[:, 1:]
    sines = _lengths(vectors)
    halves = np.where(cosines < 0.0, -1.0, 1.0) * np.arctan2(sines, abs(cosines))
    return np.asarray(2.0 * halves / sines * vectors)


def to_matrices(q: Floats) -> Floats:
    """Rotation matrices of unit quaternions, v vᵀ + w² 1 + 2 w skew(v) + skew(v)², v the vector part."""
    K = skews(q[:, 1:])
    return np.asarray(2.0 * (K @ K + q[:, :1, np.newaxis] * K) + _IDENTITY)


def skews(v: Floats) -> Floats:
    """Matrices of the cross product."""
    return np.asarray((v @ _GENERATORS).reshape(-1, 3, 3))


def right_jacobians(rotvecs: Floats) -> Floats:
    """Matrices J with exp(v + δ) = exp(v) ⊙ exp(J δ) to first order in δ."""
    angles = _lengths(rotvecs)[:, :, np.newaxis]
    first = 2.0 * (np.sin(0.5 * angles) / angles) ** 2
    safe = np.maximum(angles, _SMALL_ANGLE)
    exact = (safe - np.sin(safe)) / safe**3
    second = np.where(angles > _SMALL_ANGLE, exact, 1.0 / 6.0 - angles**2 / 120.0)
    K = skews(rotvecs)
    return np.asarray(second * (K @ K) - first * K + _IDENTITY)


def _lengths(v: Floats) -> Floats:
    """Lengths of the rows, (n, 1), above 0 even for rows of zeros."""
    return np.asarray(np.sqrt(np.maximum(np.vecdot(v, v), _LEAST)))[:, np.newaxis]
