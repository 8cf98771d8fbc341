"""A flight over a room: take-off, straight legs between waypoints, landing. Times are nanoseconds, lengths metres.

Every part follows s(τ) = 10τ³ − 15τ⁴ + 6τ⁵, which has no velocity and no acceleration at its ends; the tilt is the one
that a multirotor needs for its acceleration, with no yaw.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...units import check_fields_above_zero

GRAVITY = 9.81
_SECOND_NS = 1_000_000_000
_NOWHERE = (0.0, 0.0, 0.0, 0.0)
_GEAR = 0.25
"""Fraction of a fall in which the landing gear brakes it, with (1 − fraction)/fraction times gravity."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Position, attitude and motion of the vehicle.

    position, velocity, acceleration (3,) [m, m/s, m/s²], z up; roll and pitch [rad], turned as R = R_y(pitch) R_x(roll)
    body→inertial; roll and pitch rate of the body [rad/s]; specific_force along the body's z axis [m/s²].
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    roll: float
    pitch: float
    roll_rate: float
    pitch_rate: float
    specific_force: float


@dataclass(frozen=True)
class Tour:
    """A flight.

    waypoints: (x, y) [m], the first above the place of take-off, the last above that of landing.
    ground: height of the surface at the first and at the last waypoint [m].
    altitude: over the floor, of the legs [m]. speed: mean one of a leg [m/s].
    wait, take_off, landing: durations on the ground before, of the climb and of the descent [s]; it hovers for `wait`
    before the landing.
    drop: from this height over the surface it falls freely; in the last quarter of it the gear brakes the fall [m].
    sway: the altitude sways between the reference and so much above it [m]; sway_period: about that of one sway [s].

    Raises:
        BadInput: fewer than two waypoints, two alike one after the other, or a quantity out of its bounds.
    """

    waypoints: tuple[tuple[float, float], ...]
    ground: tuple[float, float] = (0.0, 0.0)
    altitude: float = 1.4
    speed: float = 0.5
    wait: float = 2.0
    take_off: float = 4.0
    landing: float = 5.0
    drop: float = 0.0
    sway: float = 0.05
    sway_period: float = 8.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        if len(self.waypoints) < 2 or any(first == second for first, second in pairwise(self.waypoints)):
            raise BadInput(f"waypoints {list(self.waypoints)}: at least two are needed, each other than the one before")
        check_fields_above_zero(self, "speed", "take_off", "landing", "sway_period")
        for name in ("wait", "drop", "sway"):
            if not getattr(self, name) >= 0:
                raise BadInput(f"{name} is {getattr(self, name):g}, it must be at least 0")
        if not self.altitude > max(self.ground) + self.drop:
            lowest = max(self.ground) + self.drop
            raise BadInput(
                f"altitude is {self.altitude:g} m, it must be above {lowest:g} m, where it takes off and lands"
            )

    @cached_property
    def legs_ns(self) -> tuple[int, ...]:
        """Starts of the legs, and end of the last one."""
        times = [round((self.wait + self.take_off) * _SECOND_NS)]
        for first, second in pairwise(self.waypoints):
            times.append(times[-1] + round(math.dist(first, second) / self.speed * _SECOND_NS))
        return tuple(times)

    @cached_property
    def take_off_ns(self) -> int:
        """Instant of the take-off."""
        return round(self.wait * _SECOND_NS)

    @cached_property
    def descent_ns(self) -> int:
        """Start of the descent."""
        return self.legs_ns[-1] + round(self.wait * _SECOND_NS)

    @cached_property
    def down_ns(self) -> int:
        """Instant from which it is at rest on the ground."""
        return self._touching_ns + round(_GEAR / (1 - _GEAR) * (self._touching_ns - self._falling_ns))

    @cached_property
    def _falling_ns(self) -> int:
        return self.descent_ns + round(self.landing * _SECOND_NS)

    @cached_property
    def _touching_ns(self) -> int:
        return self._falling_ns + round(math.sqrt(2 * self.drop * (1 - _GEAR) / GRAVITY) * _SECOND_NS)

    def pose(self, time_ns: int) -> Pose:
        """Pose at an instant."""
        motion = np.array([*self._across(time_ns), self._up(time_ns)])
        return _tilted(*motion.T)

    def _across(self, time_ns: int) -> Sequence[tuple[float, ...]]:
        """Position, velocity, acceleration and jerk along x, and along y."""
        starts = self.legs_ns
        leg = min(max(bisect_right(starts, time_ns) - 1, 0), len(starts) - 2)
        first, second = self.waypoints[leg], self.waypoints[leg + 1]
        share = _smooth(time_ns - starts[leg], starts[leg + 1] - starts[leg])
        return [
            (begin + (end - begin) * share[0], *((end - begin) * rate for rate in share[1:]))
            for begin, end in zip(first, second, strict=True)
        ]

    def _up(self, time_ns: int) -> tuple[float, ...]:
        """Height, its velocity, acceleration and jerk."""
        low, down = self.ground
        if time_ns >= self.down_ns:
            return (down, 0.0, 0.0, 0.0)
        if time_ns >= self._touching_ns:
            left, braking = (self.down_ns - time_ns) / _SECOND_NS, GRAVITY * (1 - _GEAR) / _GEAR
            return (down + braking / 2 * left**2, -braking * left, braking, 0.0)
        if time_ns >= self._falling_ns:
            fallen = (time_ns - self._falling_ns) / _SECOND_NS
            return (down + self.drop - GRAVITY / 2 * fallen**2, -GRAVITY * fallen, -GRAVITY, 0.0)
        climb = _smooth(time_ns - self.take_off_ns, self.legs_ns[0] - self.take_off_ns)
        descent = _smooth(time_ns - self.descent_ns, self._falling_ns - self.descent_ns)
        rise, fall = self.altitude - low, self.altitude - down - self.drop
        swing = self._swing(time_ns)
        height = low + rise * climb[0] - fall * descent[0] + swing[0]
        rates = zip(climb[1:], descent[1:], swing[1:], strict=True)
        return (height, *(rise * up - fall * under + side for up, under, side in rates))

    def _swing(self, time_ns: int) -> tuple[float, ...]:
        """Sway of the altitude during the legs: (1 − cos ωt)/2, a whole number of periods."""
        begin, end = self.legs_ns[0], self.legs_ns[-1]
        if not begin < time_ns < end:
            return _NOWHERE
        length = (end - begin) / _SECOND_NS
        omega = math.tau * max(round(length / self.sway_period), 1) / length
        phase, half = omega * (time_ns - begin) / _SECOND_NS, self.sway / 2
        sine, cosine = math.sin(phase), math.cos(phase)
        return (half * (1 - cosine), half * omega * sine, half * omega**2 * cosine, -half * omega**3 * sine)


