"""How sure a mean is, and whether one series is smaller than another on common seeds.

Intervals: Student's t over the seeds. Tests: Wilcoxon's signed-rank test of the differences on common seeds, two-sided;
errors under link failures have heavy tails, and ranks do not mind. Many tests: Holm's correction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...errors import BadInput

CONFIDENCE = 0.95
SIGNIFICANCE = 0.05
_BEYOND = 1e300
"""Stands for an infinite difference: only its rank counts."""


@dataclass(frozen=True)
class Interval:
    """A mean of `count` values with its confidence interval; NaN where there are too few."""

    mean: float
    low: float
    high: float
    count: int


def mean_interval(values: Sequence[float], confidence: float = CONFIDENCE) -> Interval:
    """The mean of n values and m ± t·s/√n, t the (1 + confidence)/2 quantile of Student's law of n − 1 degrees.

    An infinite value makes the mean infinite, and then there is no interval.

    Raises:
        BadInput: a confidence out of bounds.
    """
    if not 0 < confidence < 1:
        raise BadInput(f"confidence is {confidence:g}, it must lie between 0 and 1: 0.95 is usual")
    count = len(values)
    if not count:
        return Interval(math.nan, math.nan, math.nan, 0)
    array = np.asarray(values, dtype=float)
    mean = float(array.mean())
    if count < 2 or not math.isfinite(mean):
        return Interval(mean, math.nan, math.nan, count)
    from scipy.special import stdtrit

    half = float(stdtrit(count - 1, (1 + confidence) / 2) * array.std(ddof=1) / math.sqrt(count))
    return Interval(mean, mean - half, mean + half, count)


class Paired(NamedTuple):
    """A paired test: two-sided p-value, NaN without a common seed, and whether the first tends to be smaller."""

    p: float
    first_smaller: bool


def paired_test(first: Mapping[int, float], second: Mapping[int, float]) -> Paired:
    """Wilcoxon's signed-rank test on common seeds.

    W = Σ sign(dᵢ)·rank(|dᵢ|)                                                                      Wilcoxon 1945
    Equal pairs say nothing and are left out; p is 1 if all are equal.
    """
    seeds = sorted(first.keys() & second.keys())
    differences = [_difference(first[seed], second[seed]) for seed in seeds]
    unequal = np.array([difference for difference in differences if difference])
    if not len(unequal):
        return Paired(1.0 if seeds else math.nan, first_smaller=False)
    from scipy.stats import rankdata, wilcoxon

    ranks = rankdata(np.abs(unequal))
    return Paired(float(wilcoxon(unequal).pvalue), first_smaller=bool((np.sign(unequal) * ranks).sum() < 0))


def seeds_needed(tests: int) -> int:
    """The fewest common seeds with which one of so many Holm-corrected tests can tell: n·2^(1 − seeds) < 0.05."""
    return 2 + math.floor(math.log2(tests / SIGNIFICANCE)) if tests else 0


def _difference(first: float, second: float) -> float:
    if first == second:
        return 0.0
    return float(np.clip(first - second, -_BEYOND, _BEYOND))


def holm(ps: Sequence[float]) -> list[float]:
    """Adjusted p-values, so that below α none is wrong but with probability α; NaN stays and counts for nothing.

    The k-th smallest of n becomes max over j ≤ k of (n − j + 1)·p_j, at most 1                             Holm 1979
    """
    known = sorted((p, place) for place, p in enumerate(ps) if not math.isnan(p))
    adjusted, largest = list(ps), 0.0
    for rank, (p, place) in enumerate(known):
        largest = max(largest, min(1.0, (len(known) - rank) * p))
        adjusted[place] = largest
    return adjusted
