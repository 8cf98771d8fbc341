"""Moving horizon estimation: what it shares with the Kalman filter, what bounds add, and who may come late."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from volery.errors import BadInput
from volery.estimators.horizon.error_state import Noise, completed
from volery.estimators.horizon.error_state_kalman import ErrorStateKalman
from volery.estimators.horizon.moving_horizon import Estimated, MovingHorizon
from volery.estimators.horizon.quadratic_programs import QuadraticProgram, solve
from volery.estimators.horizon.windows import Window, smooth

from .linear_models import Floats, LinearModel, linear_model, simulated

POINTS, HORIZON = 40, 6
EVERYTHING = slice(None)
ROUNDING = 1e-9
"""States are of size 10 and the window's Hessian has a condition below 1e5, so that 1e-16 grows to 1e-10."""


def filtered(model: LinearModel, inputs: Floats, measured: Floats) -> ErrorStateKalman:
    """The Kalman filter after all points, each with all its measurements."""
    kalman = ErrorStateKalman(model, np.zeros(4), np.eye(4))
    kalman.begin(inputs[0])
    kalman.update(measured[0])
    for now, seen in zip(inputs[1:], measured[1:], strict=True):
        kalman.predict(now)
        kalman.update(seen)
    return kalman


def horizon(model: LinearModel, inputs: Floats, measured: Floats) -> list[Estimated]:
    """The estimates of the moving horizon at all points, likewise."""
    moving = MovingHorizon(model, HORIZON, np.zeros(4), np.eye(4))
    moving.take_inputs(0, EVERYTHING, inputs[0])
    moving.take(0, EVERYTHING, measured[0])
    estimates = [moving.estimate()]
    for now, seen in zip(inputs[1:], measured[1:], strict=True):
        moving.advance(now, seen)
        estimates.append(moving.estimate())
    return estimates


def test_without_active_bounds_it_is_the_kalman_filter() -> None:
    """A linear model, every point: the same state and the same covariance, to rounding."""
    model = linear_model(bound=50.0)
    _, inputs, measured = simulated(model, POINTS)
    estimates = horizon(model, inputs, measured)
    for points in (1, 2, HORIZON, HORIZON + 1, HORIZON + 2, POINTS):
        kalman = filtered(model, inputs[:points], measured[:points])
        assert estimates[points - 1].state == pytest.approx(kalman.state, abs=ROUNDING)
        assert estimates[points - 1].covariance == pytest.approx(kalman.covariance, abs=ROUNDING)
        assert not estimates[points - 1].bounded


def test_gaps_cost_certainty_in_both_alike() -> None:
    """A third of all measurements and a tenth of all inputs are missing: still the same."""
    model = linear_model(bound=50.0)
    _, inputs, measured = simulated(model, POINTS)
    rng = np.random.default_rng(2)
    measured[rng.uniform(size=measured.shape) < 0.3] = np.nan
    clean = horizon(model, inputs, measured)[-1]
    assert clean.state == pytest.approx(filtered(model, inputs, measured).state, abs=ROUNDING)
    inputs[[7, 8, 30, POINTS - 1]] = np.nan
    gapped = horizon(model, inputs, measured)[-1]
    assert (np.diag(gapped.covariance) > np.diag(clean.covariance)).all()


@pytest.mark.parametrize("delay", [1, HORIZON])
def test_what_comes_late_counts_where_it_belongs(delay: int) -> None:
    """Measurements that come points later, within the window, give what they had given in time, once all are there."""
    model = linear_model()
    _, inputs, measured = simulated(model, POINTS)
    moving = MovingHorizon(model, HORIZON, np.zeros(4), np.eye(4))
    moving.take_inputs(0, EVERYTHING, inputs[0])
    nothing = np.full(3, np.nan)
    for point in range(1, POINTS):
        moving.advance(inputs[point], nothing)
        assert (moving.first, moving.newest) == (max(0, point - HORIZON), point)
        if point >= delay:
            moving.take(point - delay, EVERYTHING, measured[point - delay])
        moving.estimate()
    for point in range(POINTS - delay, POINTS):
        moving.take(point, EVERYTHING, measured[point])
    assert moving.estimate().state == pytest.approx(filtered(model, inputs, measured).state, abs=ROUNDING)


