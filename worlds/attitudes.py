"""Attitudes of many vehicles at once: the quaternions of `rotations`, a column each.

Shapes: quaternions (4, …), vectors (3, …); what follows the first axis is broadcast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_TINY = 1e-300
"""Divides in the place of 0, where the quotient is multiplied by 0 anyway."""


def products(p: Floats, q: Floats) -> Floats:
    """The Hamilton products p ⊙ q, (4, …)."""
    a, b, c, d = p
    w, x, y, z = q
    return np.array(
        (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        )
    )


def conjugates(q: Floats) -> Floats:
    """The inverse rotations, (4, …)."""
    result = -q
    result[0] = q[0]
    return result


def turned(q: Floats, v: Floats) -> Floats:
    """The vectors R(q) v, (3, …): body coordinates become inertial ones."""
    w, x, y, z = q
    a, b, c = v
    s, t, u = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return np.array((a + w * s + y * u - z * t, b + w * t + z * s - x * u, c + w * u + x * t - y * s))


def turned_back(q: Floats, v: Floats) -> Floats:
    """The vectors R(q)ᵀ v, (3, …): inertial coordinates become the body's."""
    return turned(conjugates(q), v)


def vertical_axes(q: Floats) -> Floats:
    """The bodies' z axes in inertial coordinates, R(q) (0, 0, 1), (3, …)."""
    w, x, y, _ = q
    twice_x, twice_y, twice_z = 2.0 * q[1:]
    return np.array((x * twice_z + w * twice_y, y * twice_z - w * twice_x, 1.0 - x * twice_x - y * twice_y))


def exponentials(rotvec: Floats) -> Floats:
    """The unit quaternions of rotation vectors [rad], (4, …)."""
    x, y, z = rotvec
    half = 0.5 * np.sqrt(x * x + y * y + z * z)
    factor = 0.5 * np.sin(half) / np.maximum(half, _TINY)
    return np.array((np.cos(half), factor * x, factor * y, factor * z))
