"""Models with an error state, on an even grid in time: what estimators ask of them, and the Kalman filter's two steps.

Letters: S entries of a state x, N of its error δ, U inputs u, M disturbances w, R measured values y; x ⊞ δ is the state
that is off x by δ, and ⊟ undoes that; A, B, C are the Jacobians of errors, P a covariance (N, N).
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
    """How uncertain a model is, component by component.

    disturbances (M,): standard deviations of w. gaps (M,): the same for a step whose inputs were not measured at both
    ends. bounds (M,): of |w| where they were. measurements (R,): standard deviations of the noise.
    lower, upper (N,): bounds of what `Model.components` gives.

    Raises:
        BadInput: a deviation that is not above 0, a bound that leaves no value.
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
    """A model in discrete time; its functions take n points at once. The first U disturbances are those of the inputs.

    A(n, N, N), B (n, N, M) and C (n, R, N) are the derivatives of the error of the next state and of the output, about
    the states, inputs and disturbances given.
    """

    @property
    def noise(self) -> Noise:
        """How uncertain it is."""

    @property
    def resting(self) -> Floats:
        """Inputs (U,) for as long as none is known."""

    def dynamics(self, states: Floats, inputs: Floats, disturbances: Floats) -> tuple[Floats, Floats, Floats]:
        """Next states (n, S), A and B, of states (n, S), inputs over the step (n, U), disturbances (n, M)."""

    def outputs(self, states: Floats, inputs: Floats) -> tuple[Floats, Floats]:
        """Measured values without noise (n, R) and C, of states (n, S) and inputs at that instant (n, U)."""

    def retract(self, states: Floats, errors: Floats) -> Floats:
        """X ⊞ δ, (n, S), of states (n, S) and errors (n, N)."""

    def difference(self, states: Floats, references: Floats) -> Floats:
        """X ⊟ x̃, (n, N), of states (n, S) and references (n, S)."""

    def components(self, states: Floats) -> Floats:
        """What bounds apply to, (n, N): where there is a bound on it, entry i changes by just the i-th error."""


@dataclass(frozen=True)
class Inputs:
    """Inputs of K points, completed: at the points (K, U), over the steps between them (K−1, U), and what is measured.

    measured (K−1, U): whether the step's input was measured at both its ends. A step takes the mean of its ends.
    """

    at_points: Floats
    of_steps: Floats
    measured: NDArray[np.bool_]


def completed(inputs: Floats, before: Floats) -> Inputs:
    """Inputs (K, U) that are NaN where they are missing, on straight lines between those that are there.

    Before the first that is there `before` (U,) counts for the first point, and after the last one that is held.
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

    Where an input was not measured its disturbance is no noise of a sensor: the deviation is that of a gap, and the
    bound does not hold.
    """
    others = np.ones((len(measured), len(noise.disturbances) - measured.shape[1]), dtype=bool)
    normal = np.concatenate([measured, others], axis=1)
    return np.where(normal, noise.disturbances, noise.gaps), np.where(normal, noise.bounds, np.inf)


def retracted(states: Floats, errors: Floats) -> Floats:
    """X ⊞ δ for states that begin with a quaternion q: q ⊙ exp(θ), and the rest added; (n, S) and (n, S − 1)."""
    turned = quaternion_products(states[:, :4], exp_quaternions(errors[:, :3]))
    return np.concatenate([normalised_rows(turned), states[:, 4:] + errors[:, 3:]], axis=1)


def differences(states: Floats, references: Floats) -> Floats:
    """X ⊟ x̃ for such states: log(q̃* ⊙ q), and the rest subtracted; (n, S − 1)."""
    turned = quaternion_products(conjugates(references[:, :4]), states[:, :4])
    return np.concatenate([log_quaternions(turned), states[:, 4:] - references[:, 4:]], axis=1)


def updated(error: Floats, P: Floats, C: Floats, residual: Floats, deviations: Floats) -> tuple[Floats, Floats]:
    """Mean and covariance of an error after a measurement, the Kalman filter's update in Joseph's form.

    K = P Cᵀ (C P Cᵀ + R)⁻¹, δ⁺ = δ + K (y − C δ), P⁺ = (1 − K C) P (1 − K C)ᵀ + K R Kᵀ

    Args:
        error: its mean before, (N,).
        P: its covariance before, (N, N).
        C: (R, N).
        residual: y, measured less expected at the reference, (R,), NaN where nothing was measured.
        deviations: of the noise, (R,).
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
    """Covariance after a step, A P Aᵀ + B Q Bᵀ with Q of these deviations (M,)."""
    spread = B * deviations
    return symmetric(A @ P @ A.T + spread @ spread.T)


def symmetric(P: Floats) -> Floats:
    """The symmetric part, (N, N)."""
    return 0.5 * (P + P.T)


def covariance(values: Floats, size: int) -> Floats:
    """A covariance, checked.

    Raises:
        BadInput: another shape, not symmetric, or not positive definite.
    """
    P = as_array(values, (size, size), "the covariance of the initial error")
    if not np.allclose(P, P.T, rtol=0.0, atol=1e-9 * abs(P).max()) or not (np.linalg.eigvalsh(P) > 0.0).all():
        raise BadInput("the covariance of the initial error is not symmetric and positive definite")
    return P
