"""Micro aerial vehicles as point masses under a thrust along their body axis, many at once.

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

from ...errors import BadInput
from ...rotation_columns import dots, exponentials, matrices, norms, products, turned_back
from ...units import (
    Kilograms,
    KilogramSquareMetres,
    Metres,
    Period,
    PerSecond,
    Radians,
    Seconds,
    check_above_zero,
)

Floats = NDArray[np.float64]
GRAVITY = 9.81
_TERMS = 20
_TINY = 1e-300
_CACHED_STEPS = 256


@dataclass(frozen=True)
class Vehicle:
    """Parameters of a vehicle.

    Attributes:
        mass: [kg].
        radius: of its sphere, for collisions and occlusions [m].
        inertia: principal moments about body x, y and z [kg m²].
        attitude_response: time constant τ of the tilt [s].
        rate_response: time constant τ_r of the body rates [s], at most τ/4, so that the tilt does not overshoot.
        drag: deceleration per speed, c [1/s].
        thrust_to_weight: the largest thrust in weights.
        tilt: the largest wanted tilt [rad].
        command_timeout_ns: age at which a command expires [ns].

    Raises:
        BadInput: one of them is out of its bounds.
    """

    mass: Kilograms = 0.45
    radius: Metres = 0.2
    inertia: tuple[KilogramSquareMetres, KilogramSquareMetres, KilogramSquareMetres] = (0.0022, 0.0029, 0.0048)
    attitude_response: Seconds = 0.08
    rate_response: Seconds = 0.01
    drag: PerSecond = 0.1
    thrust_to_weight: float = 2.0
    tilt: Radians = math.pi / 4
    command_timeout_ns: Period = 1_000_000_000

    def __post_init__(self) -> None:
        """Check the bounds."""
        for name, value, unit in (
            ("mass", self.mass, "kg"),
            ("radius", self.radius, "m"),
            *(("inertia", moment, "kg m²") for moment in self.inertia),
            ("attitude_response", self.attitude_response, "s"),
            ("rate_response", self.rate_response, "s"),
        ):
            check_above_zero(name, value, unit)
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
    """Places and velocities (3, N), attitudes (4, N), body rates (3, N), and the attitudes' matrices R (3, 3, N)."""

    places: Floats
    velocities: Floats
    attitudes: Floats
    rates: Floats
    matrices: Floats


class Orders(NamedTuple):
    """Commands to all vehicles: wanted thrusts f [N] and their directions, (3, N), and yaw rates (N,) [rad/s]."""

    thrusts: Floats
    directions: Floats
    yaw_rates: Floats


def at_rest(places: Floats, attitudes: Floats) -> State:
    """Vehicles at rest at places (3, N) [m] with attitudes (4, N)."""
    return State(places, np.zeros_like(places), attitudes, np.zeros_like(places), matrices(attitudes))


def step(vehicle: Vehicle, state: State, orders: Orders, disturbance: Floats, dt_ns: int) -> State:
    """Advance all vehicles by a step.

    The tilt's error, the rotation vector e from the body's z axis to f, sets the wanted rates ω* = e/τ about x and y;
    about z they are the ordered yaw rate. A torque M = J (ω* − ω)/τ_r tracks them:

    - ω̇ = J⁻¹ (M − ω × J ω)                     Nägeli 2014, (1)
    - q̇ = ½ q ⊙ (0, ω), or Ṙ = R skew(ω)         Nägeli 2014, (2)
    - v̇ = R (0, 0, max(f·b_z, 0))/m − g − c v + disturbance, with b_z the body's z axis

    e, ω and the rotation are exact for constant orders, but for ω × J ω, which is held over the step, and for the
    turning of e by yaw within it (first order in the step). v and p are exact for an acceleration that changes evenly
    over the step.

    Args:
        vehicle: parameters of all vehicles.
        state: at the start of the step.
        orders: constant over the step.
        disturbance: further acceleration, constant over the step, (3, N) [m/s²].
        dt_ns: length of the step.
    """
    by = _coefficients(vehicle, dt_ns)
    p, v, q, omega, R = state
    goal = _goal(R, orders)
    goal += by.goal_by_gyration * omega[_NEXT] * omega[_LAST]
    attitudes = products(q, exponentials(by.turn_by_goal * goal + by.turn_by_rate * omega))
    attitudes /= norms(attitudes)
    rates = by.rate_by_goal * goal + by.rate_by_rate * omega
    turned = matrices(attitudes)

    before = _pull(vehicle, R, orders)
    change = _pull(vehicle, turned, orders) - before
    held = before + disturbance
    held[2] -= GRAVITY
    velocities = by.kept * v + by.speed_by_held * held + by.speed_by_change * change
    places = p + by.way_by_speed * v + by.way_by_held * held + by.way_by_change * change
    return State(places, velocities, attitudes, rates, turned)


