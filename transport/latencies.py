"""Latency models by name: how long a frame travels after its last bit has left, one way, in whole nanoseconds.

Latency is a pipe and no queue: it never limits how many frames are in flight. Every model has a minimum, the lookahead
on which lockstep pace rests. Random ones are in `latency_laws`.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..kinds import Kinds
from ..units import Nanoseconds
from .latency_laws import Gamma, LogNormal, Normal, Pareto, Uniform, check_latency
from .stages import Latency, LatencyStage, Surroundings
from .traces import Steps

__all__ = [
    "LATENCIES",
    "Constant",
    "Gamma",
    "Latency",
    "LatencyStage",
    "LatencyTrace",
    "LogNormal",
    "Normal",
    "Pareto",
    "Uniform",
]


@dataclass(frozen=True)
class Constant:
    """Every frame takes the same time.

    value: the latency.
    """

    value: Nanoseconds

    def __post_init__(self) -> None:
        """Check the bound."""
        check_latency("latency", self.value)

    @property
    def minimum_ns(self) -> int:
        """The value."""
        return self.value

    @property
    def mean_ns(self) -> float:
        """The value."""
        return float(self.value)

    @property
    def variance_inflation(self) -> float:
        """1: there is no variance."""
        return 1.0

    def expected_ns(self, _end_ns: int) -> float:
        """The value."""
        return float(self.value)

    def stage(self, _around: Surroundings) -> LatencyStage:
        """The same for every index."""
        return lambda _index, _end_ns: self.value


@dataclass(frozen=True)
class LatencyTrace:
    """A latency that is given over time: `latencies[i]` for airtimes that end from `times[i]` on, the last for ever.

    With `repeat` the trace starts anew after so long.
    """

    times: tuple[Nanoseconds, ...]
    latencies: tuple[Nanoseconds, ...]
    repeat: Nanoseconds | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        for latency in self.latencies:
            check_latency("latency", latency)
        self._steps.check("latencies")

    @property
    def _steps(self) -> Steps[int]:
        return Steps(self.times, self.latencies, self.repeat)

    @property
    def minimum_ns(self) -> int:
        """The smallest value."""
        return min(self.latencies)

    @property
    def mean_ns(self) -> float:
        """Mean over one repetition, else the last value."""
        return self._steps.mean

    @property
    def variance_inflation(self) -> float:
        """1: nothing is left to chance."""
        return 1.0

    def expected_ns(self, end_ns: int) -> float:
        """The value at an instant."""
        return float(self._steps.at(end_ns))

    def stage(self, _around: Surroundings) -> LatencyStage:
        """A stage without draws."""
        at = self._steps.at
        return lambda _index, end_ns: at(end_ns)


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
)
