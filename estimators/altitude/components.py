"""Components of the altitude filter of Bavle 2017: robot, ground, inertial measurement unit, barometer, range finder.

A component has states and their motion model; a sensor also has a measurement model. `modular_filter` combines any
number of them. Letters: z height, φ roll, θ pitch, ω body rates, z_G height of the ground, b bias.
Yaw and yaw rate are left out: no measurement depends on them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ...units import (
    Metres,
    MetresPerRootSecond,
    MetresPerSecondSquared,
    MetresPerSecondSquaredPerRootSecond,
    Radians,
    RadiansPerSecond,
    RadiansPerSecondPerRootSecond,
    check_fields_above_zero,
)

GRAVITY = 9.81
ROBOT_STATES = 7
Floats = NDArray[np.float64]


class State(NamedTuple):
    """A state of a component: name, initial value, its standard deviation, and its random walk.

    All in the state's unit; the walk in that unit per √s.
    """

    name: str
    start: float
    deviation: float
    walk: float = 0.0


class Blocks(NamedTuple):
    """Blocks of a sensor's Jacobian, initially zero: by robot (m, 7), ground (m,) and own states (m, k)."""

    by_robot: Floats
    by_ground: Floats
    by_own: Floats


class Component(Protocol):
    """A part of the filter with any number of states, perhaps none."""

    def states(self) -> tuple[State, ...]:
        """The states, in order."""

    def move(self, own: Floats, jacobian: Floats, dt: float) -> None:
        """Propagate the own states (k,) by dt [s] without noise, and set the Jacobian (k, k), both in place.

        The Jacobian is given as the identity. Do nothing for states that only noise changes.
        """


class Sensor(Component, Protocol):
    """A component that measures."""

    @property
    def sees_ground(self) -> bool:
        """Whether the measurement depends on the height of the ground."""

    def variances(self) -> Floats:
        """Noise variances (m,) of the values of a sample, which are independent."""

    def expected(self, robot: Floats, ground: float, own: Floats, blocks: Blocks) -> Floats:
        """Expected measurement (m,); writes the derivatives into the blocks."""


@dataclass(frozen=True)
class Robot:
    """The vehicle: z, v, a, φ, θ, ω_x, ω_y [m, m/s, m/s², rad, rad/s].

    z⁺ = z + v dt + a dt²/2, v⁺ = v + a dt, (φ, θ)⁺ = (φ, θ) + ω dt; a and ω are random walks   Bavle 2017, (12)–(18)

    altitude: initial altitude; deviation: its standard deviation.
    """

    altitude: Metres = 0.0
    deviation: Metres = 0.02
    acceleration_walk: MetresPerSecondSquaredPerRootSecond = 1.0
    turning_walk: RadiansPerSecondPerRootSecond = 1.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(self, "deviation", "acceleration_walk", "turning_walk")

    def states(self) -> tuple[State, ...]:
        """Seven states; initially at rest and level."""
        return (
            State("z", self.altitude, self.deviation),
            State("v", 0.0, 0.1),
            State("a", 0.0, 0.1, self.acceleration_walk),
            State("roll", 0.0, 0.1),
            State("pitch", 0.0, 0.1),
            State("roll rate", 0.0, 0.1, self.turning_walk),
            State("pitch rate", 0.0, 0.1, self.turning_walk),
        )

    def move(self, own: Floats, jacobian: Floats, dt: float) -> None:
        """Propagate with constant acceleration and constant rates."""
        jacobian[0, 1] = jacobian[1, 2] = jacobian[3, 5] = jacobian[4, 6] = dt
        jacobian[0, 2] = dt * dt / 2
        own[:] = jacobian @ own


@dataclass(frozen=True)
class Ground:
    """The surface below the vehicle: its height z_G [m], never below 0, the lowest point of the room.

    z_G⁺ = z_G if z_G > 0, else 0, with Jacobian 1 and 0, plus a random walk         Bavle 2017, (19)–(20)

    height: initial height; deviation: its standard deviation.
    """

    height: Metres = 0.0
    deviation: Metres = 0.02
    walk: MetresPerRootSecond = 0.01

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(self, "deviation", "walk")

    def states(self) -> tuple[State, ...]:
        """The height z_G."""
        return (State("ground", self.height, self.deviation, self.walk),)

    def move(self, own: Floats, jacobian: Floats, dt: float) -> None:
        """Clamp the height at the floor."""
        if own[0] <= 0.0:
            own[0] = jacobian[0, 0] = 0.0


