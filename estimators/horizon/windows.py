"""A window of a linearised model as a least-squares problem, condensed to the first state and the disturbances.

Letters: n steps; N errors of the state, M disturbances, R measured values per point; A, B, C Jacobians; d defects; w
disturbances, σ their deviations; δ errors relative to the reference; ξ, η the D = N + n M whitened unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from ...errors import RunFailed
from .quadratic_programs import QuadraticProgram, Solver, solve

Floats = NDArray[np.float64]

_AT_A_BOUND = 1e-9
"""Tolerance of bounds, in standard deviations of a disturbance or in the unit of a state."""


@dataclass(frozen=True)
class Window:
    """n steps between n + 1 points, about a reference.

    δ(m+1) = A δ(m) + d + B (w(m) − w̃(m)), residual(m) = C δ(m) + noise            Bassolillo 2025, (22)–(23)

    A (n, N, N), B (n, N, M), defects (n, N): prediction from one reference point minus the next. C (n+1, R, N),
    residuals (n+1, R), weights (n+1, R): inverse standard deviation of the noise, 0 for missing values.
    mean (N,), factor (N, N): the prior of the first error, whose covariance is factor factorᵀ.
    reference (n, M): w̃. deviations (n, M): σ. bounds (n, M): of |w|. lower, upper (n+1, N): bounds of the errors.
    """

    A: Floats
    B: Floats
    defects: Floats
    C: Floats
    residuals: Floats
    weights: Floats
    mean: Floats
    factor: Floats
    reference: Floats
    deviations: Floats
    bounds: Floats
    lower: Floats
    upper: Floats


@dataclass(frozen=True)
class Smoothed:
    """errors δ (n+1, N), disturbances w (n, M), covariance of the last error (N, N), and whether a bound was active."""

    errors: Floats
    disturbances: Floats
    covariance: Floats
    bounded: bool


def smooth(window: Window, solver: Solver = "daqp") -> Smoothed:
    """Errors and disturbances that minimise the cost within their bounds.

    ‖δ(0) − mean‖² / P + Σ ‖w(m)‖² / Q + Σ ‖residual(m) − C δ(m)‖² / R   Bassolillo 2025, (24)–(29), errata

    P, Q and R are the covariances of the prior, of w and of the noise. The unknowns are whitened, δ(0) = mean +
    factor ξ and w = σ η, so that the Hessian is 1 plus a square and no covariance is inverted. The minimum without
    bounds, by Cholesky factorisation, is the fixed-interval smoother; the quadratic program is solved only if that
    minimum violates a bound. The covariance ignores bounds.

    Raises:
        RunFailed: the Hessian is not positive definite, or the solver found no solution.
    """
    maps, offsets = _condensed(window)
    program = _program(window, maps, offsets)
    lower_triangle, failed = lapack.dpotrf(program.hessian, lower=1, clean=0)
    if failed:
        size = maps.shape[2]
        raise RunFailed(f"the Hessian of a window with {size} unknowns is not positive definite, at pivot {failed}")
    unknowns, _ = lapack.dpotrs(lower_triangle, -program.gradient, lower=1)
    bounded = _breaks(program, unknowns)
    if bounded:
        unknowns = solve(program, solver)
    spread, _ = lapack.dtrtrs(lower_triangle, maps[-1].T, lower=1)
    errors = maps @ unknowns + offsets
    return Smoothed(errors, _disturbances(window, unknowns), spread.T @ spread, bounded)


def _condensed(window: Window) -> tuple[Floats, Floats]:
    """Maps S (n+1, N, D) and offsets c (n+1, N) with δ(m) = S (ξ, η) + c."""
    n, N, M = window.B.shape
    maps, offsets = np.zeros((n + 1, N, N + n * M)), np.empty((n + 1, N))
    maps[0, :, :N], offsets[0] = window.factor, window.mean
    gains = window.B * window.deviations[:, np.newaxis, :]
    drifts = window.defects - (window.B @ window.reference[:, :, np.newaxis])[:, :, 0]
    for m in range(n):
        known = N + m * M
        np.matmul(window.A[m], maps[m, :, :known], out=maps[m + 1, :, :known])
        maps[m + 1, :, known : known + M] = gains[m]
        offsets[m + 1] = window.A[m] @ offsets[m] + drifts[m]
    return maps, offsets


def program_of(window: Window) -> QuadraticProgram:
    """The window as a quadratic program in its whitened unknowns (ξ, η), (D,)."""
    return _program(window, *_condensed(window))


def _program(window: Window, maps: Floats, offsets: Floats) -> QuadraticProgram:
    """Cost: squared residuals and squared unknowns; constraints: bounds on η, and a row for each bounded error."""
    N, size = maps.shape[1:]
    seen = ((window.weights[:, :, np.newaxis] * window.C) @ maps).reshape(-1, size)
    misses = (window.weights * (window.residuals - (window.C @ offsets[:, :, np.newaxis])[:, :, 0])).ravel()
    hessian = seen.T @ seen
    hessian.flat[:: size + 1] += 1.0
    limits = np.concatenate([np.full(N, np.inf), (window.bounds / window.deviations).ravel()])
    limited = np.isfinite(window.lower) | np.isfinite(window.upper)
    return QuadraticProgram(
        hessian,
        -(seen.T @ misses),
        -limits,
        limits,
        maps[limited],
        (window.lower - offsets)[limited],
        (window.upper - offsets)[limited],
    )


def _breaks(program: QuadraticProgram, unknowns: Floats) -> bool:
    values = program.rows @ unknowns
    return bool(
        (unknowns < program.lower - _AT_A_BOUND).any()
        or (unknowns > program.upper + _AT_A_BOUND).any()
        or (values < program.low - _AT_A_BOUND).any()
        or (values > program.high + _AT_A_BOUND).any()
    )


def _disturbances(window: Window, unknowns: Floats) -> Floats:
    scaled: Floats = window.deviations * unknowns[window.factor.shape[0] :].reshape(window.deviations.shape)
    return scaled
