"""Rotations: unit quaternions and SO(3), with the convention of all other modules.

A quaternion is (w, x, y, z), scalar first, with the Hamilton product (i j = k). As an attitude it maps body coordinates
to inertial coordinates, v_I = R(q) v_B; q and −q are the same attitude. Rates are in body coordinates,
q̇ = ½ q ⊙ (0, ω) and Ṙ = R skew(ω). A rotation vector is axis times angle [rad]. Euler angles are roll, pitch and yaw,
q = q_z(yaw) ⊙ q_y(pitch) ⊙ q_x(roll). Arrays are float64: quaternions (4,), vectors (3,), matrices (3, 3).

Functions take one rotation at a time and are called at 100 Hz by agents; they therefore compute with plain floats.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .errors import BadInput

Floats = NDArray[np.float64]
_Four = tuple[float, float, float, float]

UNIT_WITHIN = 1e-6
"""Tolerance of norm 1, orthogonality and skew symmetry: far above rounding errors, far below wrong units or axes."""


# -- Quaternions --------------------------------------------------------------------------------------------------


def quaternion_product(p: Floats, q: Floats) -> Floats:
    """The Hamilton product p ⊙ q, (4,): R(p ⊙ q) = R(p) R(q)."""
    return np.array(_product(*p.tolist(), *q.tolist()))


def conjugate(q: Floats) -> Floats:
    """The quaternion with its vector part negated, (4,): the inverse of a unit quaternion."""
    w, x, y, z = q.tolist()
    return np.array((w, -x, -y, -z))


def normalised(q: Floats) -> Floats:
    """The quaternion q divided by its norm, (4,).

    Raises:
        BadInput: the norm is zero or not finite.
    """
    return np.array(_normalised(*q.tolist()))


def unit(q: Floats, what: str) -> Floats:
    """Check that the norm of q, (4,), is 1 to a millionth, and return q normalised.

    Args:
        q: (4,), scalar first.
        what: name of the quaternion, for the message.

    Raises:
        BadInput: the norm is wrong; the message gives it, and the remedy.
    """
    norm = math.hypot(*q.tolist())
    if not abs(norm - 1.0) <= UNIT_WITHIN:
        raise BadInput(
            f"{what}: a quaternion has norm 1 to within {UNIT_WITHIN:g}, this one {norm:.9g}: "
            "divide it by its norm if it is meant as a rotation"
        )
    return q / norm


def same_sign(q: Floats, reference: Floats) -> Floats:
    """The one of q and −q, which are the same attitude, that is nearer to the reference, (4,)."""
    return -q if float(q @ reference) < 0.0 else q


def rotate(q: Floats, v: Floats) -> Floats:
    """The vector v rotated by the unit quaternion q, R(q) v, (3,): from body to inertial coordinates."""
    w, x, y, z = q.tolist()
    a, b, c = v.tolist()
    s, t, u = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return np.array((a + w * s + y * u - z * t, b + w * t + z * s - x * u, c + w * u + x * t - y * s))


def to_matrix(q: Floats) -> Floats:
    """The rotation matrix R(q) of a unit quaternion, (3, 3)."""
    return np.array(_matrix(*q.tolist())).reshape(3, 3)


def from_matrix(R: Floats) -> Floats:
    """The unit quaternion of a rotation matrix, (4,), with w ≥ 0.

    The largest of the four components is computed from the diagonal, the others relative to it, so that no divisor is
    small (Shepperd 1978).

    Raises:
        BadInput: R is not a rotation.
    """
    a, b, c, d, e, f, g, h, i = entries = R.ravel().tolist()
    squares = (1.0 + a + e + i, 1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i)
    largest = squares.index(max(squares))
    if largest == 0:
        found = (squares[0], h - f, c - g, d - b)
    elif largest == 1:
        found = (h - f, squares[1], b + d, c + g)
    elif largest == 2:
        found = (c - g, b + d, squares[2], f + h)
    else:
        found = (d - b, c + g, f + h, squares[3])
    w, x, y, z = _normalised(*found)
    off = max(map(abs, map(float.__sub__, _matrix(w, x, y, z), entries)))
    if not off <= UNIT_WITHIN:
        raise BadInput(f"this matrix is off the nearest rotation found by {off:.3g}, allowed is {UNIT_WITHIN:g}")
    return np.array((-w, -x, -y, -z) if w < 0.0 else (w, x, y, z))


def exp_quaternion(rotvec: Floats) -> Floats:
    """The unit quaternion of a rotation vector [rad], (4,)."""
    return np.array(_exp(*rotvec.tolist()))


def log_quaternion(q: Floats) -> Floats:
    """The rotation vector [rad] of a unit quaternion, (3,), of length at most π."""
    w, x, y, z = q.tolist()
    sine = math.hypot(x, y, z)
    factor = 2.0 * math.atan2(sine, abs(w)) / sine if sine > 0.0 else 2.0
    if w < 0.0:
        factor = -factor
    return np.array((factor * x, factor * y, factor * z))


def angle_between(p: Floats, q: Floats) -> float:
    """The angle [rad] of the rotation from attitude p to attitude q, in [0, π]."""
    w, x, y, z = p.tolist()
    a, b, c, d = _product(w, -x, -y, -z, *q.tolist())
    return 2.0 * math.atan2(math.hypot(b, c, d), abs(a))


def mean_quaternion(qs: Floats, weights: Floats | None = None) -> Floats:
    """The mean attitude: the unit quaternion q that minimises Σ w_i ‖R(q) − R(q_i)‖² (Frobenius).

    q is the eigenvector of Σ w_i q_i q_iᵀ with the largest eigenvalue (Markley, Cheng, Crassidis and Oshman 2007). The
    signs of the q_i do not matter; the mean has the sign of the first.

    Args:
        qs: (N, 4), unit quaternions, N ≥ 1.
        weights: (N,), ≥ 0 and not all 0; equal by default.

    Raises:
        BadInput: no quaternions, or weights that are negative or all zero.
    """
    if qs.ndim != 2 or qs.shape[0] == 0 or qs.shape[1] != 4:
        raise BadInput(f"a mean takes an array of (N, 4), N ≥ 1, not {qs.shape}")
    if weights is not None and (weights.shape != qs.shape[:1] or not (weights >= 0.0).all() or not weights.any()):
        raise BadInput(f"weights of a mean are {len(qs)} numbers ≥ 0 and not all 0, not {weights}")
    weighted = qs if weights is None else qs * weights[:, None]
    _, vectors = np.linalg.eigh(weighted.T @ qs)
    return same_sign(vectors[:, -1].copy(), qs[0])


# -- Angles and rates ---------------------------------------------------------------------------------------------


def euler_to_quaternion(roll: float, pitch: float, yaw: float) -> Floats:
    """The unit quaternion of roll, pitch and yaw [rad], (4,): q_z(yaw) ⊙ q_y(pitch) ⊙ q_x(roll)."""
    sr, cr, sp, cp = math.sin(0.5 * roll), math.cos(0.5 * roll), math.sin(0.5 * pitch), math.cos(0.5 * pitch)
    sy, cy = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return np.array(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )
    )


def quaternion_to_euler(q: Floats) -> Floats:
    """Roll, pitch and yaw [rad] of a unit quaternion, (3,): pitch in [−π/2, π/2], the others in [−π, π].

    (w ± y) and (z ∓ x) are cosines and sines of half of yaw ∓ roll, times a length that gives the pitch, so that no
    arcsine loses digits. At a pitch of ±π/2, where only yaw ∓ roll is determined, it is split equally.
    """
    w, x, y, z = q.tolist()
    half_difference, half_sum = math.atan2(z - x, w + y), math.atan2(z + x, w - y)
    pitch = 2.0 * math.atan2(math.hypot(w + y, z - x), math.hypot(w - y, z + x)) - 0.5 * math.pi
    turn = 2.0 * math.pi
    roll, yaw = half_sum - half_difference, half_sum + half_difference
    return np.array((math.remainder(roll, turn), pitch, math.remainder(yaw, turn)))


def quaternion_rate(q: Floats, omega_body: Floats) -> Floats:
    """The derivative q̇ = ½ q ⊙ (0, ω) [1/s], (4,), at the body rates ω [rad/s]."""
    w, a, b, c = q.tolist()
    x, y, z = omega_body.tolist()
    return np.array(_product(w, a, b, c, 0.0, 0.5 * x, 0.5 * y, 0.5 * z))


def integrate(q: Floats, omega_body: Floats, dt_s: float) -> Floats:
    """The unit quaternion after dt_s seconds at constant body rates ω [rad/s], exactly: q ⊙ exp(ω dt), (4,)."""
    w, a, b, c = q.tolist()
    x, y, z = omega_body.tolist()
    return np.array(_normalised(*_product(w, a, b, c, *_exp(x * dt_s, y * dt_s, z * dt_s))))


# -- SO(3) --------------------------------------------------------------------------------------------------------


def skew(v: Floats) -> Floats:
    """The matrix S of the cross product with v, (3, 3): S u = v × u."""
    x, y, z = v.tolist()
    return np.array((0.0, -z, y, z, 0.0, -x, -y, x, 0.0)).reshape(3, 3)


def exp_so3(rotvec: Floats) -> Floats:
    """The rotation matrix exp(skew(v)) of a rotation vector v [rad], (3, 3)."""
    return np.array(_matrix(*_exp(*rotvec.tolist()))).reshape(3, 3)


# -- The same on plain floats -------------------------------------------------------------------------------------


def _product(a: float, b: float, c: float, d: float, w: float, x: float, y: float, z: float) -> _Four:
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def _normalised(w: float, x: float, y: float, z: float) -> _Four:
    norm = math.hypot(w, x, y, z)
    if not 0.0 < norm < math.inf:
        raise BadInput(f"a quaternion of norm {norm:g} has no direction: it must be finite and not zero")
    return w / norm, x / norm, y / norm, z / norm


def _exp(x: float, y: float, z: float) -> _Four:
    """(cos θ/2, v sin(θ/2)/θ): as hypot does not underflow, the quotient is accurate down to the smallest θ."""
    angle = math.hypot(x, y, z)
    factor = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return math.cos(0.5 * angle), factor * x, factor * y, factor * z


def _matrix(w: float, x: float, y: float, z: float) -> tuple[float, ...]:
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    wx, wy, wz = w * x, w * y, w * z
    return (
        1.0 - 2.0 * (yy + zz),
        2.0 * (xy - wz),
        2.0 * (xz + wy),
        2.0 * (xy + wz),
        1.0 - 2.0 * (xx + zz),
        2.0 * (yz - wx),
        2.0 * (xz - wy),
        2.0 * (yz + wx),
        1.0 - 2.0 * (xx + yy),
    )
