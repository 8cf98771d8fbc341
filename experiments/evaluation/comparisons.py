"""What was asked against what was got, and whether chance explains the difference.

All comparisons of a run share one probability that any of them fails although the run is sound: each has its part of
it (Bonferroni). Nothing here knows links or frames.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

Decision = Literal["within", "outside", "too few", "not comparable", "nothing"]
"""`too few` to tell, `not comparable` because something else changes it by rights or a model does not say what to
expect, `nothing` to compare.
"""
FALSE_ALARM = 1e-3
"""Probability that a sound run has any comparison outside its bounds, at most."""
_SINGLE_SHARE = 0.05
_HALVINGS = 60


@dataclass(frozen=True)
class Comparison:
    """One quantity of one link: `asked` and `got`, and what a sound run may get, from `low` to `high`; NaN without any.

    `samples`: how many frames it rests on.
    """

    samples: int = 0
    asked: float = math.nan
    got: float = math.nan
    low: float = math.nan
    high: float = math.nan
    decision: Decision = "nothing"


NOTHING = Comparison()


@dataclass(frozen=True)
class Channel:
    """Asked against got on one link, over the `frames` that it put on the air.

    `loss`: fraction that the loss models lose, of frames sent while the link was not cut. `corruption`: of those not
    lost, and of copies. `duplication`: of those not lost. `latency`: mean time from the last bit out to due, or to when
    a frame really came if that was later, without duplicates and without the time for which the link held a frame [ns];
    not comparable where keeping the order has held frames up. `rate`: bits over airtime [bit/s], exact for each frame,
    and no two overlap. `burst`: token bucket, by how many bits what left in any span exceeded what the bucket's rate
    gives in that span, on a radio by all of its links.
    """

    frames: int
    loss: Comparison
    corruption: Comparison
    duplication: Comparison
    latency: Comparison
    rate: Comparison
    burst: Comparison

    def comparisons(self) -> dict[str, Comparison]:
        """Each of them by name."""
        return {name: value for name, value in vars(self).items() if isinstance(value, Comparison)}


def significance(comparisons: int) -> float:
    """Probability of a false alarm that each of so many comparisons may have: FALSE_ALARM divided among them."""
    return FALSE_ALARM / max(comparisons, 1)


def compare_fraction(expected: Sequence[float], happened: int, variance: float, alpha: float) -> Comparison:
    """Events that happen with known probabilities, against how many of them did.

    Chernoff's bound for sums of indicators: P(fraction ≥ q), for q above p, and P(fraction ≤ q) below it, are at most
    exp(−n·D(q‖p)), D(q‖p) = q ln(q/p) + (1 − q) ln((1 − q)/(1 − p))            Hoeffding 1963, theorem 1
    The bounds are where that is α/2. Events that come in bursts count for fewer: n = N²·p(1 − p) / variance, at most N.
    Too few to tell: a link on which it always happens, or never, would be within the bounds.

    Args:
        expected: the probability of each of N events; NaN where it is not known.
        happened: how many happened.
        variance: long-run variance of their number, dependence included.
        alpha: probability of a false alarm.
    """
    count = len(expected)
    if not count:
        return NOTHING
    mean, got = math.fsum(expected) / count, happened / count
    if math.isnan(mean):
        return Comparison(count, mean, got, decision="not comparable")
    if variance <= 0:
        exact = round(mean * count) == happened
        return Comparison(count, mean, got, mean, mean, "within" if exact else "outside")
    effective = count * min(1.0, count * mean * (1 - mean) / variance)
    spread = math.log(2 / alpha) / effective
    low = _where_divergence_is(spread, mean, 0.0)
    high = _where_divergence_is(spread, mean, 1.0)
    if not low <= got <= high:
        return Comparison(count, mean, got, low, high, "outside")
    telling = low > 0 and high < 1
    return Comparison(count, mean, got, low, high, "within" if telling else "too few")


def _divergence(q: float, p: float) -> float:
    """D(q‖p) of two probabilities."""
    return sum(a * math.log(a / b) for a, b in ((q, p), (1 - q, 1 - p)) if a > 0)


def _where_divergence_is(spread: float, p: float, end: float) -> float:
    """Where, between p and an end of [0, 1], D(q‖p) reaches a value; the end, where it does not."""
    if _divergence(end, p) <= spread:
        return end
    near, far = p, end
    for _ in range(_HALVINGS):
        middle = (near + far) / 2
        near, far = (middle, far) if _divergence(middle, p) <= spread else (near, middle)
    return near


def compare_mean(
    asked: Sequence[float],
    got: Sequence[float],
    inflation: float,
    alpha: float,
    rounding: float,
    least: float = -math.inf,
) -> Comparison:
    """The mean of values whose expectations are known, by its standard error.

    Bound: z(1 − α/2) · s · √(inflation / n) + rounding, s the standard deviation of the deviations got − asked, and the
    mean deviation d corrected for their skewness: d + μ₃/(6s²n) + μ₃d²/(3s⁴)          Johnson 1978, (2.5)
    Too few to tell: one value makes up over a twentieth of s², so that the mean is not normal yet.

    Args:
        asked: expectation of each value.
        got: the values.
        inflation: long-run variance of their mean relative to that of independent values; NaN if it is not known.
        alpha: probability of a false alarm.
        rounding: difference that rounding explains, and the greatest one where nothing is random.
        least: what no mean can be below, which the bound of a skewed law may be.
    """
    count = len(got)
    if not count:
        return NOTHING
    mean_asked, mean_got = math.fsum(asked) / count, math.fsum(got) / count
    if math.isnan(mean_asked) or math.isnan(inflation):
        return Comparison(count, mean_asked, mean_got, decision="not comparable")
    deviations = [value - expected for value, expected in zip(got, asked, strict=True)]
    if max(map(abs, deviations)) <= rounding:
        return Comparison(count, mean_asked, mean_got, mean_asked - rounding, mean_asked + rounding, "within")
    centre = mean_got - mean_asked
    squares = [(value - centre) ** 2 for value in deviations]
    variance = math.fsum(squares) / count
    third = math.fsum((value - centre) ** 3 for value in deviations) / count
    shift = third / (6 * variance * count) + third * centre**2 / (3 * variance**2) if variance else 0.0
    z = -NormalDist().inv_cdf(alpha / 2)
    bound = z * math.sqrt(variance * inflation / count) + rounding
    low, high = max(least, mean_asked - bound - shift), mean_asked + bound - shift
    few = max(squares) * inflation > _SINGLE_SHARE * variance * count > 0
    decision: Decision = "too few" if few else "within" if low <= mean_got <= high else "outside"
    return Comparison(count, mean_asked, mean_got, low, high, decision)


def compare_all(asked: Sequence[float], got: Sequence[float], mean: Callable[[Sequence[float]], float]) -> Comparison:
    """Values that must equal what is asked, each of them; `mean` says what is shown of many."""
    if not asked:
        return NOTHING
    wanted = mean(asked)
    same = all(one == other for one, other in zip(asked, got, strict=True))
    return Comparison(len(asked), wanted, mean(got), wanted, wanted, "within" if same else "outside")
