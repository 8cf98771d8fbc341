"""Latency models by name: one-way travel time of a frame after its last bit was sent, in whole nanoseconds.

Latency does not limit the number of frames in flight. Every model has a minimum, which lockstep pace needs as
lookahead. Random models are in `latency_laws`.
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
    """The same latency for every frame.

    value: the latency.
    """

    value: Nanoseconds

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

    @property
    def variance_inflation(self) -> float:
        """1, as there is no variance."""
        return 1.0

    def expected_ns(self, _end_ns: int) -> float:
        """The constant latency."""
        return float(self.value)

    def stage(self, _around: Surroundings) -> LatencyStage:
        """A stage with the same latency for every frame."""
        return lambda _index, _end_ns: self.value


@dataclass(frozen=True)
class LatencyTrace:
    """A latency as a function of time: `latencies[i]` if the airtime ends at `times[i]` or later, the last for ever.

    repeat: period after which the trace is repeated.
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
        """The smallest latency."""
        return min(self.latencies)

    @property
    def mean_ns(self) -> float:
        """Mean over one period, or the last value without repetition."""
        return self._steps.mean

    @property
    def variance_inflation(self) -> float:
        """1, as nothing is random."""
        return 1.0

    def expected_ns(self, end_ns: int) -> float:
        """The latency at an instant."""
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
