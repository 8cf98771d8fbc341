"""Micro aerial vehicles as point masses under a thrust that their attitude points, many at once.

Letters: p, v place [m] and velocity [m/s], inertial, x north, y west, z up; q attitude; ω body rates [rad/s]; m mass;
J moments of inertia; f wanted thrust, inertial [N]; τ, τ_r response times of attitude and rates [s]; c drag [1/s].
Arrays have a column a vehicle: (3, N), quaternions (4, N).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from .attitudes import exponentials, products, turned_back, vertical_axes

Floats = NDArray[np.float64]
GRAVITY = 9.81
_TERMS = 20
_TINY = 1e-300
_CACHED_STEPS = 256


@dataclass(frozen=True)
class Vehicle:
    """What a vehicle is.

    Attributes:
        mass: [kg].
        radius: of the sphere that stands for it where vehicles collide and hide each other [m].
        inertia: principal moments about body x, y and z [kg m²].
        attitude_response: time constant τ of the tilt [s].
        rate_response: time constant τ_r of the body rates [s], at most τ/4, so that the tilt does not overshoot.
        drag: deceleration per speed, c [1/s].
        thrust_to_weight: the largest thrust in weights.
        tilt: the largest wanted tilt [rad].
        command_timeout_ns: a command that is older counts no more.

    Raises:
        BadInput: one of them is out of its bounds.
    """

    mass: float = 0.45
    radius: float = 0.2
    inertia: tuple[float, float, float] = (0.0022, 0.0029, 0.0048)
    attitude_response: float = 0.08
    rate_response: float = 0.01
    drag: float = 0.1
    thrust_to_weight: float = 2.0
    tilt: float = math.pi / 4
    command_timeout_ns: int = 1_000_000_000

    def __post_init__(self) -> None:
        """Check the bounds."""
        for name, value, unit in (
            ("mass", self.mass, "kg"),
            ("radius", self.radius, "m"),
            *(("inertia", moment, "kg m²") for moment in self.inertia),
            ("attitude_response", self.attitude_response, "s"),
            ("rate_response", self.rate_response, "s"),
        ):
            if not 0.0 < value < math.inf:
                raise BadInput(f"{name} is {value:g} {unit}, it must be above 0")
        if max(self.inertia) > sum(self.inertia) / 2.0:
            raise BadInput(f"inertia {self.inertia} kg m² is that of no body: no moment exceeds the sum of the others")
        if not self.rate_response <= self.attitude_response / 4.0:
            raise BadInput(
                f"rate_response is {self.rate_response:g} s, it must be at most a quarter of attitude_response, "
                f"{self.attitude_response:g} s: else the tilt overshoots"
            )
        if not 0.0 <= self.drag < math.inf:
            raise BadInput(f"drag is {self.drag:g} 1/s, it must be at least 0")
        if not 1.0 < self.thrust_to_weight < math.inf:
            raise BadInput(f"thrust_to_weight is {self.thrust_to_weight:g}, it must be above 1 to hover")
        if not 0.0 < self.tilt < math.pi / 2:
            raise BadInput(f"tilt is {math.degrees(self.tilt):g} deg, it must lie between 0 and 90 deg")
        if not self.command_timeout_ns > 0:
            raise BadInput(f"command_timeout is {self.command_timeout_ns} ns, it must be above 0")

    @property
    def weight(self) -> float:
        """Mass times gravity [N]."""
        return self.mass * GRAVITY

    def thrust(self, force: Floats) -> Floats:
        """The thrust f that gives a force beside the weight's compensation, within the vehicle's limits, (3,) [N].

        The vertical part is at least 0; the horizontal part is cut to the largest tilt, then the whole to the largest
        thrust.
        """
        x, y, z = force.tolist()
        z = max(z + self.weight, 0.0)
        aside = math.hypot(x, y)
        most = math.tan(self.tilt) * z
        scale = most / aside if aside > most else 1.0
        x, y = scale * x, scale * y
        whole = math.hypot(x, y, z)
        largest = self.thrust_to_weight * self.weight
        return np.array((x, y, z)) * (largest / whole if whole > largest else 1.0)


class State(NamedTuple):
    """Places and velocities (3, N), attitudes (4, N) and body rates (3, N)."""

    places: Floats
    velocities: Floats
    attitudes: Floats
    rates: Floats


class Orders(NamedTuple):
    """What all vehicles are to do: wanted thrusts f [N] and their directions, (3, N), and yaw rates (N,) [rad/s]."""

    thrusts: Floats
    directions: Floats
    yaw_rates: Floats


def step(vehicle: Vehicle, state: State, orders: Orders, disturbance: Floats, dt_ns: int) -> State:
    """All vehicles a step on.

    The tilt's error, the rotation vector e from the body's z axis to f, sets the wanted rates ω* = e/τ about x and y;
    about z they are the ordered yaw rate. A torque M = J (ω* − ω)/τ_r tracks them:

    - ω̇ = J⁻¹ (M − ω × J ω)                     Nägeli 2014, (1)
    - q̇ = ½ q ⊙ (0, ω), or Ṙ = R skew(ω)         Nägeli 2014, (2)
    - v̇ = R (0, 0, max(f·b_z, 0))/m − g − c v + disturbance, with b_z the body's z axis

    e, ω and the rotation are exact for constant orders, but for ω × J ω, which is held over the step, and for the
    turning of e by yaw within it (first order in the step). v and p are exact for an acceleration that changes evenly
    over the step.

    Args:
        vehicle: what all of them are.
        state: where they are.
        orders: constant over the step.
        disturbance: further acceleration, constant over the step, (3, N) [m/s²].
        dt_ns: length of the step.
    """
    e_keep, e_rate, rate_e, rate_keep, kept, caught, factors = _coefficients(vehicle, dt_ns)
    p, v, q, omega = state
    dt = dt_ns * 1e-9
    before = _pull(vehicle, q, orders)

    gyration = _gyration(vehicle)[:, None] * omega[[1, 2, 0]] * omega[[2, 0, 1]]
    error = _tilt_error(q, orders.directions) + vehicle.attitude_response * vehicle.rate_response * gyration[:2]
    yaw_rate = orders.yaw_rates + vehicle.rate_response * gyration[2]
    turn, rates = np.empty_like(omega), np.empty_like(omega)
    turn[:2] = (1.0 - e_keep) * error - e_rate * omega[:2]
    rates[:2] = rate_e * error + rate_keep * omega[:2]
    turn[2] = yaw_rate * dt + (omega[2] - yaw_rate) * caught
    rates[2] = yaw_rate + (omega[2] - yaw_rate) * kept
    attitudes = products(q, exponentials(turn))
    attitudes /= np.sqrt((attitudes * attitudes).sum(axis=0))

    change = _pull(vehicle, attitudes, orders) - before
    held = before + disturbance
    held[2] -= GRAVITY
    slow, first, second, third = factors
    velocities = slow * v + (dt * first) * held + (dt * second) * change
    places = p + (dt * first) * v + (dt * dt * second) * held + (dt * dt * third) * change
    return State(places, velocities, attitudes, rates)


def accelerations(vehicle: Vehicle, state: State, orders: Orders, disturbance: Floats) -> Floats:
    """What an ideal accelerometer would feel, in inertial coordinates: all but gravity, (3, N) [m/s²]."""
    return _pull(vehicle, state.attitudes, orders) - vehicle.drag * state.velocities + disturbance


def _pull(vehicle: Vehicle, attitudes: Floats, orders: Orders) -> Floats:
    """Acceleration by thrust: the part of f along the body's z axis, never downwards."""
    axes = vertical_axes(attitudes)
    return np.asarray((np.maximum((axes * orders.thrusts).sum(axis=0), 0.0) / vehicle.mass) * axes)


