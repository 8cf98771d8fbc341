"""The quadrotor of Bassolillo 2025 for estimation: attitude, velocity and altitude from all sensors.

State x = (q, V, z, b_g, b_a): attitude (body → inertial), velocity north-east-down [m/s], z down [m], and biases of
gyroscope [rad/s] and accelerometer [m/s²] where they are estimated. Error δ = (θ, δV, δz, δb_g, δb_a) with q = q̃ ⊙
exp(θ), θ in body coordinates [rad]. Inputs u = (ω_s, a_s), disturbances w = (w_g, w_a, steps of the biases).
Letters: R = R(q), R₃ its third row, g = (0, 0, 9.81) m/s², M magnetic field [G], p position of a sensor [m].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...rotation_stacks import (
    conjugates,
    exp_quaternions,
    normalised_rows,
    quaternion_products,
    right_jacobians,
    skews,
    to_matrices,
)
from ...rotations import skew, unit
from ...units import (
    Gauss,
    Metres,
    MetresPerSecond,
    MetresPerSecondSquared,
    MetresPerSecondSquaredPerRootSecond,
    RadiansPerSecond,
    RadiansPerSecondPerRootSecond,
)
from .error_state import Noise, differences, retracted

Floats = NDArray[np.float64]

GRAVITY = np.array([0.0, 0.0, 9.81])
MAGNETOMETER, FLOW, RANGES = slice(0, 3), slice(3, 5), slice(5, 10)
"""Positions of the sensors' values among the R = 10 outputs; ranges: centre, front, right, back, left."""
GYROSCOPE, ACCELEROMETER = slice(0, 3), slice(3, 6)
"""Positions of the sensors' values among the U = 6 inputs."""
_ARMS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_DOWN = np.array([0.0, 0.0, 1.0])
_Q, _V, _Z = slice(0, 4), slice(4, 7), 7
_THETA, _DV, _DZ = slice(0, 3), slice(3, 6), 6


@dataclass(frozen=True)
class Deviations:
    """Standard deviations that a model assumes: of the sensors, Bassolillo 2025, Table I; the others are our own.

    gyroscope [rad/s], accelerometer [m/s²], magnetometer [G], flow [m/s], ranges [m].
    gyroscope_gap, accelerometer_gap: of an input whose sample is missing.
    gyroscope_walk [rad/s/√s], accelerometer_walk [m/s²/√s]: random walks of the biases.

    Raises:
        BadInput: one of them is not above 0.
    """

    gyroscope: RadiansPerSecond = 6e-6**0.5
    accelerometer: MetresPerSecondSquared = 2.5e-3**0.5
    magnetometer: Gauss = 2.5e-7**0.5
    flow: MetresPerSecond = 1e-6**0.5
    ranges: Metres = 2.6e-7**0.5
    gyroscope_gap: RadiansPerSecond = 0.1
    accelerometer_gap: MetresPerSecondSquared = 1.0
    gyroscope_walk: RadiansPerSecondPerRootSecond = 1e-4
    accelerometer_walk: MetresPerSecondSquaredPerRootSecond = 1e-3

    def __post_init__(self) -> None:
        """Check the bounds."""
        for name, value in vars(self).items():
            if not 0.0 < value < math.inf:
                raise BadInput(f"the standard deviation {name} is {value:g}, it must be above 0")


