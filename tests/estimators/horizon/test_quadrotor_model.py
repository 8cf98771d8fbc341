"""The quadrotor's models: Jacobians, what each sensor sees, what is observable, and consistency of the estimate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from volery.errors import BadInput
from volery.estimators.horizon.attitude_model import AttitudeModel
from volery.estimators.horizon.moving_horizon import MovingHorizon
from volery.estimators.horizon.quadrotor_model import RANGES, Deviations, QuadrotorModel
from volery.rotations import euler_to_quaternion, normalised

from .linear_models import Floats

Either = QuadrotorModel | AttitudeModel
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
STEP = 1e-5
WITHIN = 1e-8
"""Central differences: third derivatives of size 100 times (1e-5)² / 6, and rounding of 1e-13 / 1e-5."""

MODELS: list[Either] = [
    QuadrotorModel(),
    QuadrotorModel(gyroscope_bias=True),
    QuadrotorModel(accelerometer_bias=True, printed_accelerometer=True, printed_range=True),
    QuadrotorModel(gyroscope_bias=True, accelerometer_bias=True, step_s=0.02, flow_at=(0.3, -0.1, 0.2)),
    AttitudeModel(),
    AttitudeModel(gyroscope_bias=True, printed_accelerometer=True),
]


def states_of(model: Either, count: int) -> Floats:
    """States far from level, off the reference in every component."""
    rng = np.random.default_rng(3)
    states = rng.normal(size=(count, model.size + 1)) * 0.3
    states[:, :4] = [normalised(0.3 * rng.normal(size=4) + LEVEL) for _ in range(count)]
    if isinstance(model, QuadrotorModel):
        states[:, 7] -= 10.0
    return states


def derivative(function: Callable[[Floats], Floats], size: int) -> Floats:
    """Central differences in every direction, stacked along a last axis."""
    sides = [(function(STEP * one) - function(-STEP * one)) / (2.0 * STEP) for one in np.eye(size)]
    return np.stack(sides, axis=-1)


@pytest.mark.parametrize("model", MODELS, ids=range(len(MODELS)))
def test_jacobians_are_the_derivatives(model: Either) -> None:
    """A, B and C of a stack of states along a horizon, inputs and disturbances included, against finite differences."""
    count, M = 4, len(model.noise.disturbances)
    rng, states = np.random.default_rng(4), states_of(model, 4)
    inputs, disturbances = rng.normal(size=(count, len(model.resting))), 0.1 * rng.normal(size=(count, M))
    following, *found = model.dynamics(states, inputs, disturbances)
    found.append(model.outputs(states, inputs)[1])

    def after(error: Floats) -> Floats:
        moved = model.retract(states, np.tile(error, (count, 1)))
        return model.difference(model.dynamics(moved, inputs, disturbances)[0], following)

    def disturbed(w: Floats) -> Floats:
        return model.difference(model.dynamics(states, inputs, disturbances + w)[0], following)

    def seen(error: Floats) -> Floats:
        return model.outputs(model.retract(states, np.tile(error, (count, 1))), inputs)[0]

    for jacobian, function, size in zip(found, (after, disturbed, seen), (model.size, M, model.size), strict=True):
        assert jacobian == pytest.approx(derivative(function, size), rel=WITHIN, abs=WITHIN)


@pytest.mark.parametrize("model", MODELS, ids=range(len(MODELS)))
def test_what_is_added_can_be_taken_away(model: Either) -> None:
    """(x ⊞ δ) ⊟ x = δ, and bounded components of the state change as their errors do."""
    states = states_of(model, 3)
    errors = np.random.default_rng(6).normal(size=(3, model.size)) * 0.4
    shifted = model.retract(states, errors)
    assert model.difference(shifted, states) == pytest.approx(errors, abs=1e-12)
    bounded = np.isfinite(model.noise.lower) | np.isfinite(model.noise.upper)
    moved = model.components(shifted) - model.components(states)
    assert moved[:, bounded] == pytest.approx(errors[:, bounded], abs=1e-12)


def test_five_ranges_as_printed_have_rank_one() -> None:
    """(17) to the letter: five equal rows, nothing of the attitude; with lever arms, altitude and tilt."""
    states = QuadrotorModel().start(LEVEL, 10.0)[np.newaxis]
    _, printed = QuadrotorModel(printed_range=True).outputs(states, np.zeros((1, 6)))
    _, true = QuadrotorModel().outputs(states, np.zeros((1, 6)))
    assert np.linalg.matrix_rank(printed[0, RANGES]) == 1
    assert np.linalg.norm(printed[0, RANGES, :3]) == 0.0
    assert np.linalg.matrix_rank(true[0, RANGES]) == 3


def test_a_range_sensor_under_an_arm_sees_the_tilt() -> None:
    """Rolled to the right by 0.1 rad the right sensor is lower by the arm's share and looks along the body's axis."""
    state = QuadrotorModel().start(euler_to_quaternion(0.1, 0.0, 0.0), 10.0)[np.newaxis]
    expected, _ = QuadrotorModel().outputs(state, np.zeros((1, 6)))
    centre, _, right, _, left = expected[0, RANGES]
    assert centre == pytest.approx(10.0 / np.cos(0.1), abs=1e-12)
    assert [right - centre, left - centre] == pytest.approx([-0.7 * np.tan(0.1), 0.7 * np.tan(0.1)], abs=1e-12)


def test_the_sign_in_13_turns_under_into_over_estimation() -> None:
    """Rolled by 0.1 rad in steady flight, B reads what it takes for level, or as printed for twice the roll."""
    rolled = euler_to_quaternion(0.1, 0.0, 0.0)
    sideways = {}
    for printed in (False, True):
        model = AttitudeModel(printed_accelerometer=printed)
        felt = 2.0 * 9.81 * np.sin(0.1) if printed else 0.0
        expected, C = model.outputs(model.start(rolled)[np.newaxis], np.zeros((1, 3)))
        sideways[printed] = (felt - expected[0, 4]) / C[0, 4, 0]
    assert sideways[False] == pytest.approx(-np.tan(0.1), abs=1e-12)
    assert sideways[True] == pytest.approx(np.tan(0.1), abs=1e-12)


def test_the_estimate_is_as_uncertain_as_it_says() -> None:
    """Twelve flights that obey the model exactly, 25 points each, full window: their NEES is χ² with 12 · 7 degrees.

    The interval holds 99.9 % of that law.
    """
    model, runs, points = QuadrotorModel(), 12, 25
    rng = np.random.default_rng(11)
    spread = np.array([0.02] * 3 + [0.1] * 3 + [0.1])
    total = 0.0
    for _ in range(runs):
        start = model.start(LEVEL, 10.0)
        true = model.retract(start[np.newaxis], (rng.normal(size=7) * spread)[np.newaxis])
        moving = MovingHorizon(model, 10, start, np.diag(spread**2))
        inputs = np.tile(model.resting, (points, 1)) + rng.normal(size=6) * 0.1
        for point in range(points):
            seen = model.outputs(true, inputs[point : point + 1])[0][0] + rng.normal(size=10) * model.noise.measurements
            if point == 0:
                moving.take_inputs(0, slice(None), inputs[0])
                moving.take(0, slice(None), seen)
            else:
                moving.advance(inputs[point], seen)
            estimated = moving.estimate()
            if point < points - 1:
                w = rng.normal(size=(1, 6)) * model.noise.disturbances
                now, true = true, model.dynamics(true, inputs[point : point + 1], w)[0]
        off = model.difference(true, estimated.state[np.newaxis])[0]
        total += float(off @ np.linalg.solve(estimated.covariance, off))
        assert now.shape == true.shape
    low, high = chi2.ppf([0.0005, 0.9995], runs * model.size)
    assert low < total < high


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: QuadrotorModel(step_s=0.0), "step is 0, it must be above 0"),
        (lambda: QuadrotorModel(arm=-1.0), "arm is -1, it must be above 0"),
        (lambda: QuadrotorModel(largest_gyroscope=-0.1), "no value is within a bound below 0"),
        (lambda: AttitudeModel(step_s=-0.1), r"step is -0\.1, it must be above 0"),
        (lambda: AttitudeModel(largest_gyroscope=-0.1), "no value is within a bound below 0"),
        (lambda: Deviations(flow=0.0), "the standard deviation flow is 0, it must be above 0"),
        (lambda: QuadrotorModel().start(2.0 * LEVEL, 10.0), "the initial attitude: a quaternion has norm 1"),
        (lambda: AttitudeModel().start(2.0 * LEVEL), "the initial attitude: a quaternion has norm 1"),
    ],
)
def test_what_makes_no_model_is_refused(make: Callable[[], Any], said: str) -> None:
    """Each with its value and its bound."""
    with pytest.raises(BadInput, match=said):
        make()
