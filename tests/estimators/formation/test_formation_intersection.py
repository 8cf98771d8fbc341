"""Covariance intersection: never too small, least determinant, and the formula that is its shadow."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from volery.estimators.formation.filter import FormationFilter, Observation
from volery.estimators.formation.formation_messages import bound_of
from volery.estimators.formation.intersection import LEAST_WEIGHT, fast_weight, intersect, optimal_weight
from volery.estimators.formation.model import FormationModel
from volery.randomness import stream

MODEL = FormationModel(3)


def joint(size: int, seed: int) -> NDArray[np.float64]:
    """Covariance of the own error, 12 entries, and of a message's, `size` entries, correlated at random."""
    draws = stream(seed, "test", "joint")
    rows = 12 + size
    root = np.array([draws.normal(i) for i in range(rows * rows)]).reshape(rows, rows)
    scale = np.exp(np.array([draws.normal(rows * rows + i) for i in range(rows)]))
    matrix: NDArray[np.float64] = np.outer(scale, scale) * (root @ root.T / rows)
    return matrix


@settings(max_examples=40)
@given(seed=st.integers(0, 10_000), whole=st.booleans(), fast=st.booleans())
def test_whatever_the_correlation_the_covariance_is_not_too_small(seed: int, whole: bool, fast: bool) -> None:
    """Against the true covariance of the fused error, from the joint one; tolerance: rounding of the largest entry."""
    pairs = ((0, 1), (1, 2)) if whole else ((2, 0),)
    size = 6 * len(pairs)
    both = joint(size, seed)
    P, N, cross = both[:12, :12], both[12:, 12:], both[:12, 12:]
    own = FormationFilter(MODEL, np.zeros(12), P)
    gain = np.zeros((12, size))
    for column in range(size):  # the update is linear: feed it unit vectors to see its gain
        probe = FormationFilter(MODEL, np.zeros(12), P)
        intersect(probe, Observation(pairs, np.eye(size)[column], N), "fast" if fast else "optimal")
        gain[:, column] = probe.state
    weight = intersect(own, Observation(pairs, np.zeros(size), N), "fast" if fast else "optimal")
    rest = np.eye(12) - gain @ MODEL.output_map(pairs, velocities=True)
    true = rest @ P @ rest.T + gain @ N @ gain.T + rest @ cross @ gain.T + gain @ cross.T @ rest.T
    assert LEAST_WEIGHT <= weight <= 1.0
    assert np.linalg.eigvalsh(own.covariance - true).min() > -1e-9 * np.abs(P).max()


@settings(max_examples=40)
@given(seed=st.integers(0, 10_000), size=st.sampled_from([6, 12]), scale=st.floats(0.01, 3.0))
def test_optimal_weight_has_the_least_determinant(seed: int, size: int, scale: float) -> None:
    """Of all on a grid of a thousand, by the information form; tolerance: the grid's and the weight's resolution."""
    both = joint(size, seed)
    P, N, H = both[:12, :12], scale * both[12:, 12:], np.eye(12)[:size]
    weight = optimal_weight(H @ P @ H.T, N, 12)

    def spread(omega: float) -> float:
        information = omega * np.linalg.solve(P, np.eye(12)) + (1 - omega) * H.T @ np.linalg.solve(N, H)
        return float(-np.linalg.slogdet(information)[1])

    assert spread(weight) <= min(spread(omega) for omega in np.linspace(LEAST_WEIGHT, 1.0, 1000)) + 1e-6


@pytest.mark.parametrize(("size", "ratio"), [(6, 0.5), (6, 1.9), (6, 2.1), (6, 50.0), (12, 0.9), (12, 30.0)])
def test_fast_weight_is_optimal_where_the_message_is_better_alike_in_every_direction(size: int, ratio: float) -> None:
    """And it is of no use, ω = 1, where it is not better by more than n/k."""
    told = joint(size, 5)[12:, 12:]
    fast, optimal = fast_weight(ratio * told, told, 12), optimal_weight(ratio * told, told, 12)
    assert fast == pytest.approx(optimal, abs=2e-6)
    assert (fast == 1.0) == (ratio * size <= 12)


@settings(max_examples=40)
@given(seed=st.integers(0, 10_000))
def test_a_bound_is_never_below_and_at_most_twice_the_largest_of_each_half(seed: int) -> None:
    """diag(σ_p² I, σ_v² I) − P has no negative eigenvalue; tolerance: rounding."""
    covariance = joint(6, seed)[12:, 12:]
    position, velocity = bound_of(covariance)
    bound = np.diag(np.repeat([position**2, velocity**2], 3))
    assert np.linalg.eigvalsh(bound - covariance).min() > -1e-12 * bound.max()
    assert position**2 <= 2.0 * np.linalg.eigvalsh(covariance[:3, :3])[-1] * (1 + 1e-12)
    assert velocity**2 <= 2.0 * np.linalg.eigvalsh(covariance[3:, 3:])[-1] * (1 + 1e-12)


def test_the_covariance_stays_symmetric_and_positive_over_thousands_of_messages() -> None:
    """As in a minute of flight: rounding is not amplified by the inflation that each message brings."""
    own = FormationFilter(MODEL, np.zeros(12), (0.3, 0.3))
    sighting = Observation(((0, 1),), np.zeros(3), 4e-4 * np.eye(3))
    told = np.diag(np.repeat([1.6e-3, 0.1], 3))
    for step in range(1800):
        own.predict(step * MODEL.step_ns + MODEL.step_ns, np.zeros(9))
        own.update((sighting,))
        if step % 3 == 0:
            pair = ((1, 2), (2, 0))[step % 2]
            assert 0.0 < intersect(own, Observation((pair,), np.zeros(6), told)) <= 1.0
    assert np.linalg.eigvalsh(own.covariance).min() > 1e-6
    assert np.abs(own.covariance).max() < 10.0
