"""Latency models at work: the function that gives the latency of each frame of one directed link.

For a distribution with upper tail S(x) = P(X > x), truncated below at m, x = S⁻¹(S(m)·v) with v uniform in (0, 1) has
the truncated distribution: one draw per frame.

`correlation` ρ: v = Φ(−z) with zₖ = ρzₖ₋₁ + √(1 − ρ²)·Φ⁻¹(uₖ), in the order of the frames (a Gaussian copula over an
AR(1) process, Nelsen 2006, §2.3). The distribution of each latency stays exact; the correlation of latencies k apart is
at most ρᵏ, and near it for distributions that are nearly normal (Gebelein 1941).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from .directed_link import DirectedLink
from .latency_settings import (
    STANDARD_NORMAL,
    Constant,
    Distribution,
    Gamma,
    Latency,
    LatencyTrace,
    LogNormal,
    Normal,
    Pareto,
    Uniform,
)

_BELOW_ONE = math.nextafter(1.0, 0.0)
_ROOT_HALF = math.sqrt(0.5)
LatencyStage = Callable[[int, int], int]
"""(index as of a loss stage, end of the airtime in nanoseconds) → latency in nanoseconds; called in order."""
_Quantile = Callable[[float], float]
"""v in (0, 1) → the latency [ns] that is exceeded with probability v."""


def latency_stage(model: Latency, link: DirectedLink) -> LatencyStage:
    """The function of a model on one link."""
    if isinstance(model, Constant):
        return lambda _index, _end_ns: model.value
    if isinstance(model, LatencyTrace):
        at = model.steps.at
        return lambda _index, end_ns: at(end_ns)
    assert isinstance(model, Distribution)
    minimum, quantile = model.minimum_ns, _QUANTILES[type(model)](model)
    upper_tail = _upper_tails(model.correlation, link)
    return lambda index, _end_ns: max(minimum, int(quantile(upper_tail(index))))


def _upper_tails(correlation: float, link: DirectedLink) -> Callable[[int], float]:
    """Index → v, uniform in (0, 1)."""
    draws = link.stream("latency")
    if not correlation:
        return lambda index: 1.0 - draws.uniform(index)
    fresh = math.sqrt(1.0 - correlation**2)
    steps = link.steps()
    last: float | None = None

    def correlated(index: int) -> float:
        nonlocal last
        for step in steps(index):
            z = draws.normal(step)
            last = z if last is None else correlation * last + fresh * z
        assert last is not None
        return min(0.5 * math.erfc(last * _ROOT_HALF), _BELOW_ONE)

    return correlated


def _uniform(model: Uniform) -> _Quantile:
    high, span = model.high, model.high - model.low
    return lambda tail: high - span * tail


def _normal(model: Normal) -> _Quantile:
    mean, sd, kept, inverse = model.mean, model.sd, STANDARD_NORMAL.cdf(-model.alpha), STANDARD_NORMAL.inv_cdf
    return lambda tail: mean - sd * inverse(kept * tail)


def _gamma(model: Gamma) -> _Quantile:
    from scipy.special import gammaincc, gammainccinv  # heavy, and most agents draw no gamma latency

    shape, scale, inverse = model.shape, model.scale_ns, gammainccinv
    kept = float(gammaincc(shape, model.minimum_ns / scale))
    return lambda tail: scale * inverse(shape, kept * tail)


def _lognormal(model: LogNormal) -> _Quantile:
    mu, sigma, kept, inverse = model.mu, model.sigma, STANDARD_NORMAL.cdf(-model.alpha), STANDARD_NORMAL.inv_cdf
    return lambda tail: math.exp(mu - sigma * inverse(kept * tail))


def _pareto(model: Pareto) -> _Quantile:
    least, power = model.min, -1.0 / model.shape
    return lambda tail: least * tail**power


_QUANTILES: Mapping[type[Latency], Callable[[Any], _Quantile]] = {
    Uniform: _uniform,
    Normal: _normal,
    Gamma: _gamma,
    LogNormal: _lognormal,
    Pareto: _pareto,
}
