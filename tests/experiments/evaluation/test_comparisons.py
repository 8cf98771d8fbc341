"""Bounds: chance stays within them as often as they say, and what is wrong does not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.experiments.evaluation.comparisons import (
    FALSE_ALARM,
    NOTHING,
    compare_all,
    compare_fraction,
    compare_mean,
    significance,
)

ALPHA = 0.01
RUNS = 2000
TOLERATED = ALPHA + 3 * math.sqrt(ALPHA * (1 - ALPHA) / RUNS)
"""Three standard errors above the probability of a false alarm."""


def bursts(rng: np.random.Generator, frames: int) -> NDArray[np.int64]:
    """Frames lost in each of RUNS runs of a chain with to_bad 0.05 and to_good 0.3 that loses all in the bad state."""
    bad = rng.random(RUNS) < 1 / 7
    lost = bad.astype(np.int64)
    for _ in range(frames - 1):
        draws = rng.random(RUNS)
        bad = np.where(bad, draws >= 0.3, draws < 0.05)
        lost += bad
    return lost


@pytest.mark.parametrize("law", ["independent", "mixed", "bursts"])
def test_chance_stays_within_the_bounds_of_a_fraction(law: str) -> None:
    """Of sound runs no more are outside than the probability of a false alarm allows."""
    rng, frames = np.random.default_rng(1), 500
    if law == "bursts":
        expected, counts = [1 / 7] * frames, bursts(rng, frames)
        variance = frames * (6 / 49) * (1 + 0.65) / (1 - 0.65)
    else:
        expected = [0.1] * frames if law == "independent" else [0.01, 0.6] * (frames // 2)
        counts = (rng.random((RUNS, frames)) < expected).sum(axis=1)
        variance = sum(p * (1 - p) for p in expected)
    outside = [compare_fraction(expected, int(count), variance, ALPHA).decision == "outside" for count in counts]
    assert np.mean(outside) <= TOLERATED


def test_bound_of_a_fraction_is_that_of_chernoff() -> None:
    """At both bounds exp(−n·D(q‖p)) is α/2; for 1000 frames they lie 3.3 standard errors off, normal ones would 2.6."""
    found = compare_fraction([0.3] * 1000, 300, 1000 * 0.21, ALPHA)
    for q in (found.low, found.high):
        divergence = q * math.log(q / 0.3) + (1 - q) * math.log((1 - q) / 0.7)
        assert math.exp(-1000 * divergence) == pytest.approx(ALPHA / 2)
    assert found.decision == "within"
    assert (found.high - 0.3) / math.sqrt(0.21 / 1000) == pytest.approx(3.3, abs=0.1)


@pytest.mark.parametrize(
    ("probability", "frames", "happened", "decision"),
    [
        (0.3, 1000, 400, "outside"),
        (0.3, 1000, 200, "outside"),
        (0.3, 10, 2, "too few"),
        (0.3, 10, 10, "outside"),
        (0.0, 3, 0, "within"),
        (0.0, 100_000, 1, "outside"),
        (1.0, 3, 3, "within"),
        (1.0, 100_000, 99_999, "outside"),
    ],
)
def test_decisions_on_a_fraction(probability: float, frames: int, happened: int, decision: str) -> None:
    """What must never happen is outside when it happens once; a few frames tell nothing of what may happen."""
    variance = frames * probability * (1 - probability)
    assert compare_fraction([probability] * frames, happened, variance, ALPHA).decision == decision


def test_bursts_widen_the_bound() -> None:
    """Losses with four times the variance of independent ones count as a quarter of the frames."""
    few = compare_fraction([0.2] * 250, 50, 250 * 0.16, ALPHA)
    bursty = compare_fraction([0.2] * 1000, 200, 4 * 1000 * 0.16, ALPHA)
    assert (bursty.low, bursty.high) == pytest.approx((few.low, few.high))


def test_chance_stays_within_the_bounds_of_a_mean() -> None:
    """Also where the law is skewed, as an exponential one."""
    rng = np.random.default_rng(2)
    runs = rng.exponential(5.0, (RUNS, 1000))
    decisions = [compare_mean([5.0] * 1000, list(run), 1.0, ALPHA, 0.0).decision for run in runs]
    telling = [decision for decision in decisions if decision != "too few"]
    assert len(telling) > RUNS / 2
    assert telling.count("outside") / len(telling) <= TOLERATED


def test_a_mean_that_is_off_is_outside() -> None:
    """By more than its bound of 2.6 standard errors, to either side."""
    values = np.random.default_rng(3).normal(0.0, 1.0, 1000)
    values -= values.mean()
    error = values.std() / math.sqrt(1000)
    for shift, decision in ((2.4, "within"), (2.8, "outside"), (-2.8, "outside")):
        shifted = list(values + shift * error)
        assert compare_mean([0.0] * 1000, shifted, 1.0, ALPHA, 0.0).decision == decision
    assert compare_mean([0.0] * 1000, list(values + 2.8 * error), 2.0, ALPHA, 0.0).decision == "within"


def test_the_bound_of_a_skewed_mean_is_not_below_what_can_be() -> None:
    """Fifteen latencies, three of them long: the symmetric bound, shifted for skewness, would become negative."""
    values = [0.1] * 12 + [20.0] * 3
    asked = [4.08] * 15
    assert compare_mean(asked, values, 1.0, ALPHA, 0.0).low < 0.0
    found = compare_mean(asked, values, 1.0, ALPHA, 0.0, 0.01)
    assert found.low == 0.01
    assert found.decision == compare_mean(asked, values, 1.0, ALPHA, 0.0).decision


def test_a_mean_that_one_value_decides_tells_nothing() -> None:
    """A heavy tail."""
    assert compare_mean([1.0] * 100, [0.0] * 99 + [1000.0], 1.0, ALPHA, 0.0).decision == "too few"


def test_what_is_not_random_is_exact_up_to_rounding() -> None:
    """One value of a constant suffices to tell, both ways."""
    assert compare_mean([5.0], [6.0], 1.0, ALPHA, 1.0).decision == "within"
    assert compare_mean([5.0] * 2, [7.0] * 2, 1.0, ALPHA, 1.0).decision == "outside"


def test_values_that_must_be_equal() -> None:
    """One that is off is enough, whatever the mean."""
    assert compare_all([1, 2], [1, 2], sum).decision == "within"
    assert compare_all([1, 2], [2, 1], sum).decision == "outside"


def test_nothing_to_compare() -> None:
    """Without frames there is no decision."""
    assert compare_fraction([], 0, 0.0, ALPHA) == compare_mean([], [], 1.0, ALPHA, 1.0) == NOTHING
    assert compare_all([], [], sum) == NOTHING


def test_comparisons_share_the_false_alarms() -> None:
    """Bonferroni: a run of a hundred comparisons has no more false alarms than a run of one."""
    assert significance(100) * 100 == significance(1) == significance(0) == FALSE_ALARM