def _smooth(time_ns: int, duration_ns: int) -> tuple[float, float, float, float]:
    """Completed fraction of a part of the flight, and its first three derivatives [1/s, 1/s², 1/s³]."""
    if time_ns <= 0:
        return _NOWHERE
    if time_ns >= duration_ns:
        return (1.0, 0.0, 0.0, 0.0)
    tau, rate = time_ns / duration_ns, _SECOND_NS / duration_ns
    rest = 1.0 - tau
    return (
        tau**3 * (10 - 15 * tau + 6 * tau**2),
        30 * (tau * rest) ** 2 * rate,
        60 * tau * rest * (1 - 2 * tau) * rate**2,
        60 * (1 - 6 * tau * rest) * rate**3,
    )


def _tilted(
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    acceleration: NDArray[np.float64],
    jerk: NDArray[np.float64],
) -> Pose:
    """Pose in which the thrust, along the body's z axis, gives an acceleration.

    f·R e₃ = a + g e₃ with R e₃ = (sin θ cos φ, −sin φ, cos θ cos φ) for roll φ and pitch θ. Body rates for no yaw:
    ω_x = φ̇ and ω_y = θ̇ cos φ, as Bavle 2017, (8). In free fall the tilt is 0.
    """
    x, y, z = acceleration.tolist()
    z += GRAVITY
    force = math.hypot(x, y, z)
    if force < 1e-9:
        return Pose(position, velocity, acceleration, 0.0, 0.0, 0.0, 0.0, 0.0)
    dx, dy, dz = jerk.tolist()
    pitch, upright = math.atan2(x, z), math.hypot(x, z)
    roll = math.atan2(-y, upright)
    pitch_change = (dx * z - x * dz) / upright**2
    roll_rate = (y * (x * dx + z * dz) / upright - upright * dy) / force**2
    return Pose(position, velocity, acceleration, roll, pitch, roll_rate, pitch_change * math.cos(roll), force)
