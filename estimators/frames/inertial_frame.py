"""The local inertial frame from an inertial measurement unit: an extended Kalman filter, and the attitude it implies.

The inertial frame is that of (3): x magnetic north, y west, z up, so that thrust is R (0, 0, T). It is the frame north,
east, down rotated by 180° about x: down = −up, east = −west. An accelerometer measures specific force; at hover it
reads +g along body z, the direction of up. In manoeuvres it reads the direction of thrust and not of up: its assumed
noise must cover them, with the consequence described in `imu_model`.

Letters: ω body rates [rad/s], a specific force [m/s²], μ magnetic field [any unit], all in body coordinates;
x = (ω, a, μ) (9,), P its covariance, J inertia [kg m²], F the Jacobian of the prediction.  Nägeli 2014, Algorithm 2
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import dposv

from ...errors import BadInput
from ...rotations import from_matrix, skew
from ..checks import as_array

Floats = NDArray[np.float64]
Reading = Floats | Sequence[float]
"""Three numbers."""

LONGEST_STEP_S = 0.1
"""Longest step [s]: a forward Euler step of (1) of this length at 2 rad/s adds 2 % to the rates."""

_RATES, _FORCE, _FIELD = slice(0, 3), slice(3, 6), slice(6, 9)
_UNCHANGED = np.eye(9)
_SMALL = 1e-2
_UPRIGHT = 1e-6


@dataclass(frozen=True, eq=False)
class ImuModel:
    """The filter's model of the vehicle and of its sensors.

    `inertia` J, shape (3, 3) [kg m²]; `process`, process noise covariance of (ω, a, μ) per second, shape (9, 9);
    `noise`, covariance of one reading of gyro, accelerometer and magnetometer, shape (9, 9).

    Raises:
        BadInput: a matrix of another shape, not symmetric, or not positive definite.
    """

    inertia: Floats
    process: Floats
    noise: Floats

    gyration: Floats = field(init=False)
    """∂f/∂ω of f = −J⁻¹ (ω × J ω), row by row, is this (9, 3) times ω; f, being quadratic, is half of that times ω."""

    def __post_init__(self) -> None:
        """Check all three, and compute the constant matrix of (1)."""
        for name, size in (("inertia", 3), ("process", 9), ("noise", 9)):
            object.__setattr__(self, name, _positive(getattr(self, name), size, name))
        J = self.inertia
        by_rate = [np.linalg.solve(J, skew(J @ axis) - skew(axis) @ J) for axis in np.eye(3)]
        object.__setattr__(self, "gyration", np.stack(by_rate, axis=-1).reshape(9, 3))


class ImuEstimate(NamedTuple):
    """Estimate of (ω, a, μ), shape (9,) [rad/s, m/s², unit of the magnetometer], and its covariance, shape (9, 9)."""

    state: Floats
    covariance: Floats


def imu_model(
    inertia: ArrayLike,
    noise: tuple[float, float, float],
    walk: tuple[float, float, float],
) -> ImuModel:
    """The model with one standard deviation for each of the vectors ω, a, μ.

    With good gyros, a follows the accelerometer with the time constant τ = noise·√dt / walk, with noise and walk of a
    and dt the time between readings. It should be short, as a gyro bias b tilts the frame by b·τ, and long compared to
    manoeuvres. Rates follow the gyro if their walk covers the unknown torques.

    Args:
        inertia: J, shape (3, 3) [kg m²].
        noise: of one reading, [rad/s], [m/s²], [unit of the magnetometer].
        walk: random walk, [rad/s/√s], [m/s²/√s], [unit/√s].
    Raises:
        BadInput: a deviation that is not positive, or an invalid inertia.
    """
    diagonals = []
    for what, deviations in (("noise", noise), ("walk", walk)):
        if len(deviations) != 3 or not all(0.0 < each < math.inf for each in deviations):
            raise BadInput(f"{what} is {deviations}: give three positive deviations, of rates, force and field")
        diagonals.append(np.diag(np.repeat(np.square(deviations), 3)))
    return ImuModel(as_array(inertia, (3, 3), "inertia"), process=diagonals[1], noise=diagonals[0])


def at_rest(force: ArrayLike, field: ArrayLike, model: ImuModel, upright: float | None = None) -> ImuEstimate:
    """Initial estimate: directions from the first readings; zero rates, with the process noise of one second added.

    Args:
        force: specific force a, shape (3,) [m/s²].
        field: magnetic field μ, shape (3,) [unit of the magnetometer].
        model: for the covariance.
        upright: standard deviation [rad] about x and y of a body that starts upright, as on the ground; only the norm
            of the force is used then. None for any attitude.
    Raises:
        BadInput: a deviation that is not positive.
    """
    first = as_array(force, (3,), "force")
    covariance = model.noise.copy()
    covariance[_RATES, _RATES] += model.process[_RATES, _RATES]
    if upright is not None:
        check_upright(upright)
        size = math.hypot(*first.tolist())
        first = np.array((0.0, 0.0, size))
        covariance[_FORCE] = covariance[:, _FORCE] = 0.0
        covariance[_FORCE, _FORCE] = np.diag(((size * upright) ** 2, (size * upright) ** 2, model.noise[5, 5]))
    return ImuEstimate(np.concatenate([np.zeros(3), first, as_array(field, (3,), "field")]), covariance)


def check_upright(upright: float) -> None:
    """Check the standard deviation of the initial tilt.

    Raises:
        BadInput: it is not positive and finite.
    """
    if not 0.0 < upright < math.inf:
        raise BadInput(f"upright is {upright:g} rad: must be above 0, or None for a body in any attitude")


def predict(estimate: ImuEstimate, model: ImuModel, dt_s: float) -> ImuEstimate:
    """Predict by dt_s seconds; torques are unknown, and directions rotate opposite to the body.

    ω⁺ = ω − dt J⁻¹ (ω × J ω),  a⁺ = exp(−skew(ω⁺) dt) a,  μ⁺ likewise,  P⁺ = F P Fᵀ + G Q Gᵀ dt
        Nägeli 2014, Algorithm 2, lines 1–3, with the dt that line 1 lacks and the sign that line 2 needs

    Unknown torques change ω during the step, so that their effect on a and μ is that of half a step: G is 1 with half
    of ∂(a, μ)⁺/∂ω. The gyro's next reading then corrects the directions too, as in the trapezoidal rule.

    Raises:
        BadInput: a step that is not positive, or longer than LONGEST_STEP_S.
    """
    if not 0.0 < dt_s <= LONGEST_STEP_S:
        raise BadInput(f"a step of {dt_s:g} s: must be above 0 and at most {LONGEST_STEP_S:g} s, take several")
    state, F = propagate(estimate.state, model, dt_s)
    G = _UNCHANGED.copy()
    G[3:, _RATES] = 0.5 * F[3:, _RATES]
    return ImuEstimate(state, F.dot(estimate.covariance).dot(F.T) + G.dot(dt_s * model.process).dot(G.T))


def propagate(state: Floats, model: ImuModel, dt_s: float) -> tuple[Floats, Floats]:
    """The predicted state, shape (9,), and the Jacobian F of the prediction, shape (9, 9).

    D = ∂ω⁺/∂ω = 1 + dt J⁻¹ (skew(Jω) − skew(ω) J),  ∂a⁺/∂a = E = exp(−skew(θ)),  ∂a⁺/∂ω = dt skew(a⁺) V D,  θ = dt ω⁺
    V is the right Jacobian of SO(3): exp(skew(θ + δ)) ≈ exp(skew(θ)) exp(skew(V δ)), so that E rotates by −V δ.
    """
    x, y, z, *directions = state.tolist()
    a, b, c, d, e, f, g, h, i = (dt_s * model.gyration.dot(state[_RATES])).tolist()
    x, y, z = (
        x + 0.5 * (a * x + b * y + c * z),
        y + 0.5 * (d * x + e * y + f * z),
        z + 0.5 * (g * x + h * y + i * z),
    )
    E, V = _turn_back(dt_s * x, dt_s * y, dt_s * z)
    D = (a + 1.0, b, c, d, e + 1.0, f, g, h, i + 1.0)
    force, magnetic = _applied(E, *directions[:3]), _applied(E, *directions[3:])
    F, VD = np.zeros((9, 9)), _times(V, D)
    F[:, _RATES] = np.array((*D, *_crossed(*force, VD), *_crossed(*magnetic, VD))).reshape(9, 3)
    F[3:, _RATES] *= dt_s
    F[_FORCE, _FORCE] = F[_FIELD, _FIELD] = np.array(E).reshape(3, 3)
    return np.array((x, y, z, *force, *magnetic)), F


def update(
    estimate: ImuEstimate,
    model: ImuModel,
    *,
    gyro: Reading | None = None,
    accelerometer: Reading | None = None,
    magnetometer: Reading | None = None,
) -> ImuEstimate:
    """Update the estimate with one reading of each of some sensors.

    L = P Cᵀ (C P Cᵀ + R)⁻¹,  x⁺ = x + L (z − C x),  P⁺ = (1 − L C) P
        Nägeli 2014, Algorithm 2, lines 4–6; C = 1 with readings of all three

    Args:
        estimate: the predicted estimate.
        model: for R.
        gyro: shape (3,) [rad/s].
        accelerometer: specific force, shape (3,) [m/s²].
        magnetometer: shape (3,), in its unit.
    Raises:
        BadInput: a reading that is not three finite numbers.
    """
    readings = (gyro, accelerometer, magnetometer)
    given = [values for values in readings if values is not None]
    if not given:
        return estimate
    z = _checked(given)
    x, P = estimate.state, estimate.covariance
    if len(given) == 3:
        expected, seen, S = x, P, P + model.noise
    else:
        rows = np.repeat([values is not None for values in readings], 3).nonzero()[0]
        expected, seen = x[rows], P[rows]
        S = seen[:, rows] + model.noise[np.ix_(rows, rows)]
    _, gain, failed = dposv(S, seen)
    assert failed == 0, "P or R has lost its positive definiteness"
    covariance = P - gain.T.dot(seen)
    return ImuEstimate(x + gain.T.dot(z - expected), 0.5 * (covariance + covariance.T))


def implied_attitude(state: Floats) -> Floats:
    """Attitude implied by the estimated directions, a unit quaternion, body → north, west, up.

    up = a / ‖a‖,  west = up × μ / ‖up × μ‖,  north = west × up: the rows of R
        Nägeli 2014, Algorithm 2, line 7, rotated by 180° about north: there down = −a, east = down × μ, north =
        east × down

    Raises:
        BadInput: a is zero, or μ is parallel to it, so that there is no north.
    """
    a, b, c, d, e, f = state[3:].tolist()
    force = math.hypot(a, b, c)
    if not force > 0.0:
        raise BadInput("the estimated specific force is zero: there is no up")
    a, b, c = a / force, b / force, c / force
    x, y, z = b * f - c * e, c * d - a * f, a * e - b * d
    across = math.hypot(x, y, z)
    if not across > _UPRIGHT * math.hypot(d, e, f):
        raise BadInput("the estimated magnetic field is zero or parallel to up: there is no north")
    x, y, z = x / across, y / across, z / across
    R = np.array((y * c - z * b, z * a - x * c, x * b - y * a, x, y, z, a, b, c)).reshape(3, 3)
    return from_matrix(R)


def _checked(readings: Sequence[Reading]) -> Floats:
    """The readings in one array; each must be three finite numbers."""
    z = np.concatenate(readings)
    if {*map(len, readings)} != {3} or not math.isfinite(z.dot(z)):
        raise BadInput(f"a reading is three finite numbers: these are {[list(values) for values in readings]}")
    return z


# -- Matrices as tuples of nine numbers, by rows: much faster than arrays at this size -----------------------------

_Nine = tuple[float, ...]


def _turn_back(x: float, y: float, z: float) -> tuple[_Nine, _Nine]:
    """exp(−skew(θ)) = 1 − sin θ/θ S + (1 − cos θ)/θ² S², and its Jacobian 1 − (1 − cos θ)/θ² S + (θ − sin θ)/θ³ S²."""
    angle = math.hypot(x, y, z)
    square = angle * angle
    if angle < _SMALL:  # the next terms, θ⁶/5040 and less, are below rounding
        first, second = 1.0 - square / 6.0 * (1.0 - square / 20.0), 0.5 - square / 24.0 * (1.0 - square / 30.0)
        third = 1.0 / 6.0 - square / 120.0 * (1.0 - square / 42.0)
    else:
        first, second = math.sin(angle) / angle, 2.0 * math.sin(0.5 * angle) ** 2 / square
        third = (1.0 - first) / square
    return _series(first, second, x, y, z), _series(second, third, x, y, z)


def _series(first: float, second: float, x: float, y: float, z: float) -> _Nine:
    """1 − first S + second S² with S = skew(x, y, z)."""
    xx, yy, zz = second * x * x, second * y * y, second * z * z
    xy, xz, yz = second * x * y, second * x * z, second * y * z
    a, b, c = first * x, first * y, first * z
    return 1.0 - yy - zz, xy + c, xz - b, xy - c, 1.0 - xx - zz, yz + a, xz + b, yz - a, 1.0 - xx - yy


def _times(P: _Nine, Q: _Nine) -> _Nine:
    """The product of two matrices."""
    a, b, c, d, e, f, g, h, i = P
    r, s, t, u, v, w, x, y, z = Q
    first = a * r + b * u + c * x, a * s + b * v + c * y, a * t + b * w + c * z
    second = d * r + e * u + f * x, d * s + e * v + f * y, d * t + e * w + f * z
    return *first, *second, g * r + h * u + i * x, g * s + h * v + i * y, g * t + h * w + i * z


def _applied(P: _Nine, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A matrix times a vector."""
    a, b, c, d, e, f, g, h, i = P
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def _crossed(x: float, y: float, z: float, P: _Nine) -> _Nine:
    """skew(x, y, z) times a matrix."""
    a, b, c, d, e, f, g, h, i = P
    first = y * g - z * d, y * h - z * e, y * i - z * f
    second = z * a - x * g, z * b - x * h, z * c - x * i
    return *first, *second, x * d - y * a, x * e - y * b, x * f - y * c


def _positive(values: ArrayLike, size: int, name: str) -> Floats:
    """The matrix as an array; it must be symmetric and positive definite."""
    matrix = as_array(values, (size, size), name)
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0):
        raise BadInput(f"{name} is not symmetric: {matrix.tolist()}")
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    if not smallest > 0.0:
        raise BadInput(f"{name} must be positive definite: its smallest eigenvalue is {smallest:.6g}, make it positive")
    return matrix
