"""Functions of `rotations` for n rotations at once, for estimators that process all points of a window.

Arrays are float64 with the rotations along the first axis: quaternions (n, 4), vectors (n, 3), matrices (n, 3, 3). The
convention is that of `rotations`, which documents each function under the singular of its name. `rotation_columns` has
rotations along the last axis, for worlds of few bodies.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_SMALL_ANGLE = 1e-2
"""Below this angle two terms of the series of (θ − sin θ)/θ³ are used, exact to 2e-12: the difference loses digits."""
_LEAST = float(np.finfo(np.float64).tiny)
"""Lower bound of squared lengths, to avoid division by zero; sin x / x of its root is 1."""
_IDENTITY = np.eye(3)
_GENERATORS = np.zeros((3, 9))
"""Linear map from vectors to the nine entries of their skew matrices."""
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
    """Products p ⊙ q of the rows."""
    left = (p @ _PRODUCT.reshape(4, 16)).reshape(-1, 4, 4)
    return np.asarray((q[:, np.newaxis, :] @ left)[:, 0, :])


def conjugates(q: Floats) -> Floats:
    """Quaternions with negated vector parts."""
    return q * (1.0, -1.0, -1.0, -1.0)


def normalised_rows(q: Floats) -> Floats:
    """Rows divided by their norms; rows that are not finite stay so."""
    return np.asarray(q / np.sqrt(np.vecdot(q, q))[:, np.newaxis])


def exp_quaternions(rotvecs: Floats) -> Floats:
    """Unit quaternions of rotation vectors [rad]."""
    angles = _lengths(rotvecs)
    half = 0.5 * angles
    return np.concatenate([np.cos(half), np.sin(half) / angles * rotvecs], axis=1)


def log_quaternions(q: Floats) -> Floats:
    """Rotation vectors [rad] of unit quaternions, with angles of at most π."""
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
    """Norms of the rows, (n, 1), above 0 even for rows of zeros."""
    return np.asarray(np.sqrt(np.maximum(np.vecdot(v, v), _LEAST)))[:, np.newaxis]
