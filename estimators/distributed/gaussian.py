"""Gaussian beliefs about a dynamic state: prediction, correction and propagation.

Letters: x state of n components with mean x̂ and covariance Σ; x⁺ = A x + u + w with w ~ N(0, Q) one step of its model;
z = H x + v with v ~ N(0, R) a measurement; (P, q) = (Σ⁻¹, Σ⁻¹ x̂) the information pair of a belief. For a nonlinear
system A and H are Jacobians, and u and z include the constant terms of the linearisation.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotri

from ...errors import BadInput
from ..checks import as_array
from ..information import InformationPair, mirrored

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Gaussian:
    """A belief: mean (n,) and covariance (n, n), in the state's units.

    Raises:
        BadInput: shapes that do not fit, or not finite.
    """

    mean: Vector
    covariance: Matrix

    def __post_init__(self) -> None:
        """Check shapes and make both float64."""
        object.__setattr__(self, "mean", as_array(self.mean, (None,), "mean"))
        size = len(self.mean)
        object.__setattr__(self, "covariance", as_array(self.covariance, (size, size), "covariance"))

    @classmethod
    def trusted(cls, mean: Vector, covariance: Matrix) -> Self:
        """The belief with these arrays, without checks and copies; for arrays computed from checked ones."""
        belief = cls.__new__(cls)
        belief.__dict__.update(mean=mean, covariance=covariance)
        return belief


@dataclass(frozen=True, eq=False)
class Step:
    """One step of the model, from a sample to the next: transition A (n, n), noise Q (n, n), shift u (n,).

    Raises:
        BadInput: shapes that do not fit, or not finite.
    """

    transition: Matrix
    noise: Matrix
    shift: Vector

    def __post_init__(self) -> None:
        """Check shapes and make all float64."""
        object.__setattr__(self, "shift", as_array(self.shift, (None,), "shift"))
        size = len(self.shift)
        for name in ("transition", "noise"):
            object.__setattr__(self, name, as_array(getattr(self, name), (size, size), name))


@dataclass(frozen=True, eq=False)
class Measurement:
    """A measurement: matrix H (m, n), noise R (m, m) positive definite, value z (m,).

    Raises:
        BadInput: shapes that do not fit, or not finite.
    """

    matrix: Matrix
    noise: Matrix
    value: Vector

    def __post_init__(self) -> None:
        """Check shapes and make all float64."""
        object.__setattr__(self, "value", as_array(self.value, (None,), "value"))
        size = len(self.value)
        object.__setattr__(self, "matrix", as_array(self.matrix, (size, None), "matrix"))
        object.__setattr__(self, "noise", as_array(self.noise, (size, size), "noise"))


def predict(belief: Gaussian, step: Step) -> Gaussian:
    """The belief one step later.

    x̂⁺ = A x̂ + u,  Σ⁺ = A Σ Aᵀ + Q            Kalman 1960
    """
    A = step.transition
    covariance = A.dot(belief.covariance).dot(A.T) + step.noise
    return Gaussian.trusted(A.dot(belief.mean) + step.shift, mirrored(covariance))


def information(belief: Gaussian) -> InformationPair:
    """The belief as an information pair: P = Σ⁻¹, q = Σ⁻¹ x̂.

    Raises:
        BadInput: Σ is not positive definite.
    """
    matrix = _inverse(belief.covariance)
    if matrix is None:
        raise BadInput(f"a covariance is not positive definite: {belief.covariance.tolist()}")
    return InformationPair.trusted(matrix, matrix.dot(belief.mean))


def measured_information(measurement: Measurement | None, dimension: int) -> InformationPair:
    """The information pair of a measurement, to be added to that of a belief; zero for None.

    P = Hᵀ R⁻¹ H,  q = Hᵀ R⁻¹ z            information form, Olfati-Saber 2007

    Args:
        measurement: a measurement of m components, or None.
        dimension: n, number of components of the state.
    """
    if measurement is None:
        return InformationPair.trusted(np.zeros((dimension, dimension)), np.zeros(dimension))
    H, R, z = measurement.matrix, measurement.noise, measurement.value
    weighted = H.T / R[0, 0] if len(z) == 1 else np.linalg.solve(R, H).T
    return InformationPair.trusted(mirrored(weighted.dot(H)), weighted.dot(z))


def added(pairs: Iterable[InformationPair]) -> InformationPair:
    """Sum of independent information pairs, at least one."""
    first, *others = pairs
    matrix, vector = first.P, first.q
    for pair in others:
        matrix, vector = matrix + pair.P, vector + pair.q
    return InformationPair.trusted(matrix, vector)


def scaled(pair: InformationPair, factor: float) -> InformationPair:
    """The pair multiplied by a number."""
    return InformationPair.trusted(factor * pair.P, factor * pair.q)


def gaussian(pair: InformationPair) -> Gaussian | None:
    """The belief of an information pair, or None if P is not positive definite and so does not determine all of x."""
    covariance = _inverse(pair.P)
    return None if covariance is None else Gaussian.trusted(covariance.dot(pair.q), covariance)


def corrected(belief: Gaussian, pairs: Iterable[InformationPair]) -> Gaussian:
    """Correct a belief with independent information, such as the measurements of one sample.

    P⁺ = Σ⁻¹ + Σ_j P_j,  q⁺ = Σ⁻¹ x̂ + Σ_j q_j            information filter, Anderson and Moore 1979, Sec. 6.3

    Raises:
        BadInput: the result is not positive definite, because the information is not positive semidefinite.
    """
    result = gaussian(added([information(belief), *pairs]))
    if result is None:
        raise BadInput("the information added is not positive semidefinite: it takes away more than the belief holds")
    return result


def run_forward(pair: InformationPair, steps: Sequence[Step]) -> InformationPair:
    """Propagate an information pair, which may be singular, through these steps of the model.

    M = A⁻ᵀ P A⁻¹,  P⁺ = (I + M Q)⁻¹ M,  q⁺ = (I + M Q)⁻¹ (A⁻ᵀ q + M u)
    which is P⁺ = (A P⁻¹ Aᵀ + Q)⁻¹ for regular P            Anderson and Moore 1979, Sec. 6.3

    Args:
        pair: information about the state before the first step.
        steps: steps in order, with invertible transitions.
    """
    matrix, vector = pair.P, pair.q
    size = len(vector)
    for step in steps:
        moved = np.linalg.solve(step.transition.T, np.column_stack([matrix, vector]))
        M = np.linalg.solve(step.transition.T, moved[:, :size].T)
        q = moved[:, size] + M @ step.shift
        solved = np.linalg.solve(np.eye(size) + M @ step.noise, np.column_stack([M, q]))
        matrix, vector = mirrored(solved[:, :size]), solved[:, size]
    return InformationPair.trusted(matrix, vector)


def moved(mean: Vector, steps: Sequence[Step]) -> Vector:
    """Propagate a mean through these steps: x̂⁺ = A x̂ + u for each."""
    for step in steps:
        mean = step.transition @ mean + step.shift
    return mean


def _inverse(matrix: Matrix) -> Matrix | None:
    """The inverse of a symmetric matrix from its Cholesky factor, exactly symmetric; None if not positive definite."""
    factor, fault = dpotrf(matrix.T, lower=1, clean=0)
    if fault:
        return None
    inverse, _ = dpotri(factor, lower=1, overwrite_c=1)
    return mirrored(inverse.T)
