"""Metrics, against closed forms and against scipy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from volery.errors import BadInput
from volery.estimators import error_measures as metrics
from volery.randomness import stream
from volery.rotations import angle_between, exp_quaternion, quaternion_product
from volery.topologies import agents, contraction, metropolis, random_hexagonal, weight_matrix

SECOND = 1_000_000_000


def test_error_is_the_norm_of_the_difference_and_nan_without_an_estimate() -> None:
    """Over the last axis, broadcast against one reference."""
    found = metrics.error([[[3.0, 4.0], [np.nan, 0.0]]], [0.0, 0.0])
    np.testing.assert_array_equal(found, [[5.0, np.nan]])


@given(
    st.lists(st.floats(-4.0, 4.0), min_size=6, max_size=6), st.sampled_from([-1.0, 1.0]), st.sampled_from([-1.0, 1.0])
)
def test_attitudes_differ_by_the_turn_between_them(turns: list[float], first: float, second: float) -> None:
    """About inertial axes, by the angle between the two, whatever the signs; turning on leads there."""
    q, p = exp_quaternion(np.array(turns[:3])), exp_quaternion(np.array(turns[3:]))
    found = metrics.attitude_difference([[first * p, np.full(4, np.nan)]], second * q)
    assert found.shape == (1, 2, 3)
    assert np.isnan(found[0, 1]).all()
    assert np.linalg.norm(found[0, 0]) == pytest.approx(angle_between(p, q), abs=1e-12)
    assert angle_between(quaternion_product(exp_quaternion(found[0, 0]), q), p) < 1e-7


def test_an_attitude_does_not_differ_from_itself_or_its_opposite() -> None:
    """The difference is zero, and not NaN."""
    q = exp_quaternion(np.array([0.3, -0.2, 1.0]))
    np.testing.assert_array_equal(metrics.attitude_difference([q, -q], q), np.zeros((2, 3)))


def test_disagreement_is_the_root_mean_square_distance_from_the_mean() -> None:
    """Of 0 and 2 it is 1; agents without an estimate are left out; a single agent has none."""
    nan = np.nan
    series = [[[0.0], [2.0], [nan]], [[0.0], [3.0], [3.0]], [[1.0], [nan], [nan]], [[nan], [nan], [nan]]]
    np.testing.assert_allclose(metrics.disagreement(series), [1.0, 2.0**0.5, nan, nan])


@given(st.lists(st.floats(0.0, 2.0) | st.just(float("nan")), min_size=1, max_size=30))
def test_convergence_time_is_the_first_after_which_all_is_below(errors: list[float]) -> None:
    """Held against the definition, element by element."""
    times = [10 * k for k in range(len(errors))]
    staying = [t for k, t in enumerate(times) if all(e <= 1.0 for e in errors[k:])]
    assert metrics.convergence_time(times, errors, 1.0) == (staying[0] if staying else None)


def test_recovery_time_counts_from_the_instant_to_where_the_error_stays_below() -> None:
    """It looks no further than the next fault, is 0 where nothing was above, and None where it does not recover."""
    times = [k * SECOND for k in range(8)]
    errors = [0.0, 0.0, 5.0, 3.0, 0.5, 0.2, 9.0, 9.0]
    assert metrics.recovery_time(times, errors, 1.0, after_ns=2 * SECOND - 5, before_ns=6 * SECOND) == 2 * SECOND + 5
    assert metrics.recovery_time(times, errors, 1.0, after_ns=4 * SECOND - 5, before_ns=6 * SECOND) == 0
    assert metrics.recovery_time(times, errors, 1.0, after_ns=2 * SECOND) is None
    assert metrics.recovery_time(times, errors, 1.0, after_ns=8 * SECOND) is None


def test_contraction_of_a_geometric_series_is_its_ratio() -> None:
    """Whatever it begins with."""
    assert metrics.contraction(3.0 * 0.8 ** np.arange(20)) == pytest.approx(0.8, abs=1e-12)


def test_measured_contraction_is_the_predicted_one() -> None:
    """Late rounds of Metropolis averaging shrink by the essential spectral radius of the weights."""
    graph = random_hexagonal(8, 3)
    matrix = weight_matrix(graph, metropolis(graph))
    values = np.array([stream(1, "test", n).normal(0) for n in agents(graph)])
    history = []
    for _ in range(120):
        values = matrix @ values
        history.append(values[:, np.newaxis])
    # After 80 rounds faster modes, by a ratio of 0.93 or less here, are below 1e-2 of the slowest.
    measured = metrics.contraction(metrics.disagreement(np.array(history[80:])))
    assert measured == pytest.approx(contraction(matrix), rel=1e-3)


@pytest.mark.parametrize("bad", [[1.0], [1.0, 0.0], [1.0, np.nan], [[1.0, 2.0]]])
def test_contraction_refuses_what_has_no_logarithm(bad: list[float]) -> None:
    """Fewer than two rounds, zero, NaN."""
    with pytest.raises(BadInput, match="disagreements"):
        metrics.contraction(bad)


def test_mean_nees_of_a_consistent_filter_lie_in_their_bounds() -> None:
    """500 errors drawn from their own covariance; at confidence 1 − 1e-6 a wrong scale of 1.2 falls outside."""
    covariance = np.array([[2.0, 0.5], [0.5, 1.0]])
    draws = stream(4, "test", "nees")
    white = np.array([[draws.normal(2 * k), draws.normal(2 * k + 1)] for k in range(500)])
    errors = white @ np.linalg.cholesky(covariance).T
    low, high = metrics.chi_square_bounds(2, 500, 1 - 1e-6)
    values = metrics.nees(errors, np.broadcast_to(covariance, (500, 2, 2)))
    np.testing.assert_allclose(values, (white**2).sum(axis=1), rtol=1e-12)
    assert low < values.mean() < high
    assert not low < metrics.nees(errors * 1.2, covariance).mean() < high


@given(dimension=st.integers(1, 12), samples=st.integers(1, 500), confidence=st.floats(0.5, 0.999))
def test_bounds_are_quantiles_of_the_chi_square_law(dimension: int, samples: int, confidence: float) -> None:
    """Of the mean of independent values, by scipy's distribution."""
    low, high = metrics.chi_square_bounds(dimension, samples, confidence)
    law = stats.chi2(dimension * samples)
    assert law.cdf(low * samples) == pytest.approx((1 - confidence) / 2, rel=1e-6)
    assert law.sf(high * samples) == pytest.approx((1 - confidence) / 2, rel=1e-6)


def test_integrated_square_error_of_a_ramp() -> None:
    """∫ t² dt over 2 s is 8/3; the trapezoidal rule errs by h² · 2/12 · 2 with h = 1 ms."""
    times = np.arange(0, 2 * SECOND + 1, SECOND // 1000)
    assert metrics.integrated_square_error(times, times * 1e-9) == pytest.approx(8 / 3, abs=1e-6)
    assert metrics.integrated_square_error([], []) == 0.0


def test_series_of_different_lengths_and_bounds_out_of_range_are_refused() -> None:
    """The message gives both shapes, or the arguments."""
    with pytest.raises(BadInput, match=r"\(2,\) and errors \(3,\)"):
        metrics.convergence_time([0, 1], [1.0, 1.0, 1.0], 1.0)
    for bad in ((0, 1, 0.95), (1, 0, 0.95), (1, 1, 1.0)):
        with pytest.raises(BadInput, match="samples"):
            metrics.chi_square_bounds(*bad)
