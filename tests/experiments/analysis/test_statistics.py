"""Intervals and paired tests, against values that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from volery.errors import BadInput
from volery.experiments.analysis.statistics import holm, mean_interval, paired_test, seeds_needed


def seeded(values: list[float]) -> dict[int, float]:
    """Seed → value."""
    return dict(enumerate(values))


def test_interval_is_students() -> None:
    """1 … 5: mean 3, s = √2.5, t(0.975; 4) = 2.776 of any table."""
    one = mean_interval([1, 2, 3, 4, 5])
    half = 2.776445 * math.sqrt(2.5 / 5)
    assert (one.mean, one.low, one.high, one.count) == pytest.approx((3, 3 - half, 3 + half, 5), rel=1e-6)
    assert mean_interval([1, 2, 3, 4, 5], 0.5).high < one.high


def test_interval_covers_as_often_as_it_says() -> None:
    """Of 2000 samples of six normal numbers 80 % have the mean within: ± 4 standard errors of 0.9 %."""
    draws = np.random.default_rng(1).normal(2.0, 3.0, size=(2000, 6))
    intervals = [mean_interval(list(row), 0.8) for row in draws]
    covered = sum(one.low < 2.0 < one.high for one in intervals) / 2000
    assert covered == pytest.approx(0.8, abs=0.036)


def test_too_few_or_infinite_values_have_no_interval() -> None:
    """One value has a mean, none has nothing; a run that diverged makes the mean infinite."""
    assert math.isnan(mean_interval([]).mean)
    assert mean_interval([4.0]).mean == 4.0
    assert math.isnan(mean_interval([4.0]).low)
    diverged = mean_interval([1.0, math.inf, 2.0])
    assert diverged.mean == math.inf
    assert math.isnan(diverged.high)
    with pytest.raises(BadInput, match="between 0 and 1"):
        mean_interval([1, 2], 95)


def test_signed_ranks() -> None:
    """If the first is smaller on all of n seeds, p is 2/2ⁿ, exactly; ranks and not sizes count, but direction does."""
    small, large = seeded([1.0, 2, 3, 4, 5, 6, 7]), seeded([1.1, 2.2, 3.3, 4.4, 5.5, 6.6, math.inf])
    assert paired_test(small, large) == (2 / 2**7, True)
    assert paired_test(large, small) == (2 / 2**7, False)
    mixed = seeded([1.1, 1.8, 3.3, 3.6, 5.5, 5.4, 7.7])
    differences = [small[seed] - mixed[seed] for seed in small]
    assert paired_test(small, mixed).p == pytest.approx(stats.wilcoxon(differences).pvalue)
    assert paired_test(small, mixed).p > 0.3


def test_only_common_seeds_count() -> None:
    """Values of other seeds change nothing; without a common seed nothing can be told, and equal pairs tell nothing."""
    small, large = seeded([1.0, 2, 3, 4, 5, 6]), seeded([2.0, 3, 4, 5, 6, 7])
    assert paired_test({**small, 50: 100.0}, {**large, 60: 0.0}) == paired_test(small, large)
    assert math.isnan(paired_test({1: 1.0}, {2: 1.0}).p)
    assert paired_test(small, small) == (1.0, False)
    assert paired_test({1: math.inf}, {1: math.inf}).p == 1.0


def test_holm() -> None:
    """0.01, 0.04, 0.03, 0.005 of four: 0.005·4, 0.01·3, 0.03·2, and 0.04 no less than that; NaN counts for nothing."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.01, math.nan, 0.04])[0] == pytest.approx(0.02)
    assert math.isnan(holm([0.01, math.nan])[1])
    assert holm([0.9, 0.8]) == [1.0, 1.0]


@pytest.mark.parametrize("tests", [1, 3, 6, 91])
def test_seeds_needed(tests: int) -> None:
    """With so many seeds all on one side a corrected p is below 0.05, with one less it is not."""
    seeds = seeds_needed(tests)
    clear = paired_test(seeded([0.0] * seeds), seeded([float(seed + 1) for seed in range(seeds)]))
    less = paired_test(seeded([0.0] * (seeds - 1)), seeded([float(seed + 1) for seed in range(seeds - 1)]))
    assert holm([clear.p] * tests)[0] < 0.05 <= holm([less.p] * tests)[0]