@dataclass(frozen=True)
class Imu:
    """Acceleration, roll, pitch, roll and pitch rate; state: bias of the accelerometer b_a [m/s²].

    (a + g + b_a, φ, θ, ω_x, ω_y)         Bavle 2017, (21)–(33)
    """

    acceleration_noise: MetresPerSecondSquared = 0.2
    attitude_noise: Radians = 0.01
    gyro_noise: RadiansPerSecond = 0.02
    bias_deviation: MetresPerSecondSquared = 0.3
    bias_walk: MetresPerSecondSquaredPerRootSecond = 0.005

    sees_ground = False

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(
            self, "acceleration_noise", "attitude_noise", "gyro_noise", "bias_deviation", "bias_walk"
        )

    def states(self) -> tuple[State, ...]:
        """One bias."""
        return (State("accelerometer bias", 0.0, self.bias_deviation, self.bias_walk),)

    def move(self, own: Floats, jacobian: Floats, dt: float) -> None:
        """The bias walks, and nothing else."""

    def variances(self) -> Floats:
        """Noise variances of the five values."""
        noise = [self.acceleration_noise, *[self.attitude_noise] * 2, *[self.gyro_noise] * 2]
        return np.square(noise)

    def expected(self, robot: Floats, ground: float, own: Floats, blocks: Blocks) -> Floats:
        """Expected measurement for small tilts, (26), (28)–(29), (31)–(32)."""
        blocks.by_robot[:] = _IMU_BY_ROBOT
        blocks.by_own[0, 0] = 1.0
        values: Floats = robot[2:].copy()
        values[0] += GRAVITY + own[0]
        return values


@dataclass(frozen=True)
class Barometer:
    """Height with a bias; state: the bias b_b [m].

    z + b_b         Bavle 2017, (34)–(37)
    """

    noise: Metres = 0.2
    bias_deviation: Metres = 1.0
    bias_walk: MetresPerRootSecond = 0.03

    sees_ground = False

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(self, "noise", "bias_deviation", "bias_walk")

    def states(self) -> tuple[State, ...]:
        """One bias."""
        return (State("barometer bias", 0.0, self.bias_deviation, self.bias_walk),)

    def move(self, own: Floats, jacobian: Floats, dt: float) -> None:
        """The bias walks, and nothing else."""

    def variances(self) -> Floats:
        """Of the one value."""
        return np.array([self.noise**2])

    def expected(self, robot: Floats, ground: float, own: Floats, blocks: Blocks) -> Floats:
        """Expected measurement z + b_b."""
        blocks.by_robot[0, 0] = blocks.by_own[0, 0] = 1.0
        return robot[:1] + own


@dataclass(frozen=True)
class RangeFinder:
    """Distance to the ground along the body's downward axis; no state.

    (z − z_G) / (cos φ cos θ)         Bavle 2017, (38)–(39)
    """

    noise: Metres = 0.03

    sees_ground = True

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(self, "noise")

    def states(self) -> tuple[State, ...]:
        """No states."""
        return ()

    def move(self, own: Floats, jacobian: Floats, dt: float) -> None:
        """Do nothing: there are no states."""

    def variances(self) -> Floats:
        """Of the one value."""
        return np.array([self.noise**2])

    def expected(self, robot: Floats, ground: float, own: Floats, blocks: Blocks) -> Floats:
        """Expected distance, with derivatives by height, roll, pitch and ground."""
        height, roll, pitch = robot[0], robot[3], robot[4]
        upright = math.cos(roll) * math.cos(pitch)
        distance = (height - ground) / upright
        by_robot = blocks.by_robot[0]
        by_robot[0], by_robot[3], by_robot[4] = 1 / upright, distance * math.tan(roll), distance * math.tan(pitch)
        blocks.by_ground[0] = -1 / upright
        return np.array([distance])


_IMU_BY_ROBOT = np.eye(ROBOT_STATES)[2:]
