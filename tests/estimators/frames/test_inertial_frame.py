"""The filter of rates, force and field: its Jacobian, its update, the frame it implies, and what it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from volery import rotations as rot
from volery.errors import BadInput
from volery.estimators import error_measures as metrics
from volery.estimators.frames.inertial_frame import (
    LONGEST_STEP_S,
    ImuEstimate,
    ImuModel,
    at_rest,
    implied_attitude,
    imu_model,
    predict,
    propagate,
    update,
)

Floats = NDArray[np.float64]

INERTIA = np.array([[0.005, 0.0003, 0.0], [0.0003, 0.006, 0.0001], [0.0, 0.0001, 0.009]])
MODEL = imu_model(INERTIA, noise=(0.01, 1.0, 0.02), walk=(5.0, 0.05, 0.01))
GRAVITY, FIELD = np.array([0.0, 0.0, 9.81]), np.array([0.5, 0.0, -0.8])
READINGS = {"gyro": [0.1, -0.2, 0.3], "accelerometer": [0.5, 0.1, 9.7], "magnetometer": [0.4, 0.1, -0.7]}

numbers = st.floats(-3.0, 3.0)
states = st.lists(numbers, min_size=9, max_size=9).map(np.array)
attitudes = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))


def differences(state: Floats, dt_s: float) -> Floats:
    """Central differences, step 1e-5: an error of 1e-10 times the third derivative, and 1e-11 of rounding."""
    turns = 1e-5 * np.eye(9)
    sides = [[propagate(state + sign * turn, MODEL, dt_s)[0] for turn in turns] for sign in (1.0, -1.0)]
    return np.asarray((np.array(sides[0]) - np.array(sides[1])).T / 2e-5)


@given(state=states, dt_s=st.floats(1e-3, LONGEST_STEP_S))
def test_jacobian_is_the_derivative_of_the_prediction(state: Floats, dt_s: float) -> None:
    """All 81 entries, for any rates and any step that is allowed."""
    np.testing.assert_allclose(propagate(state, MODEL, dt_s)[1], differences(state, dt_s), atol=1e-8)


@pytest.mark.parametrize("rate", [0.0, 1e-6, 0.0999, 0.1001, 2.0])
def test_jacobian_has_all_digits_where_its_series_ends(rate: float) -> None:
    """On either side of a turn of 0.01 rad, where the series of V gives way to its closed form."""
    state = np.array([rate, 0.0, 0.0, 1.0, 2.0, 9.0, 0.3, 0.2, -0.7])
    np.testing.assert_allclose(propagate(state, MODEL, 0.1)[1], differences(state, 0.1), atol=1e-8)


@given(state=states)
def test_rates_follow_the_rigid_body(state: Floats) -> None:
    """One Euler step of J ω̇ = −ω × J ω, which turns no axis of the inertia."""
    dt_s = 0.01
    rates = state[:3]
    expected = rates - dt_s * np.linalg.solve(INERTIA, np.cross(rates, INERTIA @ rates))
    np.testing.assert_allclose(propagate(state, MODEL, dt_s)[0][:3], expected, atol=1e-14)
    _, axes = np.linalg.eigh(INERTIA)
    still = np.concatenate([2.0 * axes[:, 0], state[3:]])
    np.testing.assert_allclose(propagate(still, MODEL, dt_s)[0][:3], still[:3], atol=1e-14)


def test_directions_turn_against_the_body() -> None:
    """At constant rates force and field stay where they are in the inertial frame, exactly, for a hundred steps."""
    _, axes = np.linalg.eigh(INERTIA)
    rates = 3.0 * axes[:, 1]
    attitude = rot.euler_to_quaternion(0.3, -0.2, 1.0)
    estimate = ImuEstimate(np.concatenate([rates, *_seen(attitude)]), MODEL.noise)
    for _ in range(100):
        estimate = predict(estimate, MODEL, 0.02)
        attitude = rot.integrate(attitude, rates, 0.02)
    np.testing.assert_allclose(estimate.state[3:], np.concatenate(_seen(attitude)), atol=1e-11)


@given(q=attitudes)
def test_the_frame_is_north_west_up(q: tuple[float, float, float]) -> None:
    """From gravity and field as a body of any attitude at rest sees them comes that attitude; level north is 1."""
    attitude = rot.euler_to_quaternion(*q)
    found = implied_attitude(np.concatenate([np.zeros(3), *_seen(attitude)]))
    assert rot.angle_between(found, attitude) < 1e-12
    level = implied_attitude(np.concatenate([np.zeros(3), GRAVITY, FIELD]))
    np.testing.assert_allclose(level, [1.0, 0.0, 0.0, 0.0], atol=1e-15)


@given(q=attitudes)
def test_it_is_the_north_east_down_of_the_errata_turned_about_north(q: tuple[float, float, float]) -> None:
    """Down = −force, east = down × field, north = east × down; half a turn about x makes it ours."""
    force, field = _seen(rot.euler_to_quaternion(*q))
    down = -force / np.linalg.norm(force)
    east = np.cross(down, field) / np.linalg.norm(np.cross(down, field))
    to_ned = np.stack([np.cross(east, down), east, down])
    ours = rot.to_matrix(implied_attitude(np.concatenate([np.zeros(3), force, field])))
    np.testing.assert_allclose(rot.exp_so3(np.array([math.pi, 0.0, 0.0])) @ to_ned, ours, atol=1e-14)


def test_update_adds_information() -> None:
    """The textbook's information form: P⁺⁻¹ = P⁻¹ + R⁻¹, P⁺⁻¹ x⁺ = P⁻¹ x + R⁻¹ z; condition 1e4 leaves 1e-10."""
    prior = predict(at_rest([0.0, 0.0, 9.0], [1.0, 0.0, 0.0], MODEL), MODEL, 0.05)
    posterior = update(prior, MODEL, **READINGS)
    z = np.concatenate([READINGS[name] for name in ("gyro", "accelerometer", "magnetometer")])
    one = np.eye(9)
    before, read = np.linalg.solve(prior.covariance, one), np.linalg.solve(MODEL.noise, one)
    covariance = np.linalg.solve(before + read, one)
    np.testing.assert_allclose(posterior.covariance, covariance, rtol=1e-10, atol=1e-14)
    np.testing.assert_allclose(posterior.state, covariance @ (before @ prior.state + read @ z), rtol=1e-10)


