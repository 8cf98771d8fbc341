"""A quadrotor that flies manoeuvres: rigid body, four rotors, control of attitude and altitude, integrated once.

Frames: inertial is north-east-down with its origin on the ground, altitude h = −z; body is forward-right-down.
Letters: q attitude (body → inertial), V velocity [m/s], z [m], ω body rates [rad/s], R = R(q), g = (0, 0, 9.81) m/s².
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...rotations import conjugate, euler_to_quaternion, normalised, quaternion_product, quaternion_rate, to_matrix
from ...units import check_above_zero
from ..signals import Constant, Signal

Floats = NDArray[np.float64]

GRAVITY = 9.81
_GRID_NS = 5_000_000
_Q, _V, _Z, _RATES = slice(0, 4), slice(4, 7), 7, slice(8, 11)
_STEEPEST = math.cos(1.4)
_LEVEL, _HOVER = Constant(0.0), Constant(10.0)


@dataclass(frozen=True)
class Airframe:
    """The airframe: mass [kg], inertia [kg m²] and arm [m] of Bassolillo 2025, Table I; the rest is ours.

    Rotors stand at the ends of arms along ±x and ±y, push up with 0 to `strongest` [N] each, and turn the body about z
    by `turn` [m] times their thrust, front and back one way, left and right the other. Control closes attitude at
    `tilt_pace` and `yaw_pace` and altitude at `climb_pace` [rad/s], critically damped.

    Raises:
        BadInput: a number that is not above 0, or rotors that cannot carry the mass.
    """

    mass: float = 1.0
    inertia: tuple[float, float, float] = (0.05, 0.05, 0.1)
    arm: float = 0.7
    strongest: float = 6.0
    turn: float = 0.05
    tilt_pace: float = 6.0
    yaw_pace: float = 3.0
    climb_pace: float = 2.5

    def __post_init__(self) -> None:
        """Check the bounds."""
        for name, values in vars(self).items():
            for value in values if isinstance(values, tuple) else (values,):
                check_above_zero(name, value)
        if not 4.0 * self.strongest > self.mass * GRAVITY:
            raise BadInput(f"four rotors of {self.strongest:g} N cannot carry {self.mass:g} kg: give stronger ones")

    def rotors(self, thrust: float, torque: tuple[float, float, float]) -> tuple[float, float, float, float]:
        """Thrusts of front, right, back and left rotor [N] for a total [N] and torques [N m]; clipped."""
        roll, pitch, yaw = torque[0] / self.arm, torque[1] / self.arm, torque[2] / self.turn
        along, across = 0.5 * (thrust + yaw), 0.5 * (thrust - yaw)
        wanted = (0.5 * (along + pitch), 0.5 * (across - roll), 0.5 * (along - pitch), 0.5 * (across + roll))
        front, right, back, left = (min(max(rotor, 0.0), self.strongest) for rotor in wanted)
        return front, right, back, left

    def wrench(self, rotors: tuple[float, float, float, float]) -> tuple[float, tuple[float, float, float]]:
        """Total thrust [N] and torques [N m] that the rotors give."""
        front, right, back, left = rotors
        turning = self.turn * (front - right + back - left)
        return front + right + back + left, (self.arm * (left - right), self.arm * (front - back), turning)


@dataclass(frozen=True)
class Manoeuvre:
    """Setpoints of the controller: roll, pitch and yaw [rad], altitude [m]; by default hovering at 10 m.

    Raises:
        BadInput: an altitude that goes down to 0, or a tilt beyond 1 rad.
    """

    roll: Signal = _LEVEL
    pitch: Signal = _LEVEL
    yaw: Signal = _LEVEL
    altitude: Signal = _HOVER

    def __post_init__(self) -> None:
        """Check altitude and tilt."""
        lowest, _ = self.altitude.bounds()
        if not lowest > 0.0:
            raise BadInput(f"altitude goes down to {lowest:g} m: keep it above 0")
        for name, signal in (("roll", self.roll), ("pitch", self.pitch)):
            steepest = max(map(abs, signal.bounds()))
            if not steepest <= 1.0:
                raise BadInput(f"{name} goes to {steepest:g} rad: keep it within 1 rad, where the rotors carry")


@dataclass(frozen=True)
class FlightState:
    """State and acceleration of a quadrotor.

    attitude: unit quaternion, (4,). velocity: inertial, (3,) [m/s]. height: −z [m]. rates: body, (3,) [rad/s].
    rotation: R(q), (3, 3). acceleration: V̇, inertial, (3,) [m/s²].
    """

    attitude: Floats
    velocity: Floats
    height: float
    rates: Floats
    rotation: Floats
    acceleration: Floats


class Flight:
    """The motion of an airframe through a manoeuvre, from hovering at rest at its first altitude.

    q̇ = ½ q ⊙ (0, ω), V̇ = g − R e₃ T / m, ż = V₃            Bassolillo 2025, (7)–(10)
    J ω̇ = τ − ω × J ω

    Integrated on demand with the classical Runge-Kutta method on a grid of 5 ms, and one shorter step between two grid
    points, so that the motion at an instant does not depend on earlier calls.
    """

    def __init__(self, airframe: Airframe, manoeuvre: Manoeuvre) -> None:
        self._airframe = airframe
        self._manoeuvre = manoeuvre
        yaw, altitude = manoeuvre.yaw.value(0), manoeuvre.altitude.value(0)
        roll, pitch = manoeuvre.roll.value(0), manoeuvre.pitch.value(0)
        first = np.zeros(11)
        first[_Q], first[_Z] = euler_to_quaternion(roll, pitch, yaw), -altitude
        self._grid = [first]

    def at(self, time_ns: int) -> FlightState:
        """The motion at an instant, which is at least 0."""
        index, rest_ns = divmod(time_ns, _GRID_NS)
        while len(self._grid) <= index:
            self._grid.append(self._step(self._grid[-1], (len(self._grid) - 1) * _GRID_NS, _GRID_NS))
        state = self._grid[index]
        if rest_ns:
            state = self._step(state, index * _GRID_NS, rest_ns)
        slope = self._slope(state, time_ns)
        attitude, velocity, rates = state[_Q].copy(), state[_V].copy(), state[_RATES].copy()
        return FlightState(attitude, velocity, -float(state[_Z]), rates, to_matrix(attitude), slope[_V])

    def _step(self, state: Floats, time_ns: int, step_ns: int) -> Floats:
        step, middle_ns = step_ns * 1e-9, time_ns + step_ns // 2
        first = self._slope(state, time_ns)
        second = self._slope(state + 0.5 * step * first, middle_ns)
        third = self._slope(state + 0.5 * step * second, middle_ns)
        fourth = self._slope(state + step * third, time_ns + step_ns)
        after = state + step / 6.0 * (first + 2.0 * (second + third) + fourth)
        after[_Q] = normalised(after[_Q])
        return after

    def _slope(self, state: Floats, time_ns: int) -> Floats:
        airframe, q = self._airframe, state[_Q]
        third = to_matrix(q)[:, 2]
        thrust, torque = airframe.wrench(self._rotors(state, float(third[2]), time_ns))
        slope = np.empty(11)
        slope[_Q] = quaternion_rate(q, state[_RATES])
        slope[_V] = (-thrust / airframe.mass) * third
        slope[_V.stop - 1] += GRAVITY
        slope[_Z] = state[_V.stop - 1]
        slope[_RATES] = [
            (given - turned) / inertia
            for given, turned, inertia in zip(torque, self._gyroscopic(state), airframe.inertia, strict=True)
        ]
        return slope

    def _gyroscopic(self, state: Floats) -> tuple[float, float, float]:
        """ω × J ω [N m]."""
        p, q, r = state[_RATES].tolist()
        x, y, z = self._airframe.inertia
        return (z - y) * q * r, (x - z) * r * p, (y - x) * p * q

    def _rotors(self, state: Floats, upright: float, time_ns: int) -> tuple[float, float, float, float]:
        """Thrusts of the four rotors [N]: proportional-derivative control with the gyroscopic torque compensated."""
        airframe, wanted = self._airframe, self._manoeuvre
        target = euler_to_quaternion(*(signal.value(time_ns) for signal in (wanted.roll, wanted.pitch, wanted.yaw)))
        scalar, *vector = quaternion_product(conjugate(target), state[_Q]).tolist()
        side = math.copysign(2.0, scalar)
        paces = (airframe.tilt_pace, airframe.tilt_pace, airframe.yaw_pace)
        x, y, z = (
            turned - inertia * pace * (pace * side * error + 2.0 * rate)
            for turned, inertia, pace, error, rate in zip(
                self._gyroscopic(state), airframe.inertia, paces, vector, state[_RATES].tolist(), strict=True
            )
        )
        climb, below = airframe.climb_pace, wanted.altitude.value(time_ns) + float(state[_Z])
        lift = climb * (climb * below + 2.0 * float(state[_V.stop - 1]))
        return airframe.rotors(airframe.mass * (GRAVITY + lift) / max(upright, _STEEPEST), (x, y, z))


@lru_cache(maxsize=16)
def flight(airframe: Airframe, manoeuvre: Manoeuvre) -> Flight:
    """The flight, cached; without effect on its values."""
    return Flight(airframe, manoeuvre)
