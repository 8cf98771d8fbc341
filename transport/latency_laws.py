"""Random latencies: distributions truncated below at a minimum, sampled by the inverse of their upper tail.

For a distribution with upper tail S(x) = P(X > x), truncated below at m, x = S⁻¹(S(m)·v) with v uniform in (0, 1) has
the truncated distribution: one draw per frame. The default of `min` is the quantile Φ(−3) = 0.135 %, which for a normal
distribution is its mean − 3 sd.

`correlation` ρ: v = Φ(−z) with zₖ = ρzₖ₋₁ + √(1 − ρ²)·Φ⁻¹(uₖ), in the order of the frames (a Gaussian copula over an
AR(1) process, Nelsen 2006, §2.3). The distribution of each latency stays exact; the correlation of latencies k apart is
at most ρᵏ, and near it for distributions that are nearly normal (Gebelein 1941).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist

from ..errors import BadInput
from ..randomness import Stream
from ..units import Nanoseconds
from .stages import LatencyStage, Steps, Surroundings

_STANDARD_NORMAL = NormalDist()
_TRUNCATION_SD = 3
_TRUNCATED = _STANDARD_NORMAL.cdf(-_TRUNCATION_SD)
_BELOW_ONE = math.nextafter(1.0, 0.0)
_ROOT_HALF = math.sqrt(0.5)


def check_latency(name: str, value_ns: int) -> None:
    """Refuse a latency below 0.

    Raises:
        BadInput: it is below 0.
    """
    if value_ns < 0:
        raise BadInput(f"{name} is {value_ns} ns, a latency is at least 0")


def _upper_tails(draws: Stream, correlation: float, steps: Steps) -> Callable[[int], float]:
    """Index → v, uniform in (0, 1)."""
    if not correlation:
        return lambda index: 1.0 - draws.uniform(index)
    fresh = math.sqrt(1.0 - correlation**2)
    last: float | None = None

    def correlated(index: int) -> float:
        nonlocal last
        for step in steps(index):
            z = draws.normal(step)
            last = z if last is None else correlation * last + fresh * z
        assert last is not None
        return min(0.5 * math.erfc(last * _ROOT_HALF), _BELOW_ONE)

    return correlated


class _Law:
    """Base of all distributions: one draw per frame, and the correlation of successive draws."""

    correlation: float

    @property
    @abstractmethod
    def minimum_ns(self) -> int:
        """The smallest latency, at which the distribution is truncated."""

    @property
    @abstractmethod
    def mean_ns(self) -> float:
        """Mean of the truncated distribution."""

    @abstractmethod
    def _quantile(self) -> Callable[[float], float]:
        """Function from v in (0, 1) to the latency [ns] that is exceeded with probability v."""

    def _check(self, spread_ns: int, mean_ns: int) -> None:
        """Refuse a correlation out of bounds or of equal latencies, and a minimum above the mean."""
        if not -1.0 < self.correlation < 1.0:
            raise BadInput(f"correlation is {self.correlation:g}, it must lie between −1 and 1: 0 for none")
        if self.correlation and not spread_ns:
            raise BadInput(
                f"correlation is {self.correlation:g} of latencies that are all equal: spread them, or use 0"
            )
        check_latency("min", self.minimum_ns)
        if self.minimum_ns > mean_ns:
            raise BadInput(f"min is {self.minimum_ns} ns and mean {mean_ns} ns: min is at most the mean")

    @property
    def variance_inflation(self) -> float:
        """Bound (1 + |ρ|) / (1 − |ρ|): latencies k apart have a correlation of at most |ρ|ᵏ."""
        return (1.0 + abs(self.correlation)) / (1.0 - abs(self.correlation))

    def expected_ns(self, _end_ns: int) -> float:
        """Mean of the truncated distribution."""
        return self.mean_ns

    def stage(self, around: Surroundings) -> LatencyStage:
        """One draw per frame."""
        minimum, quantile = self.minimum_ns, self._quantile()
        upper_tail = _upper_tails(around.stream("latency"), self.correlation, around.steps())
        return lambda index, _end_ns: max(minimum, int(quantile(upper_tail(index))))


@dataclass(frozen=True)
class Uniform(_Law):
    """Uniform distribution between two bounds.

    low: the smallest latency.
    high: the largest latency.
    correlation: correlation of successive latencies.
    """

    low: Nanoseconds
    high: Nanoseconds
    correlation: float = 0.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_latency("low", self.low)
        if self.high < self.low:
            raise BadInput(f"high is {self.high} ns and low {self.low} ns: high is at least low")
        self._check(self.high - self.low, self.high)

    @property
    def minimum_ns(self) -> int:
        """The lower bound."""
        return self.low

    @property
    def mean_ns(self) -> float:
        """The mean of the bounds."""
        return (self.low + self.high) / 2

    def _quantile(self) -> Callable[[float], float]:
        high, span = self.high, self.high - self.low
        return lambda tail: high - span * tail


@dataclass(frozen=True)
class Normal(_Law):
    """Normal distribution, truncated below at `min`: by default mean − 3 sd, at least 0.

    mean: mean before truncation.
    sd: standard deviation before truncation.
    min: smallest latency.
    correlation: correlation of successive latencies.
    """

    mean: Nanoseconds
    sd: Nanoseconds
    min: Nanoseconds | None = None
    correlation: float = 0.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_latency("mean", self.mean)
        check_latency("sd", self.sd)
        self._check(self.sd, self.mean)

    @property
    def minimum_ns(self) -> int:
        """The smallest latency, at which the distribution is truncated."""
        return max(0, self.mean - _TRUNCATION_SD * self.sd) if self.min is None else self.min

    @property
    def _alpha(self) -> float:
        return (self.minimum_ns - self.mean) / self.sd if self.sd else -math.inf

    @property
    def mean_ns(self) -> float:
        """Mean after truncation: mean + sd·φ(α) / (1 − Φ(α)), α = (min − mean) / sd."""
        return self.mean + self.sd * _STANDARD_NORMAL.pdf(self._alpha) / _STANDARD_NORMAL.cdf(-self._alpha)

    def _quantile(self) -> Callable[[float], float]:
        mean, sd, kept, inverse = self.mean, self.sd, _STANDARD_NORMAL.cdf(-self._alpha), _STANDARD_NORMAL.inv_cdf
        return lambda tail: mean - sd * inverse(kept * tail)


@dataclass(frozen=True)
class _Positive(_Law):
    """A distribution on positive numbers, given by mean and standard deviation, truncated below at `min`.

    mean: mean before truncation.
    sd: standard deviation before truncation.
    min: smallest latency.
    correlation: correlation of successive latencies.
    """

    mean: Nanoseconds
    sd: Nanoseconds
    min: Nanoseconds | None = None
    correlation: float = 0.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        for name, value_ns in (("mean", self.mean), ("sd", self.sd)):
            if value_ns < 1:
                raise BadInput(f"{name} is {value_ns} ns, it must be above 0: without spread use constant")
        self._check(self.sd, self.mean)


@dataclass(frozen=True)
class Gamma(_Positive):
    """Gamma distribution, truncated below at `min`: by default at its 0.135 % quantile.

    Shape k = mean² / sd², scale θ = sd² / mean.
    """

    @property
    def _shape(self) -> float:
        return (self.mean / self.sd) ** 2

    @property
    def _scale_ns(self) -> float:
        return self.sd * (self.sd / self.mean)

    @cached_property
    def minimum_ns(self) -> int:
        """The smallest latency, at which the distribution is truncated."""
        if self.min is not None:
            return self.min
        from scipy.special import gammaincinv  # heavy, and most agents draw no gamma latency

        return int(self._scale_ns * gammaincinv(self._shape, _TRUNCATED))

    @property
    def mean_ns(self) -> float:
        """Mean after truncation: mean·Q(k + 1, min/θ) / Q(k, min/θ), Q the regularised upper incomplete gamma."""
        from scipy.special import gammaincc

        cut = self.minimum_ns / self._scale_ns
        return float(self.mean * gammaincc(self._shape + 1.0, cut) / gammaincc(self._shape, cut))

    def _quantile(self) -> Callable[[float], float]:
        from scipy.special import gammaincc, gammainccinv

        shape, scale, inverse = self._shape, self._scale_ns, gammainccinv
        kept = float(gammaincc(shape, self.minimum_ns / scale))
        return lambda tail: scale * inverse(shape, kept * tail)


@dataclass(frozen=True)
class LogNormal(_Positive):
    """Log-normal distribution, truncated below at `min`: by default at its 0.135 % quantile.

    ln X ~ N(μ, σ²) with σ² = ln(1 + sd²/mean²), μ = ln mean − σ²/2.
    """

    @property
    def _sigma(self) -> float:
        return math.sqrt(math.log1p((self.sd / self.mean) ** 2))

    @property
    def _mu(self) -> float:
        return math.log(self.mean) - self._sigma**2 / 2

    @cached_property
    def minimum_ns(self) -> int:
        """The smallest latency, at which the distribution is truncated."""
        return int(math.exp(self._mu - _TRUNCATION_SD * self._sigma)) if self.min is None else self.min

    @property
    def _alpha(self) -> float:
        return (math.log(self.minimum_ns) - self._mu) / self._sigma if self.minimum_ns else -math.inf

    @property
    def mean_ns(self) -> float:
        """Mean after truncation: mean·Φ(σ − α) / (1 − Φ(α)), α = (ln min − μ) / σ."""
        cdf = _STANDARD_NORMAL.cdf
        return self.mean * cdf(self._sigma - self._alpha) / cdf(-self._alpha)

    def _quantile(self) -> Callable[[float], float]:
        mu, sigma, kept, inverse = self._mu, self._sigma, _STANDARD_NORMAL.cdf(-self._alpha), _STANDARD_NORMAL.inv_cdf
        return lambda tail: math.exp(mu - sigma * inverse(kept * tail))


@dataclass(frozen=True)
class Pareto(_Law):
    """Pareto distribution: P(X > x) = (min / x)^shape for x ≥ min, a heavy tail, without variance for a shape ≤ 2.

    min: smallest latency.
    shape: exponent of the tail, above 1.
    correlation: correlation of successive latencies.
    """

    min: Nanoseconds
    shape: float
    correlation: float = 0.0

    def __post_init__(self) -> None:
        """Check the bounds: with a shape of 1 or less there is no mean."""
        if self.min < 1:
            raise BadInput(f"min is {self.min} ns, a pareto latency starts above 0")
        if not 1.0 < self.shape < math.inf:
            raise BadInput(f"shape is {self.shape:g}, it must be above 1, or the latency has no mean")
        self._check(self.min, self.min)

    @property
    def minimum_ns(self) -> int:
        """The smallest latency."""
        return self.min

    @property
    def mean_ns(self) -> float:
        """Mean min·shape / (shape − 1)."""
        return self.min * self.shape / (self.shape - 1.0)

    def _quantile(self) -> Callable[[float], float]:
        least, power = self.min, -1.0 / self.shape
        return lambda tail: least * tail**power