def test_readings_may_come_one_by_one_or_not_at_all() -> None:
    """Noise of different sensors is independent, so three updates are one; no reading changes nothing."""
    prior = predict(at_rest([0.0, 0.0, 9.0], [1.0, 0.0, 0.0], MODEL), MODEL, 0.05)
    together, one_by_one = update(prior, MODEL, **READINGS), prior
    for name, values in READINGS.items():
        one_by_one = update(one_by_one, MODEL, **{name: values})
    np.testing.assert_allclose(one_by_one.state, together.state, atol=1e-11)
    np.testing.assert_allclose(one_by_one.covariance, together.covariance, atol=1e-11)
    assert update(prior, MODEL) is prior


def test_filter_is_consistent() -> None:
    """On data from its own model the mean NEES of 40 runs stays in its bounds, which 1 in 10,000 leaves.

    What a step adds to the rates turns the directions through half of it.
    """
    random, dt_s, errors, covariances = np.random.default_rng(5), 0.01, [], []
    for _ in range(40):
        truth = np.concatenate([np.zeros(3), GRAVITY, FIELD])
        first = truth + random.multivariate_normal(np.zeros(9), MODEL.noise)
        estimate = ImuEstimate(first, MODEL.noise)
        for _ in range(50):
            truth, F = propagate(truth, MODEL, dt_s)
            added = random.multivariate_normal(np.zeros(9), MODEL.process * dt_s)
            truth = truth + added
            truth[3:] += 0.5 * F[3:, :3] @ added[:3]
            z = truth + random.multivariate_normal(np.zeros(9), MODEL.noise)
            estimate = predict(estimate, MODEL, dt_s)
            estimate = update(estimate, MODEL, gyro=z[:3], accelerometer=z[3:6], magnetometer=z[6:])
        errors.append(estimate.state - truth)
        covariances.append(estimate.covariance)
    low, high = metrics.chi_square_bounds(9, 40, 0.9999)
    assert low < metrics.nees(errors, covariances).mean() < high


def test_gyro_is_integrated_by_the_trapezoidal_rule() -> None:
    """Speeding up at 4 rad/s² about x, sampled at 20 Hz: after half a second the angle is right to 1 %.

    Rectangles, before or after, would be off by half a step times the rate, 10 %. Directions are as good as not read;
    the rates are followed to noise² / (walk² dt), 1e-4 of a step.
    """
    blind = imu_model(INERTIA, noise=(0.01, 1e4, 1e4), walk=(5.0, 1e-3, 1e-3))
    estimate = ImuEstimate(at_rest(GRAVITY, FIELD, blind).state, np.diag(np.repeat([1e-6, 1e-6, 1e-6], 3)))
    for step in range(1, 11):
        estimate = update(predict(estimate, blind, 0.05), blind, gyro=[4.0 * 0.05 * step, 0.0, 0.0])
    angle = float(rot.log_quaternion(implied_attitude(estimate.state))[0])
    assert angle == pytest.approx(0.5, rel=0.01)


