"""Metrics of a run, as functions of arrays: errors, times to converge and recover, contraction, consistency.

An agent without an estimate is a row of NaN.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import BadInput


def error(estimates: ArrayLike, reference: ArrayLike) -> NDArray[np.float64]:
    """Two-norm of the difference to a reference: the truth, or the centralised estimate of the same sample.

    ‖x̂_i − x̂‖₂            Kriegleder 2012, Fig. 5

    Args:
        estimates: shape (…, n).
        reference: shape that broadcasts against it, in the same units.
    Returns:
        Shape (…), NaN where there is no estimate.
    """
    difference = np.asarray(estimates, dtype=np.float64) - np.asarray(reference, dtype=np.float64)
    norm: NDArray[np.float64] = np.linalg.norm(difference, axis=-1)
    return norm


def attitude_difference(estimates: ArrayLike, reference: ArrayLike) -> NDArray[np.float64]:
    """The shortest rotation from the reference to the estimate, in coordinates of the inertial frame.

    The rotation vector of Q̂ ⊙ Q⁻¹            Betanzos 2024, (6), with the factors exchanged

    Its two-norm is the angle between the two, at most π, whatever the signs of the quaternions.

    Args:
        estimates: unit quaternions Q̂, scalar first, shape (…, 4).
        reference: unit quaternions Q, in a shape that broadcasts against it.
    Returns:
        Shape (…, 3) [rad], NaN where there is no estimate or no reference.
    """
    p, q = np.asarray(estimates, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    scalar = (p * q).sum(axis=-1, keepdims=True)
    vector = q[..., :1] * p[..., 1:] - p[..., :1] * q[..., 1:] - np.cross(p[..., 1:], q[..., 1:])
    sine = np.linalg.norm(vector, axis=-1, keepdims=True)
    small = sine == 0.0
    angle = 2.0 * np.arctan2(sine, np.abs(scalar)) / np.where(small, 1.0, sine)
    return np.asarray(np.where(small, 2.0, angle) * np.where(scalar < 0.0, -vector, vector))


def disagreement(estimates: ArrayLike) -> NDArray[np.float64]:
    """Root mean square distance of the agents' estimates to their mean.

    √(1/N Σ_i ‖x̂_i − x̄‖²): the quantity that averaging contracts in each round by ρ(W − 11ᵀ/N).

    Args:
        estimates: shape (…, N, n); agents without an estimate are left out.
    Returns:
        Shape (…), NaN where fewer than two agents have an estimate, or one is infinite.
    """
    values = np.asarray(estimates, dtype=np.float64)
    present = ~np.isnan(values).any(axis=-1, keepdims=True)
    count = present.sum(axis=(-2, -1))
    divisor = np.where(count > 1, count, 1)
    mean = np.where(present, values, 0.0).sum(axis=-2) / divisor[..., np.newaxis]
    with np.errstate(invalid="ignore"):  # an estimate that has diverged to infinity has no distance to a mean
        square = (np.where(present, values - mean[..., np.newaxis, :], 0.0) ** 2).sum(axis=(-2, -1))
    return np.where(count > 1, np.sqrt(square / divisor), np.nan)


def convergence_time(times_ns: ArrayLike, errors: ArrayLike, threshold: float) -> int | None:
    """First time after which the error stays at or below a threshold, or None if it does not.

    Args:
        times_ns: ascending, shape (T,) [ns].
        errors: shape (T,); NaN counts as above.
        threshold: in the unit of the errors.
    Raises:
        BadInput: shapes differ.
    """
    times, values = _series(times_ns, errors)
    above = np.flatnonzero(~(values <= threshold))
    first = 0 if above.size == 0 else int(above[-1]) + 1
    return int(times[first]) if first < len(times) else None


def recovery_time(
    times_ns: ArrayLike, errors: ArrayLike, threshold: float, *, after_ns: int, before_ns: int | None = None
) -> int | None:
    """Time from an instant, such as the end of a fault, until the error stays at or below a threshold.

    Args:
        times_ns: ascending, shape (T,) [ns].
        errors: shape (T,); NaN counts as above.
        threshold: in the unit of the errors.
        after_ns: the instant [ns].
        before_ns: end of the span considered, such as the start of the next fault [ns]; None for the end of the run.
    Returns:
        Duration [ns]; 0 if the error is never above in the span; None if it does not recover or the span has no value.
    Raises:
        BadInput: shapes differ.
    """
    times, values = _series(times_ns, errors)
    span = (times >= after_ns) & (times < before_ns if before_ns is not None else True)
    time = convergence_time(times[span], values[span], threshold)
    if time is None:
        return None
    return 0 if time == times[span][0] else time - after_ns


def contraction(disagreements: ArrayLike) -> float:
    """Factor by which the disagreement shrinks per round, by a least-squares fit of its logarithm.

    exp of the slope of log d(k) over k; to be compared with the essential spectral radius of the weights.

    Args:
        disagreements: one value per round, shape (K,), K ≥ 2; leave out rounds dominated by rounding errors.
    Raises:
        BadInput: fewer than two rounds, or a value that is not positive and finite.
    """
    values = np.asarray(disagreements, dtype=np.float64)
    if values.ndim != 1 or len(values) < 2 or not (np.isfinite(values) & (values > 0.0)).all():
        raise BadInput(f"disagreements {values.tolist()} must be two or more positive finite numbers")
    rounds = np.arange(len(values)) - (len(values) - 1) / 2
    return float(np.exp(rounds @ np.log(values) / (rounds @ rounds)))


def nees(errors: ArrayLike, covariances: ArrayLike) -> NDArray[np.float64]:
    """Normalised estimation error squared; for a consistent filter it is χ² distributed with n degrees of freedom.

    ε = eᵀ P⁻¹ e            Bar-Shalom, Li and Kirubarajan 2001, (5.4.2-1)

    Args:
        errors: estimate minus truth, shape (…, n).
        covariances: as the filter states them, shape (…, n, n), positive definite.
    Returns:
        Shape (…), dimensionless.
    """
    difference = np.asarray(errors, dtype=np.float64)[..., np.newaxis]
    weighted = np.linalg.solve(np.asarray(covariances, dtype=np.float64), difference)
    square: NDArray[np.float64] = (difference * weighted).sum(axis=(-2, -1))
    return square


def chi_square_bounds(dimension: int, samples: int = 1, confidence: float = 0.95) -> tuple[float, float]:
    """Interval in which the mean NEES of a consistent filter lies with this probability, with equal tails.

    Args:
        dimension: degrees of freedom of one value, ≥ 1.
        samples: number of independent values in the mean, ≥ 1.
        confidence: probability, in (0, 1).
    Raises:
        BadInput: an argument out of its bounds.
    """
    if dimension < 1 or samples < 1 or not 0.0 < confidence < 1.0:
        raise BadInput(f"dimension {dimension}, samples {samples}, confidence {confidence}: give ≥ 1, ≥ 1, in (0, 1)")
    from scipy.special import chdtri  # heavy, and no agent needs it

    freedom = dimension * samples
    tail = (1.0 - confidence) / 2.0
    return float(chdtri(freedom, 1.0 - tail)) / samples, float(chdtri(freedom, tail)) / samples


def integrated_square_error(times_ns: ArrayLike, errors: ArrayLike) -> float:
    """Integral of the squared error over time (ISE), by the trapezoidal rule.

    Args:
        times_ns: ascending, shape (T,) [ns].
        errors: shape (T,).
    Returns:
        In the squared unit of the errors times seconds; NaN if an error is.
    Raises:
        BadInput: shapes differ.
    """
    times, values = _series(times_ns, errors)
    return float(np.trapezoid(values**2, (times - times[0]) * 1e-9)) if len(times) else 0.0


def _series(times_ns: ArrayLike, errors: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    times = np.asarray(times_ns, dtype=np.int64)
    values = np.asarray(errors, dtype=np.float64)
    if times.ndim != 1 or times.shape != values.shape:
        raise BadInput(f"times have shape {times.shape} and errors {values.shape}: give one error for each time")
    return times, values