def accelerations(vehicle: Vehicle, state: State, orders: Orders, disturbance: Floats) -> Floats:
    """Specific force in inertial coordinates: all accelerations but gravity, (3, N) [m/s²]."""
    return _pull(vehicle, state.matrices, orders) - vehicle.drag * state.velocities + disturbance


_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


def _pull(vehicle: Vehicle, R: Floats, orders: Orders) -> Floats:
    """Acceleration by thrust: the component of f along the body's z axis, at least 0."""
    axes = R[:, 2]
    return np.asarray((np.maximum(dots(axes, orders.thrusts), 0.0) / vehicle.mass) * axes)


def _goal(R: Floats, orders: Orders) -> Floats:
    """Target of the attitude control in body coordinates: e about x and y [rad], the yaw rate about z [rad/s]."""
    x, y, z = turned_back(R, orders.directions)
    sine = np.hypot(x, y)
    factor = np.arctan2(sine, z) / np.maximum(sine, _TINY)
    goal = np.empty_like(orders.directions)
    goal[0] = -factor * y
    goal[1] = factor * x
    goal[2] = orders.yaw_rates
    return goal


class _Coefficients(NamedTuple):
    """A step as a linear map: `a_by_b` is the factor of b in a; those of the attitude have one row per axis, (3, 1)."""

    goal_by_gyration: Floats
    turn_by_goal: Floats
    turn_by_rate: Floats
    rate_by_goal: Floats
    rate_by_rate: Floats
    kept: float
    speed_by_held: float
    speed_by_change: float
    way_by_speed: float
    way_by_held: float
    way_by_change: float


@lru_cache(maxsize=_CACHED_STEPS)
def _coefficients(vehicle: Vehicle, dt_ns: int) -> _Coefficients:
    """The exact step of ė = −ω, ω̇ = (e/τ − ω)/τ_r, of a lag τ_r alone, and of the drag.

    −J⁻¹ (ω × J ω), which is the products ω_y ω_z, ω_z ω_x, ω_x ω_y with factors, adds to ω̇ what ττ_r times it would
    add to e, and τ_r times it to the yaw rate.
    """
    dt, tau, tau_r = dt_ns * 1e-9, vehicle.attitude_response, vehicle.rate_response
    x, y, z = vehicle.inertia
    mean = -0.5 / tau_r
    spread = math.sqrt(max(mean * mean - 1.0 / (tau * tau_r), 0.0))
    slow, fast = math.exp((mean + spread) * dt), math.exp((mean - spread) * dt)
    even = (slow + fast) / 2.0
    odd = (slow - fast) / (2.0 * spread) if spread > 0.0 else slow * dt
    kept = math.exp(-dt / tau_r)
    caught = tau_r * (1.0 - kept)
    decay, first, second, third = (_phi(order, -vehicle.drag * dt) for order in range(4))
    return _Coefficients(
        _column(tau * tau_r * (y - z) / x, tau * tau_r * (z - x) / y, tau_r * (x - y) / z),
        _column(1.0 - even + mean * odd, 1.0 - even + mean * odd, dt - caught),
        _column(odd, odd, caught),
        _column(odd / (tau * tau_r), odd / (tau * tau_r), 1.0 - kept),
        _column(even + mean * odd, even + mean * odd, kept),
        decay,
        dt * first,
        dt * second,
        dt * first,
        dt * dt * second,
        dt * dt * third,
    )


def _column(x: float, y: float, z: float) -> Floats:
    return np.array([[x], [y], [z]])


def _phi(order: int, z: float) -> float:
    """φ_n(z) = Σ_k z^k/(k + n)!, so that φ₀ = exp and φ_(n+1) = (φ_n − 1/n!)/z, without its cancellation."""
    return math.exp(z) if order == 0 else math.fsum(z**k / math.factorial(k + order) for k in range(_TERMS))