def _tilt_error(attitudes: Floats, directions: Floats) -> Floats:
    """The rotation vector in body coordinates that takes the body's z axis to a direction: about x and y, (2, N)."""
    x, y, z = turned_back(attitudes, directions)
    sine = np.hypot(x, y)
    factor = np.arctan2(sine, z) / np.maximum(sine, _TINY)
    error = np.empty((2, *x.shape))
    error[0] = -factor * y
    error[1] = factor * x
    return error


@lru_cache(maxsize=_CACHED_STEPS)
def _gyration(vehicle: Vehicle) -> Floats:
    """−J⁻¹ (ω × J ω) as a factor of the products ω_y ω_z, ω_z ω_x and ω_x ω_y."""
    x, y, z = vehicle.inertia
    return np.array(((y - z) / x, (z - x) / y, (x - y) / z))


@lru_cache(maxsize=_CACHED_STEPS)
def _coefficients(vehicle: Vehicle, dt_ns: int) -> tuple[float, float, float, float, float, float, tuple[float, ...]]:
    """The exact step of ė = −ω, ω̇ = (e/τ − ω)/τ_r, of a lag τ_r alone, and of the drag."""
    dt, tau, tau_r = dt_ns * 1e-9, vehicle.attitude_response, vehicle.rate_response
    mean = -0.5 / tau_r
    spread = math.sqrt(max(mean * mean - 1.0 / (tau * tau_r), 0.0))
    slow, fast = math.exp((mean + spread) * dt), math.exp((mean - spread) * dt)
    even = (slow + fast) / 2.0
    odd = (slow - fast) / (2.0 * spread) if spread > 0.0 else slow * dt
    kept = math.exp(-dt / tau_r)
    return (
        even - mean * odd,
        -odd,
        odd / (tau * tau_r),
        even + mean * odd,
        kept,
        tau_r * (1.0 - kept),
        tuple(_phi(order, -vehicle.drag * dt) for order in range(4)),
    )


def _phi(order: int, z: float) -> float:
    """φ_n(z) = Σ_k z^k/(k + n)!, so that φ₀ = exp and φ_(n+1) = (φ_n − 1/n!)/z, without its cancellation."""
    return math.exp(z) if order == 0 else math.fsum(z**k / math.factorial(k + order) for k in range(_TERMS))
