"""The quadrotor of Bassolillo 2025 with only an inertial measurement unit: attitude from gravity and magnetic field.

State x = (q, b_g), error δ = (θ, δb_g), inputs u = ω_s, disturbances w = (w_g, steps of the bias); letters as in
`quadrotor_model`.
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
from ...rotations import unit
from .error_state import Noise, differences, retracted
from .quadrotor_model import GRAVITY, Deviations

Floats = NDArray[np.float64]

MAGNETOMETER, ACCELEROMETER = slice(0, 3), slice(3, 6)
"""Positions of the sensors' values among the R = 6 outputs."""
_Q, _THETA, _RATES = slice(0, 4), slice(0, 3), slice(0, 3)


@dataclass(frozen=True)
class AttitudeModel:
    """Configuration B: inertial measurement unit only.

    q⁺ = q ⊙ exp((ω_s − b_g − w_g) T)            Bassolillo 2025, (7)
    outputs Rᵀ M (14), and −Rᵀ g for (13), assuming zero acceleration, which is unobservable

    Args:
        step_s: T [s].
        field: M, north-east-down [G].
        gyroscope_bias: whether the bias is a state.
        largest_gyroscope: bound of |w_g| [rad/s].
        printed_accelerometer: use (13) as printed, +Rᵀ g.
    Raises:
        BadInput: a step that is not above 0, or bounds that exclude every value.
    """

    step_s: float = 0.01
    field: tuple[float, float, float] = (0.24, 0.02, 0.39)
    gyroscope_bias: bool = False
    largest_gyroscope: float = 0.05
    printed_accelerometer: bool = False
    deviations: Deviations = Deviations()  # noqa: RUF009 - it is frozen

    def __post_init__(self) -> None:
        """Check the bounds, those of the noise included."""
        if not 0.0 < self.step_s < math.inf:
            raise BadInput(f"step is {self.step_s:g}, it must be above 0")
        _ = self.noise

    @property
    def size(self) -> int:
        """N."""
        return 6 if self.gyroscope_bias else 3

    @property
    def resting(self) -> Floats:
        """Reading of a gyroscope at rest."""
        return np.zeros(3)

    @cached_property
    def noise(self) -> Noise:
        """Standard deviations and bounds of all components."""
        own = self.deviations
        walks = [own.gyroscope_walk * math.sqrt(self.step_s)] * (self.size - 3)
        return Noise(
            np.array([own.gyroscope] * 3 + walks),
            np.array([own.gyroscope_gap] * 3 + walks),
            np.array([self.largest_gyroscope] * 3 + [np.inf] * len(walks)),
            np.array([own.magnetometer] * 3 + [own.accelerometer] * 3),
            np.full(self.size, -np.inf),
            np.full(self.size, np.inf),
        )

    def start(self, attitude: Floats) -> Floats:
        """The state (S,) with a bias of 0.

        Raises:
            BadInput: a quaternion whose norm is not 1.
        """
        return np.concatenate([unit(attitude, "the initial attitude"), np.zeros(self.size - 3)])

    def dynamics(self, states: Floats, inputs: Floats, disturbances: Floats) -> tuple[Floats, Floats, Floats]:
        """The next states, A and B; see `error_state.Model`."""
        T, n, N = self.step_s, len(states), self.size
        rates = inputs - disturbances[:, _RATES] - (states[:, 4:] if self.gyroscope_bias else 0.0)
        full = exp_quaternions(T * rates)
        turned = normalised_rows(quaternion_products(states[:, _Q], full))
        following = np.concatenate([turned, states[:, 4:] + disturbances[:, 3:]], axis=1)
        A, B = np.zeros((n, N, N)), np.zeros((n, N, N))
        A[:, 3:, 3:] = B[:, 3:, 3:] = np.eye(N - 3)
        A[:, _THETA, _THETA] = to_matrices(conjugates(full))
        B[:, _THETA, _THETA] = -T * right_jacobians(T * rates)
        if self.gyroscope_bias:
            A[:, _THETA, 3:] = B[:, _THETA, _THETA]
        return following, A, B

    def outputs(self, states: Floats, inputs: Floats) -> tuple[Floats, Floats]:
        """Magnetometer and accelerometer, and C; see `error_state.Model`."""
        expected, C = np.empty((len(states), 6)), np.zeros((len(states), 6, self.size))
        R = to_matrices(states[:, _Q])
        magnetic, felt = np.array(self.field) @ R, (GRAVITY if self.printed_accelerometer else -GRAVITY) @ R
        expected[:, MAGNETOMETER], C[:, MAGNETOMETER, _THETA] = magnetic, skews(magnetic)
        expected[:, ACCELEROMETER], C[:, ACCELEROMETER, _THETA] = felt, skews(felt)
        return expected, C

    def retract(self, states: Floats, errors: Floats) -> Floats:
        """X ⊞ δ: q ⊙ exp(θ), and the sum of the biases."""
        return retracted(states, errors)

    def difference(self, states: Floats, references: Floats) -> Floats:
        """X ⊟ x̃: log(q̃* ⊙ q), and the difference of the biases."""
        return differences(states, references)

    def components(self, states: Floats) -> Floats:
        """Bounded components: zeros for the attitude, which has no bound, and the bias."""
        return np.concatenate([np.zeros((len(states), 3)), states[:, 4:]], axis=1)
