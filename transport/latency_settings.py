"""Latency models as data: one-way travel time of a frame after its last bit was sent, in whole nanoseconds.

Latency does not limit the number of frames in flight. Every model has a minimum, which lockstep pace needs as
lookahead. Random distributions are truncated below there; the default of `min` is the quantile Φ(−3) = 0.135 %, which
for a normal distribution is its mean − 3 sd. `latency_stages` draws from them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import exp, inf, log, log1p, sqrt
from statistics import NormalDist
from typing import Annotated

from ..errors import BadInput
from ..kinds import Kinds
from ..units import Bounds, Duration, Period
from .link_models import Latency, LatencyModel, check_model_class
from .traces import Steps

Correlation = Annotated[float, Bounds(above=-1.0, below=1.0)]
STANDARD_NORMAL = NormalDist()
_TRUNCATION_SD = 3
_TRUNCATED = STANDARD_NORMAL.cdf(-_TRUNCATION_SD)


def check_latency(name: str, value_ns: int) -> None:
    """Refuse a latency below 0.

    Raises:
        BadInput: it is below 0.
    """
    if value_ns < 0:
        raise BadInput(f"{name} is {value_ns} ns, a latency is at least 0")


@dataclass(frozen=True)
class Constant(Latency):
    """The same latency for every frame.

    value: the latency.
    """

    value: Duration

    def __post_init__(self) -> None:
        """Check the bound."""
        check_latency("latency", self.value)

    @property
    def minimum_ns(self) -> int:
        """The constant latency."""
        return self.value

    @property
    def mean_ns(self) -> float:
        """The constant latency."""
        return float(self.value)


@dataclass(frozen=True)
class LatencyTrace(Latency):
    """A latency as a function of time: `latencies[i]` if the airtime ends at `times[i]` or later, the last for ever.

    repeat: period after which the trace is repeated.
    """

    times: tuple[Duration, ...]
    latencies: tuple[Duration, ...]
    repeat: Period | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        for latency in self.latencies:
            check_latency("latency", latency)
        self.steps.check("latencies")

    @property
    def steps(self) -> Steps[int]:
        """The latency over time."""
        return Steps(self.times, self.latencies, self.repeat)

    @property
    def minimum_ns(self) -> int:
        """The smallest latency."""
        return min(self.latencies)

    @property
    def mean_ns(self) -> float:
        """Mean over one period, or the last value without repetition."""
        return self.steps.mean

    def expected_ns(self, end_ns: int) -> float:
        """The latency at an instant."""
        return float(self.steps.at(end_ns))


class Distribution(Latency):
    """Base of all distributions: one draw per frame, and the correlation of successive draws."""

    correlation: float

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


@dataclass(frozen=True)
class Uniform(Distribution):
    """Uniform distribution between two bounds.

    low: the smallest latency.
    high: the largest latency.
    correlation: correlation of successive latencies.
    """

    low: Duration
    high: Duration
    correlation: Correlation = 0.0

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


@dataclass(frozen=True)
class Normal(Distribution):
    """Normal distribution, truncated below at `min`: by default mean − 3 sd, at least 0.

    mean: mean before truncation.
    sd: standard deviation before truncation.
    min: smallest latency.
    correlation: correlation of successive latencies.
    """

    mean: Duration
    sd: Duration
    min: Duration | None = None
    correlation: Correlation = 0.0

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
    def alpha(self) -> float:
        """α, the place of the truncation in standard deviations from the mean."""
        return (self.minimum_ns - self.mean) / self.sd if self.sd else -inf

    @property
    def mean_ns(self) -> float:
        """Mean after truncation: mean + sd·φ(α) / (1 − Φ(α)), α = (min − mean) / sd."""
        return self.mean + self.sd * STANDARD_NORMAL.pdf(self.alpha) / STANDARD_NORMAL.cdf(-self.alpha)


@dataclass(frozen=True)
class _Positive(Distribution):
    """A distribution on positive numbers, given by mean and standard deviation, truncated below at `min`.

    mean: mean before truncation.
    sd: standard deviation before truncation.
    min: smallest latency.
    correlation: correlation of successive latencies.
    """

    mean: Period
    sd: Period
    min: Duration | None = None
    correlation: Correlation = 0.0

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
    def shape(self) -> float:
        """K."""
        return (self.mean / self.sd) ** 2

    @property
    def scale_ns(self) -> float:
        """θ."""
        return self.sd * (self.sd / self.mean)

    @cached_property
    def minimum_ns(self) -> int:
        """The smallest latency, at which the distribution is truncated."""
        if self.min is not None:
            return self.min
        from scipy.special import gammaincinv  # heavy, and most agents draw no gamma latency

        return int(self.scale_ns * gammaincinv(self.shape, _TRUNCATED))

    @property
    def mean_ns(self) -> float:
        """Mean after truncation: mean·Q(k + 1, min/θ) / Q(k, min/θ), Q the regularised upper incomplete gamma."""
        from scipy.special import gammaincc

        cut = self.minimum_ns / self.scale_ns
        return float(self.mean * gammaincc(self.shape + 1.0, cut) / gammaincc(self.shape, cut))


@dataclass(frozen=True)
class LogNormal(_Positive):
    """Log-normal distribution, truncated below at `min`: by default at its 0.135 % quantile.

    ln X ~ N(μ, σ²) with σ² = ln(1 + sd²/mean²), μ = ln mean − σ²/2.
    """

    @property
    def sigma(self) -> float:
        """σ."""
        return sqrt(log1p((self.sd / self.mean) ** 2))

    @property
    def mu(self) -> float:
        """μ."""
        return log(self.mean) - self.sigma**2 / 2

    @cached_property
    def minimum_ns(self) -> int:
        """The smallest latency, at which the distribution is truncated."""
        return int(exp(self.mu - _TRUNCATION_SD * self.sigma)) if self.min is None else self.min

    @property
    def alpha(self) -> float:
        """α, the place of the truncation in standard deviations from the mean."""
        return (log(self.minimum_ns) - self.mu) / self.sigma if self.minimum_ns else -inf

    @property
    def mean_ns(self) -> float:
        """Mean after truncation: mean·Φ(σ − α) / (1 − Φ(α)), α = (ln min − μ) / σ."""
        cdf = STANDARD_NORMAL.cdf
        return self.mean * cdf(self.sigma - self.alpha) / cdf(-self.alpha)


@dataclass(frozen=True)
class Pareto(Distribution):
    """Pareto distribution: P(X > x) = (min / x)^shape for x ≥ min, a heavy tail, without variance for a shape ≤ 2.

    min: smallest latency.
    shape: exponent of the tail, above 1.
    correlation: correlation of successive latencies.
    """

    min: Period
    shape: Annotated[float, Bounds(above=1.0)]
    correlation: Correlation = 0.0

    def __post_init__(self) -> None:
        """Check the bounds: with a shape of 1 or less there is no mean."""
        if self.min < 1:
            raise BadInput(f"min is {self.min} ns, a pareto latency starts above 0")
        if not 1.0 < self.shape < inf:
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


LATENCIES = Kinds(
    "latency model",
    {
        "constant": Constant,
        "uniform": Uniform,
        "normal": Normal,
        "gamma": Gamma,
        "lognormal": LogNormal,
        "pareto": Pareto,
        "trace": LatencyTrace,
    },
    scalar="constant",
    entry_points="volery.latencies",
    base=LatencyModel,
    check=check_model_class,
)