def test_inputs_that_are_missing_lie_between_those_that_are_there() -> None:
    """Straight lines between, held at the ends; a step counts as measured where both its ends are."""
    inputs = np.array([[np.nan], [1.0], [np.nan], [3.0], [np.nan]])
    found = completed(inputs, np.array([7.0]))
    assert found.at_points[:, 0].tolist() == [7.0, 1.0, 2.0, 3.0, 3.0]
    assert found.of_steps[:, 0].tolist() == [4.0, 1.5, 2.5, 3.0]
    assert not found.measured.any()
    assert completed(inputs[[1, 3]], np.zeros(1)).measured.tolist() == [[True]]


def pushed(bound: float, push: float = 2.0) -> tuple[MovingHorizon, LinearModel]:
    """A window in which every step was pushed by more than the bound allows."""
    model = linear_model(bound=bound)
    moving = MovingHorizon(model, HORIZON, np.zeros(4), 0.01 * np.eye(4))
    state, inputs = np.zeros((1, 4)), np.zeros((1, 2))
    moving.take_inputs(0, EVERYTHING, inputs[0])
    for _ in range(HORIZON):
        state = model.dynamics(state, inputs, np.array([[push, -push]]))[0]
        moving.advance(inputs[0], (state @ model.H.T)[0])
    return moving, model


def test_bounds_that_bind_do_bind() -> None:
    """Without a bound the push of 2 is found, to a third at least; with one of 0.5 it is kept, and reached."""
    free = pushed(np.inf)[0].estimate()
    assert not free.bounded
    assert (abs(free.disturbances).max(axis=0) > 0.66).all()
    kept = pushed(0.5)[0].estimate()
    assert kept.bounded
    assert abs(kept.disturbances).max() == pytest.approx(0.5, abs=1e-9)


def least_squares(window: Window) -> tuple[Floats, Floats]:
    """Disturbances and errors by SciPy's bounded least squares on all states, not condensed: another way there."""
    n, N, M = window.B.shape
    size = N * (n + 1) + M * n
    rows, right = [], []
    stiff = 1e6

    def row(weight: Floats, blocks: dict[int, Floats], value: Floats) -> None:
        full = np.zeros((len(value), size))
        for start, block in blocks.items():
            full[:, start : start + block.shape[1]] = block
        rows.append(weight @ full)
        right.append(weight @ value)

    row(np.asarray(np.linalg.solve(window.factor, np.eye(N)), dtype=np.float64), {0: np.eye(N)}, window.mean)
    for m in range(n + 1):
        row(np.diag(window.weights[m]), {N * m: window.C[m]}, window.residuals[m])
    for m in range(n):
        w = N * (n + 1) + M * m
        row(np.diag(1.0 / window.deviations[m]), {w: np.eye(M)}, np.zeros(M))
        drift = window.defects[m] - window.B[m] @ window.reference[m]
        row(stiff * np.eye(N), {N * (m + 1): np.eye(N), N * m: -window.A[m], w: -window.B[m]}, drift)
    bounds = np.concatenate([np.full(N * (n + 1), np.inf), window.bounds.ravel()])
    found = lsq_linear(np.vstack(rows), np.concatenate(right), (-bounds, bounds), method="bvls", tol=1e-14)
    return found.x[N * (n + 1) :].reshape(n, M), found.x[: N * (n + 1)].reshape(n + 1, N)


