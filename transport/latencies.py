"""Latency models: how long a frame travels after its last bit has left, one way, in whole nanoseconds.

Latency is a pipe and no queue: it never limits how many frames are in flight. Every model has a minimum, the lookahead
on which lockstep pace rests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from statistics import NormalDist
from typing import Protocol

from ..errors import BadInput
from ..units import Nanoseconds
from .stages import Surroundings

_STANDARD_NORMAL = NormalDist()
_TRUNCATION_SD = 3

LatencyStage = Callable[[int, int], int]
"""(sequence number, end of the airtime in nanoseconds) → latency in nanoseconds; called in order."""


class Latency(Protocol):
    """A latency model."""

    @property
    def minimum_ns(self) -> int:
        """No frame travels faster."""

    @property
    def mean_ns(self) -> float:
        """Mean travel time."""

    def stage(self, around: Surroundings) -> LatencyStage:
        """What gives each frame of one link its latency."""


def _not_negative(name: str, value_ns: int) -> None:
    if value_ns < 0:
        raise BadInput(f"{name} is {value_ns} ns, a latency is at least 0")


@dataclass(frozen=True)
class Constant:
    """Every frame takes the same time."""

    value: Nanoseconds

    def __post_init__(self) -> None:
        """Check the bound."""
        _not_negative("latency", self.value)

    @property
    def minimum_ns(self) -> int:
        """The value."""
        return self.value

    @property
    def mean_ns(self) -> float:
        """The value."""
        return float(self.value)

    def stage(self, _around: Surroundings) -> LatencyStage:
        """The same for every index."""
        return lambda _index, _end_ns: self.value


@dataclass(frozen=True)
class Uniform:
    """Uniform between two bounds."""

    low: Nanoseconds
    high: Nanoseconds

    def __post_init__(self) -> None:
        """Check the bounds."""
        _not_negative("low", self.low)
        if self.high < self.low:
            raise BadInput(f"high is {self.high} ns and low {self.low} ns: high is at least low")

    @property
    def minimum_ns(self) -> int:
        """The lower bound."""
        return self.low

    @property
    def mean_ns(self) -> float:
        """The middle."""
        return (self.low + self.high) / 2

    def stage(self, around: Surroundings) -> LatencyStage:
        """One draw per frame."""
        draws, low, span = around.stream("latency"), self.low, self.high - self.low
        return lambda index, _end_ns: low + int(span * draws.uniform(index))


@dataclass(frozen=True)
class Normal:
    """Normal with a mean and a standard deviation, truncated below at `min`: by default mean − 3 sd, at least 0."""

    mean: Nanoseconds
    sd: Nanoseconds
    min: Nanoseconds | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        _not_negative("mean", self.mean)
        _not_negative("sd", self.sd)
        _not_negative("min", self.minimum_ns)
        if self.minimum_ns > self.mean:
            raise BadInput(f"min is {self.minimum_ns} ns and mean {self.mean} ns: min is at most the mean")

    @property
    def minimum_ns(self) -> int:
        """Where the law is cut off."""
        return max(0, self.mean - _TRUNCATION_SD * self.sd) if self.min is None else self.min

    @property
    def _cut(self) -> float:
        """Probability that the law without truncation gives to what is cut off."""
        return _STANDARD_NORMAL.cdf((self.minimum_ns - self.mean) / self.sd) if self.sd else 0.0

    @property
    def mean_ns(self) -> float:
        """Mean of the truncated law: mean + sd·φ(α) / (1 − Φ(α)), α = (min − mean) / sd."""
        if not self.sd:
            return float(self.mean)
        alpha = (self.minimum_ns - self.mean) / self.sd
        return self.mean + self.sd * _STANDARD_NORMAL.pdf(alpha) / (1 - self._cut)

    def stage(self, around: Surroundings) -> LatencyStage:
        """One draw per frame, by the inverse of the truncated law."""
        if not self.sd:
            return lambda _index, _end_ns: self.mean
        draws, cut, minimum = around.stream("latency"), self._cut, self.minimum_ns
        quantile = NormalDist(self.mean, self.sd).inv_cdf
        return lambda index, _end_ns: max(minimum, int(quantile(cut + (1 - cut) * draws.uniform(index))))


LATENCIES: dict[str, type[Constant] | type[Uniform] | type[Normal]] = {
    "constant": Constant,
    "uniform": Uniform,
    "normal": Normal,
}
