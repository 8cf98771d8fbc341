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

from ..errors import RunFailed
from .directed_link import DirectedLink
from .latency_settings import (
    STANDARD_NORMAL,
    Constant,
    Distribution,
    Gamma,
    LatencyTrace,
    LogNormal,
    Normal,
    Pareto,
    Uniform,
)
from .link_models import Latency, LatencyModel, SentFrame, begun, own_name

_BELOW_ONE = math.nextafter(1.0, 0.0)
_ROOT_HALF = math.sqrt(0.5)
LatencyStage = Callable[[int, int, int, int], int]
"""(index, start [ns] and bits as of a loss stage, end of the airtime [ns]) → latency [ns]; called in order."""
_Quantile = Callable[[float], float]
"""v in (0, 1) → the latency [ns] that is exceeded with probability v."""


def latency_stage(model: Latency, link: DirectedLink) -> LatencyStage:
    """The function of a model on one link."""
    if isinstance(model, Constant):
        return lambda _index, _start_ns, _bits, _end_ns: model.value
    if isinstance(model, LatencyTrace):
        at = model.steps.at
        return lambda _index, _start_ns, _bits, end_ns: at(end_ns)
    if isinstance(model, LatencyModel):
        return _own_stage(model, link)
    assert isinstance(model, Distribution)
    minimum, quantile = model.minimum_ns, _QUANTILES[type(model)](model)
    upper_tail = _upper_tails(model.correlation, link)
    return lambda index, _start_ns, _bits, _end_ns: max(minimum, int(quantile(upper_tail(index))))


def _own_stage(model: LatencyModel, link: DirectedLink) -> LatencyStage:
    """A model of a user's own, held to its minimum, on which other agents' promises rest."""
    name, own, minimum = own_name(model, link), link.within("own"), model.minimum_ns
    latency_ns = begun(model, own, name)

    def checked(index: int, start_ns: int, bits: int, _end_ns: int) -> int:
        found = latency_ns(SentFrame(own, index, start_ns, bits), "latency")
        if not minimum <= found < math.inf:
            raise RunFailed(f"{name}: the latency of frame {index} is {found:.15g} ns, and minimum_ns is {minimum} ns")
        return int(found)

    return checked


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