def test_the_bounded_window_is_what_another_formulation_and_solver_find() -> None:
    """All states are unknowns, dynamics are stiff rows (weight 1e6, so to about 1e-6), SciPy solves."""
    moving, _ = pushed(0.5)
    window = moving.window()
    smoothed = smooth(window)
    disturbances, errors = least_squares(window)
    assert smoothed.disturbances == pytest.approx(disturbances, abs=1e-5)
    assert smoothed.errors == pytest.approx(errors, abs=1e-5)


def test_a_bound_of_the_state_is_kept_at_every_point() -> None:
    """The last component may not go above 0.1 and noise would put it there: it stays, and touches."""
    model = linear_model(upper=0.1)
    _, inputs, measured = simulated(model, POINTS)
    estimates = horizon(model, inputs, measured)
    free = horizon(linear_model(), inputs, measured)
    assert max(one.state[3] for one in free) > 0.5
    assert max(one.state[3] for one in estimates) == pytest.approx(0.1, abs=1e-8)
    assert any(one.bounded for one in estimates)


def program(seed: int) -> QuadraticProgram:
    """Twelve unknowns, most of them at a bound, and two rows."""
    rng = np.random.default_rng(seed)
    G = rng.normal(size=(20, 12))
    bounds, rows = np.full(12, 0.05), rng.normal(size=(2, 12))
    return QuadraticProgram(
        np.eye(12) + G.T @ G, rng.normal(size=12) * 20, -bounds, bounds, rows, np.full(2, -0.02), np.full(2, np.inf)
    )


@pytest.mark.parametrize("seed", range(4))
def test_solvers_agree(seed: int) -> None:
    """PIQP, an interior point method, finds what DAQP, an active-set method, finds: residuals of 1e-10."""
    pytest.importorskip("piqp")
    asked = program(seed)
    found = solve(asked, "daqp")
    assert solve(asked, "piqp") == pytest.approx(found, abs=1e-7)
    assert (abs(found) > 0.05 - 1e-9).sum() >= 5


def test_what_has_no_answer_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bound that leaves nothing, a solver that nobody knows, one that is not installed."""
    good = program(0)
    empty = np.full(12, 0.1)
    with pytest.raises(BadInput, match=r"bound 0 is from 0\.1 to -0\.05, which leaves no value"):
        QuadraticProgram(good.hessian, good.gradient, empty, -0.5 * empty, good.rows, good.low, good.high)
    with pytest.raises(BadInput, match="solver 'simplex' is not known: use daqp or piqp"):
        solve(good, "simplex")  # type: ignore[arg-type]
    monkeypatch.setitem(sys.modules, "piqp", None)
    with pytest.raises(BadInput, match="solver piqp is not installed: `pip install piqp`"):
        solve(good, "piqp")


def test_a_window_needs_a_step_and_a_covariance() -> None:
    """A horizon of 0, and covariances that are none."""
    model = linear_model()
    with pytest.raises(BadInput, match="horizon is 0, a window has at least 1 step"):
        MovingHorizon(model, 0, np.zeros(4), np.eye(4))
    for wrong in (np.eye(3), -np.eye(4), np.triu(np.ones((4, 4)))):
        with pytest.raises(BadInput, match="covariance of the initial error"):
            MovingHorizon(model, 5, np.zeros(4), wrong)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"disturbances": [0.0]}, "standard deviations of disturbances"),
        ({"measurements": [np.nan]}, "standard deviations of measurements"),
        ({"bounds": [-0.1]}, "no value is within a bound below 0"),
        ({"lower": [2.0], "upper": [1.0]}, "which leaves no value"),
    ],
)
def test_noise_that_leaves_no_value_is_refused(changes: dict[str, list[float]], said: str) -> None:
    """Deviations of 0, bounds that contradict each other."""
    good = {"disturbances": 1.0, "gaps": 1.0, "bounds": 1.0, "measurements": 1.0, "lower": -1.0, "upper": 1.0}
    values = {name: np.array([value]) for name, value in good.items()}
    with pytest.raises(BadInput, match=said):
        Noise(**{**values, **{name: np.array(value) for name, value in changes.items()}})
