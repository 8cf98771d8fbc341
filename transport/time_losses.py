"""Loss models in nominal time: the state of the channel depends on the start of a frame's transmission.

It does not depend on earlier frames or on restarts of the sender.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..randomness import Stream
from ..units import Nanoseconds, Probability
from .probabilities import check_probability
from .sojourns import Sojourns, check_mean
from .stages import LossStage, Memory, Surroundings
from .traces import Steps


@dataclass(frozen=True)
class GilbertElliottTime:
    """Burst losses in time: a two-state Markov chain with exponential sojourns, and a loss probability in each state.

    P(bad) = mean_bad / (mean_good + mean_bad); the chain is stationary at time 0.

    mean_good: mean time in the good state.
    mean_bad: mean time in the bad state.
    loss_bad: loss probability in the bad state.
    loss_good: loss probability in the good state.
    """

    mean_good: Nanoseconds
    mean_bad: Nanoseconds
    loss_bad: Probability = 1.0
    loss_good: Probability = 0.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_mean("mean_good", self.mean_good)
        check_mean("mean_bad", self.mean_bad)
        check_probability("loss_bad", self.loss_bad)
        check_probability("loss_good", self.loss_good)

    @property
    def stationary_bad(self) -> float:
        """Long-run fraction of time in the bad state."""
        return self.mean_bad / (self.mean_good + self.mean_bad)

    @property
    def mean(self) -> float:
        """P(bad)·loss_bad + P(good)·loss_good."""
        return self.stationary_bad * self.loss_bad + (1 - self.stationary_bad) * self.loss_good

    @property
    def memory(self) -> Memory:
        """Covariance (loss_bad − loss_good)² P(bad) P(good) · exp(−Δt·(1/mean_good + 1/mean_bad))."""
        bad = self.stationary_bad
        covariance = (self.loss_bad - self.loss_good) ** 2 * bad * (1 - bad)
        return Memory(covariance, rate=1 / self.mean_good + 1 / self.mean_bad)

    def stage(self, around: Surroundings) -> LossStage:
        """A stage whose chain is stationary at time 0."""
        return _ChainStage(self, around)


class _ChainStage:
    __slots__ = ("_bad_first", "_draws", "_model", "_sojourns")

    def __init__(self, model: GilbertElliottTime, around: Surroundings) -> None:
        self._model = model
        self._draws = around.stream("loss")
        self._bad_first = around.channel("loss-state").uniform(0) < model.stationary_bad
        means = (model.mean_bad, model.mean_good) if self._bad_first else (model.mean_good, model.mean_bad)
        self._sojourns = Sojourns(around.channel("loss-sojourns"), *means)

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        bad = self._bad_first == (self._sojourns.number(start_ns) % 2 == 0)
        return self._draws.uniform(index) < (self._model.loss_bad if bad else self._model.loss_good)

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return self._model.mean


@dataclass(frozen=True)
class Markov:
    """The link is alternately up and down, for exponential times, and loses all frames that start while it is down.

    mean_up: mean time up.
    mean_down: mean time down.
    """

    mean_up: Nanoseconds
    mean_down: Nanoseconds

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_mean("mean_up", self.mean_up)
        check_mean("mean_down", self.mean_down)

    @property
    def _chain(self) -> GilbertElliottTime:
        return GilbertElliottTime(self.mean_up, self.mean_down)

    @property
    def mean(self) -> float:
        """Long-run loss mean_down / (mean_up + mean_down)."""
        return self._chain.mean

    @property
    def memory(self) -> Memory:
        """Covariance P(up) P(down) · exp(−Δt·(1/mean_up + 1/mean_down))."""
        return self._chain.memory

    def stage(self, around: Surroundings) -> LossStage:
        """A stage whose chain is stationary at time 0."""
        return self._chain.stage(around)


@dataclass(frozen=True)
class LossTrace:
    """A loss probability as a function of time: `losses[i]` from `times[i]` on, the last one for ever.

    repeat: period after which the trace is repeated.
    """

    times: tuple[Nanoseconds, ...]
    losses: tuple[float, ...]
    repeat: Nanoseconds | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        for loss in self.losses:
            check_probability("loss probability", loss)
        self._steps.check("losses")

    @property
    def _steps(self) -> Steps[float]:
        return Steps(self.times, self.losses, self.repeat)

    @property
    def mean(self) -> float:
        """Mean over one period, or the last value without repetition."""
        return self._steps.mean

    @property
    def memory(self) -> Memory:
        """No covariance: each frame has a separate draw."""
        return Memory()

    def stage(self, around: Surroundings) -> LossStage:
        """A memoryless stage."""
        return _TraceStage(self._steps, around.stream("loss"))


@dataclass(slots=True)
class _TraceStage:
    steps: Steps[float]
    draws: Stream

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        return self.draws.uniform(index) < self.steps.at(start_ns)

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return self.steps.at(start_ns)
