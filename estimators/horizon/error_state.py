"""Error-state models on a uniform time grid: their interface for estimators, and the two steps of the Kalman filter.

Letters: S entries of a state x, N of its error δ, U inputs u, M disturbances w, R measured values y; x ⊞ δ is the state
whose error relative to x is δ, and ⊟ the inverse; A, B, C are the Jacobians of errors, P a covariance (N, N).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...rotation_stacks import conjugates, exp_quaternions, log_quaternions, normalised_rows, quaternion_products
from ..checks import as_array

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Noise:
    """Standard deviations and bounds of a model, by component.

    disturbances (M,): standard deviations of w. gaps (M,): the same for a step whose inputs were not measured at both
    ends. bounds (M,): of |w| if they were. measurements (R,): standard deviations of the noise.
    lower, upper (N,): bounds of `Model.components`.

    Raises:
        BadInput: a deviation that is not above 0, or bounds that exclude every value.
    """

    disturbances: Floats
    gaps: Floats
    bounds: Floats
    measurements: Floats
    lower: Floats
    upper: Floats

    def __post_init__(self) -> None:
        """Check the bounds."""
        for name in ("disturbances", "gaps", "measurements"):
            values = getattr(self, name)
            if not ((values > 0.0) & np.isfinite(values)).all():
                raise BadInput(f"standard deviations of {name} are {values.tolist()}: each must be above 0")
        if not (self.bounds >= 0.0).all():
            raise BadInput(f"bounds of disturbances are {self.bounds.tolist()}: no value is within a bound below 0")
        if not (self.lower <= self.upper).all():
            raise BadInput(
                f"the state is bounded from {self.lower.tolist()} to {self.upper.tolist()}, which leaves no value: "
                "give lower bounds that are not above the upper ones"
            )


class Model(Protocol):
    """A discrete-time model; its functions take n points at once. The first U disturbances are those of the inputs.

    A (n, N, N) and B (n, N, M) are the derivatives of the error of the next state by error and disturbances, and
    C (n, R, N) those of the outputs by error, at the given states, inputs and disturbances.
    """

    @property
    def noise(self) -> Noise:
        """Standard deviations and bounds."""

    @property
    def resting(self) -> Floats:
        """Inputs (U,) assumed until the first are measured."""

    def dynamics(self, states: Floats, inputs: Floats, disturbances: Floats) -> tuple[Floats, Floats, Floats]:
        """Next states (n, S), A and B, from states (n, S), inputs over the step (n, U) and disturbances (n, M)."""

    def outputs(self, states: Floats, inputs: Floats) -> tuple[Floats, Floats]:
        """Measured values without noise (n, R) and C, from states (n, S) and inputs at that instant (n, U)."""

    def retract(self, states: Floats, errors: Floats) -> Floats:
        """X ⊞ δ, (n, S), of states (n, S) and errors (n, N)."""

    def difference(self, states: Floats, references: Floats) -> Floats:
        """X ⊟ x̃, (n, N), of states (n, S) and references (n, S)."""

    def components(self, states: Floats) -> Floats:
        """Quantities to which bounds apply, (n, N); a bounded entry i must change by exactly the i-th error."""


@dataclass(frozen=True)
class Inputs:
    """Inputs of K points with gaps filled: at the points (K, U), and over the steps between them (K−1, U).

    The input of a step is the mean of its ends. measured (K−1, U): whether it was measured at both ends.
    """

    at_points: Floats
    of_steps: Floats
    measured: NDArray[np.bool_]


def completed(inputs: Floats, before: Floats) -> Inputs:
    """Fill missing inputs, which are NaN in (K, U), by linear interpolation.

    At the first point a missing input is `before` (U,); after the last measured one it stays constant.
    """
    missing = np.isnan(inputs)
    filled = inputs.copy()
    if missing.any():
        filled[0] = np.where(missing[0], before, filled[0])
        places = np.arange(len(inputs))
        for column in filled.T:
            there = ~np.isnan(column)
            column[:] = np.interp(places, places[there], column[there])
    return Inputs(filled, 0.5 * (filled[:-1] + filled[1:]), ~(missing[:-1] | missing[1:]))


def step_deviations(noise: Noise, measured: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Deviations and bounds of the disturbances of steps, (n, M) each; `measured` (n, U) as in `Inputs`.

    The disturbance of an input that was not measured is not sensor noise: it has the deviation of a gap, and no bound.
    """
    others = np.ones((len(measured), len(noise.disturbances) - measured.shape[1]), dtype=bool)
    normal = np.concatenate([measured, others], axis=1)
    return np.where(normal, noise.disturbances, noise.gaps), np.where(normal, noise.bounds, np.inf)


def retracted(states: Floats, errors: Floats) -> Floats:
    """X ⊞ δ for states (n, S) that begin with a quaternion q, errors (n, S − 1): q ⊙ exp(θ), and sums of the rest."""
    turned = quaternion_products(states[:, :4], exp_quaternions(errors[:, :3]))
    return np.concatenate([normalised_rows(turned), states[:, 4:] + errors[:, 3:]], axis=1)


def differences(states: Floats, references: Floats) -> Floats:
    """X ⊟ x̃ for states that begin with a quaternion: log(q̃* ⊙ q), and differences of the rest; (n, S − 1)."""
    turned = quaternion_products(conjugates(references[:, :4]), states[:, :4])
    return np.concatenate([log_quaternions(turned), states[:, 4:] - references[:, 4:]], axis=1)


def updated(error: Floats, P: Floats, C: Floats, residual: Floats, deviations: Floats) -> tuple[Floats, Floats]:
    """Mean and covariance of an error after a measurement: the update of the Kalman filter in Joseph form.

    K = P Cᵀ (C P Cᵀ + R)⁻¹, δ⁺ = δ + K (y − C δ), P⁺ = (1 − K C) P (1 − K C)ᵀ + K R Kᵀ

    Args:
        error: mean before, (N,).
        P: covariance before, (N, N).
        C: Jacobian of the measurement, (R, N).
        residual: y, measured minus expected at the reference, (R,), NaN where nothing was measured.
        deviations: standard deviations of the noise, (R,).
    """
    there = ~np.isnan(residual)
    if not there.any():
        return error, P
    seen, variances = C[there], deviations[there] ** 2
    cross = seen @ P
    gain = np.linalg.solve(cross @ seen.T + np.diag(variances), cross).T
    left = np.eye(len(P)) - gain @ seen
    return error + gain @ (residual[there] - seen @ error), symmetric(left @ P @ left.T + (gain * variances) @ gain.T)


def predicted(P: Floats, A: Floats, B: Floats, deviations: Floats) -> Floats:
    """Covariance after a step, A P Aᵀ + B Q Bᵀ; Q is diagonal with these standard deviations (M,)."""
    spread = B * deviations
    return symmetric(A @ P @ A.T + spread @ spread.T)


def symmetric(P: Floats) -> Floats:
    """The symmetric part, (N, N)."""
    return 0.5 * (P + P.T)


def covariance(values: Floats, size: int) -> Floats:
    """Check a covariance, and return it as an array.

    Raises:
        BadInput: another shape, not symmetric, or not positive definite.
    """
    P = as_array(values, (size, size), "the covariance of the initial error")
    if not np.allclose(P, P.T, rtol=0.0, atol=1e-9 * abs(P).max()) or not (np.linalg.eigvalsh(P) > 0.0).all():
        raise BadInput("the covariance of the initial error is not symmetric and positive definite")
    return P