def test_a_body_that_stands_upright_knows_its_tilt() -> None:
    """A gust that pushes sideways as the filter starts is not taken for a tilt; the field alone says where north is."""
    gust, heading = np.array([2.0, -1.0, 9.6]), rot.euler_to_quaternion(0.0, 0.0, 0.7)
    estimate = at_rest(gust, rot.rotate(rot.conjugate(heading), FIELD), MODEL, upright=0.02)
    assert rot.angle_between(implied_attitude(estimate.state), heading) < 1e-12
    deviations = np.sqrt(np.diag(estimate.covariance)[3:6])
    np.testing.assert_allclose(deviations, [0.02 * np.linalg.norm(gust)] * 2 + [1.0])
    assert np.linalg.eigvalsh(estimate.covariance)[0] > 0.0
    for upright in (0.0, -0.1, math.inf, math.nan):
        with pytest.raises(BadInput, match="upright is"):
            at_rest(gust, FIELD, MODEL, upright=upright)


def test_covariance_stays_positive_and_the_time_constant_is_that_stated() -> None:
    """After a thousand steps P is symmetric and positive; a wrong force dies away with τ = noise √dt / walk = 2 s."""
    estimate = at_rest(GRAVITY, FIELD, MODEL)
    readings = {"gyro": np.zeros(3), "accelerometer": GRAVITY, "magnetometer": FIELD}
    for _ in range(1000):
        estimate = update(predict(estimate, MODEL, 0.01), MODEL, **readings)
    np.testing.assert_array_equal(estimate.covariance, estimate.covariance.T)
    assert np.linalg.eigvalsh(estimate.covariance)[0] > 0.0
    off = ImuEstimate(estimate.state + np.eye(9)[5], estimate.covariance)
    for _ in range(200):
        off = update(predict(off, MODEL, 0.01), MODEL, **readings)
    assert off.state[5] - 9.81 == pytest.approx(math.exp(-1.0), rel=0.02)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"noise": -np.eye(9)}, "noise must be positive definite: its smallest eigenvalue is -1"),
        ({"process": np.zeros((9, 9))}, "process must be positive definite: its smallest eigenvalue is 0"),
        ({"inertia": np.diag([1.0, 1.0, 0.0])}, "inertia must be positive definite"),
        ({"noise": np.eye(9) + np.eye(9, k=1)}, "noise is not symmetric"),
        ({"inertia": np.eye(2)}, "inertia has shape"),
        ({"process": np.full((9, 9), np.nan)}, "process holds a value that is not finite"),
    ],
)
def test_models_that_are_none_are_refused(change: dict[str, Floats], message: str) -> None:
    """Covariances and the inertia are symmetric and positive definite."""
    with pytest.raises(BadInput, match=message):
        ImuModel(**{"inertia": INERTIA, "process": np.eye(9), "noise": np.eye(9), **change})


@pytest.mark.parametrize("deviations", [(0.01, 0.0, 0.02), (0.01, -1.0, 0.02), (0.01, 1.0, math.inf)])
def test_deviations_that_are_none_are_refused(deviations: tuple[float, float, float]) -> None:
    """Zero, negative and infinite ones, with the name of the triple."""
    with pytest.raises(BadInput, match=r"noise is .* three positive deviations"):
        imu_model(INERTIA, noise=deviations, walk=(1.0, 1.0, 1.0))
    with pytest.raises(BadInput, match=r"walk is .* three positive deviations"):
        imu_model(INERTIA, noise=(1.0, 1.0, 1.0), walk=deviations)


@pytest.mark.parametrize("dt_s", [0.0, -0.01, 0.11, math.nan])
def test_steps_that_prediction_does_not_allow_are_refused(dt_s: float) -> None:
    """Not positive, or longer than the Euler step holds; the message has the bound."""
    with pytest.raises(BadInput, match=r"above 0 and at most 0\.1 s"):
        predict(at_rest(GRAVITY, FIELD, MODEL), MODEL, dt_s)


@pytest.mark.parametrize("reading", [[1.0, 2.0], [math.nan, 0.0, 0.0]])
def test_readings_that_are_none_are_refused(reading: list[float]) -> None:
    """Three finite numbers each."""
    with pytest.raises(BadInput, match="a reading"):
        update(at_rest(GRAVITY, FIELD, MODEL), MODEL, gyro=reading)


@pytest.mark.parametrize(
    ("force", "field", "missing"),
    [
        ([0.0] * 3, [1.0, 0.0, 0.0], "no up"),
        ([0.0, 0.0, 9.0], [0.0, 0.0, 1.0], "no north"),
        ([0, 0, 9], [0] * 3, "no north"),
    ],
)
def test_directions_without_a_frame_are_refused(force: list[float], field: list[float], missing: str) -> None:
    """No force, no field, or a field along it."""
    with pytest.raises(BadInput, match=missing):
        implied_attitude(at_rest(force, field, MODEL).state)


def _seen(attitude: Floats) -> tuple[Floats, Floats]:
    """Force and field in the body at rest in that attitude."""
    back = rot.conjugate(attitude)
    return rot.rotate(back, GRAVITY), rot.rotate(back, FIELD)