@dataclass(frozen=True)
class QuadrotorModel:
    """Configuration A: inertial measurement unit, optical flow and range sensors.

    q⁺ = q ⊙ exp((ω_s − b_g − w_g) T), V̇ = R (a_s − b_a − w_a) + g, ż = V₃          Bassolillo 2025, (7)–(13), (18)
    outputs Rᵀ M (14), the first two of Rᵀ V + ω × p (15), −(z + R₃·p) / R₃₃ (17)

    The accelerometer is an input: (13) is solved for the acceleration, with R at the middle of the step. In (15) ω is
    corrected by its bias, and the gyroscope's noise is added to that of the flow.

    Args:
        step_s: T [s].
        arm: distance of the outer range sensors from the centre [m].
        flow_at: position of the camera on the body [m].
        field: M, north-east-down [G].
        gyroscope_bias, accelerometer_bias: whether they are states.
        largest_gyroscope [rad/s], largest_accelerometer [m/s²]: bounds of |w|.
        lowest: lower bound of the altitude [m].
        printed_accelerometer: use (13) as printed, V̇ = R (a_s − …) − g.
        printed_range: use (17) as printed, five times −z / R₃₃.
    Raises:
        BadInput: a step or an arm that is not above 0, or bounds that exclude every value.
    """

    step_s: float = 0.01
    arm: float = 0.7
    flow_at: tuple[float, float, float] = (0.1, 0.05, 0.0)
    field: tuple[float, float, float] = (0.24, 0.02, 0.39)
    gyroscope_bias: bool = False
    accelerometer_bias: bool = False
    largest_gyroscope: float = 0.05
    largest_accelerometer: float = 1.0
    lowest: float = 0.0
    printed_accelerometer: bool = False
    printed_range: bool = False
    deviations: Deviations = Deviations()

    def __post_init__(self) -> None:
        """Check the bounds, those of the noise included."""
        for name, value in (("step", self.step_s), ("arm", self.arm)):
            if not 0.0 < value < math.inf:
                raise BadInput(f"{name} is {value:g}, it must be above 0")
        _ = self.noise

    @property
    def size(self) -> int:
        """N."""
        return 7 + 3 * (self.gyroscope_bias + self.accelerometer_bias)

    @cached_property
    def gyroscope_errors(self) -> slice:
        """Positions of the gyroscope's bias among the errors; among the states they are one higher."""
        return slice(7, 10) if self.gyroscope_bias else slice(7, 7)

    @cached_property
    def accelerometer_errors(self) -> slice:
        """Positions of the accelerometer's bias among the errors; among the states they are one higher."""
        start = self.gyroscope_errors.stop
        return slice(start, start + 3) if self.accelerometer_bias else slice(start, start)

    @cached_property
    def resting(self) -> Floats:
        """Readings of the inertial measurement unit at rest and level."""
        return np.concatenate([np.zeros(3), GRAVITY if self.printed_accelerometer else -GRAVITY])

    @cached_property
    def noise(self) -> Noise:
        """Standard deviations and bounds of all components."""
        own, root = self.deviations, math.sqrt(self.step_s)
        walks = [own.gyroscope_walk * root] * (3 * self.gyroscope_bias)
        walks += [own.accelerometer_walk * root] * (3 * self.accelerometer_bias)
        swing = own.gyroscope * math.hypot(*self.flow_at)
        upper = np.full(self.size, np.inf)
        upper[_DZ] = -self.lowest
        return Noise(
            np.array([own.gyroscope] * 3 + [own.accelerometer] * 3 + walks),
            np.array([own.gyroscope_gap] * 3 + [own.accelerometer_gap] * 3 + walks),
            np.array([self.largest_gyroscope] * 3 + [self.largest_accelerometer] * 3 + [np.inf] * len(walks)),
            np.array([own.magnetometer] * 3 + [math.hypot(own.flow, swing)] * 2 + [own.ranges] * 5),
            np.full(self.size, -np.inf),
            upper,
        )

    def start(self, attitude: Floats, altitude: float) -> Floats:
        """The state (S,) at rest, with biases of 0.

        Raises:
            BadInput: a quaternion whose norm is not 1.
        """
        state = np.zeros(self.size + 1)
        state[_Q], state[_Z] = unit(attitude, "the initial attitude"), -altitude
        return state

    def dynamics(self, states: Floats, inputs: Floats, disturbances: Floats) -> tuple[Floats, Floats, Floats]:
        """The next states, A and B; see `error_state.Model`.

        A step is two rotations by v = ½ ω T, exp(2 v) = exp(v) ⊙ exp(v), so J(2 v) = ½ (R(−v) J(v) + J(v)).
        """
        T, n, N = self.step_s, len(states), self.size
        rates, forces = self._corrected(states, inputs, disturbances)
        turns = 0.5 * T * rates
        half = exp_quaternions(turns)
        halfway = quaternion_products(states[:, _Q], half)
        middle, back, J = to_matrices(halfway), to_matrices(conjugates(half)), right_jacobians(turns)
        swung = middle @ skews(forces)
        gravity = -GRAVITY if self.printed_accelerometer else GRAVITY
        following = states.copy()
        following[:, _Q] = normalised_rows(quaternion_products(halfway, half))
        following[:, _V] += T * ((middle @ forces[:, :, np.newaxis])[:, :, 0] + gravity)
        following[:, _Z] += 0.5 * T * (states[:, 6] + following[:, 6])
        following[:, 8:] += disturbances[:, 6:]
        A, B = np.zeros((n, N, N)), np.zeros((n, N, disturbances.shape[1]))
        A[:] = np.eye(N)
        A[:, _THETA, _THETA] = back @ back
        A[:, _DV, _THETA] = -T * swung @ back
        A[:, _DZ, _THETA], A[:, _DZ, 5] = 0.5 * T * A[:, 5, _THETA], T
        B[:, _THETA, GYROSCOPE] = -0.5 * T * (back @ J + J)
        B[:, _DV, GYROSCOPE] = (0.5 * T * T) * swung @ J
        B[:, _DV, ACCELEROMETER] = -T * middle
        B[:, _DZ] = 0.5 * T * B[:, 5]
        if self.gyroscope_bias:
            A[:, :7, self.gyroscope_errors] = B[:, :7, GYROSCOPE]
        if self.accelerometer_bias:
            A[:, :7, self.accelerometer_errors] = B[:, :7, ACCELEROMETER]
        B[:, 7:, 6:] = np.eye(N - 7)
        return following, A, B

    def outputs(self, states: Floats, inputs: Floats) -> tuple[Floats, Floats]:
        """Magnetometer, flow and ranges, and C; see `error_state.Model`."""
        n, p, arms = len(states), np.array(self.flow_at), (0.0 if self.printed_range else self.arm) * _ARMS
        expected, C = np.empty((n, 10)), np.zeros((n, 10, self.size))
        R = to_matrices(states[:, _Q])
        magnetic, velocity = np.array(self.field) @ R, (states[:, np.newaxis, _V] @ R)[:, 0]
        expected[:, MAGNETOMETER], C[:, MAGNETOMETER, _THETA] = magnetic, skews(magnetic)
        rates = inputs[:, GYROSCOPE]
        if self.gyroscope_bias:
            rates = rates - states[:, self._shifted(self.gyroscope_errors)]
            C[:, FLOW, self.gyroscope_errors] = skew(p)[:2]
        expected[:, FLOW] = (velocity + rates @ skew(p))[:, :2]
        C[:, FLOW, _THETA] = skews(velocity)[:, :2]
        C[:, FLOW, _DV] = R.transpose(0, 2, 1)[:, :2]
        third, upright = R[:, 2], R[:, 2, 2:]
        distances = -(states[:, _Z, np.newaxis] + third @ arms.T) / upright
        expected[:, RANGES] = distances
        levers = (arms + distances[:, :, np.newaxis] * _DOWN) / upright[:, :, np.newaxis]
        C[:, RANGES, _THETA] = levers @ skews(third).transpose(0, 2, 1)
        C[:, RANGES, _DZ] = -1.0 / upright
        return expected, C

    def retract(self, states: Floats, errors: Floats) -> Floats:
        """X ⊞ δ: q ⊙ exp(θ), and sums of the rest."""
        return retracted(states, errors)

    def difference(self, states: Floats, references: Floats) -> Floats:
        """X ⊟ x̃: log(q̃* ⊙ q), and differences of the rest."""
        return differences(states, references)

    def components(self, states: Floats) -> Floats:
        """Bounded components: zeros for the attitude, which has no bound, and the rest of the state."""
        return np.concatenate([np.zeros((len(states), 3)), states[:, 4:]], axis=1)

    def _corrected(self, states: Floats, inputs: Floats, disturbances: Floats) -> tuple[Floats, Floats]:
        """Rates and specific forces minus disturbances and biases, (n, 3) each."""
        less = inputs - disturbances[:, :6]
        rates, forces = less[:, GYROSCOPE], less[:, ACCELEROMETER]
        if self.gyroscope_bias:
            rates = rates - states[:, self._shifted(self.gyroscope_errors)]
        if self.accelerometer_bias:
            forces = forces - states[:, self._shifted(self.accelerometer_errors)]
        return rates, forces

    @staticmethod
    def _shifted(errors: slice) -> slice:
        """Positions of errors among the states, which are one higher, as the attitude has four entries there."""
        return slice(errors.start + 1, errors.stop + 1)
