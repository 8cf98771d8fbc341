"""Loss models per frame: the loss depends on the frame's sequence number, not on time."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Annotated

from ..errors import BadInput
from ..randomness import Stream
from ..units import Bounds, Probability
from .probabilities import check_probability
from .stages import LossStage, Memory, Steps, Surroundings


@dataclass(frozen=True)
class Bernoulli:
    """Every frame is lost with the same probability p, independently or with correlation ρ to the one before.

    P(lost | the one before) = p + ρ(1 − p) after a loss and p − ρp otherwise: the two-state Markov chain with mean p
    and autocorrelation ρᵏ, stationary from the first frame on. Long-run variance p(1−p)(1+ρ)/(1−ρ).

    probability: p.
    correlation: ρ, below 1.
    """

    probability: Probability
    correlation: Annotated[float, Bounds(least=0.0)] = 0.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_probability("loss probability", self.probability)
        if not 0.0 <= self.correlation < 1.0:
            raise BadInput(f"correlation is {self.correlation:g}, it must be at least 0 and below 1: 0 for none")

    @property
    def mean(self) -> float:
        """The probability p."""
        return self.probability

    @property
    def memory(self) -> Memory:
        """Covariance p(1 − p)ρᵏ."""
        return Memory(self.probability * (1.0 - self.probability), self.correlation)

    def stage(self, around: Surroundings) -> LossStage:
        """One draw per frame."""
        draws = around.stream("loss")
        if not self.correlation:
            return _BernoulliStage(self.probability, draws)
        return _CorrelatedStage(self, draws, around.steps())


@dataclass(slots=True)
class _BernoulliStage:
    probability: float
    draws: Stream

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        return self.draws.uniform(index) < self.probability

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return self.probability


class _CorrelatedStage:
    __slots__ = ("_draws", "_lost", "_model", "_steps", "_threshold")

    def __init__(self, model: Bernoulli, draws: Stream, steps: Steps) -> None:
        self._model = model
        self._draws = draws
        self._steps = steps
        self._threshold = model.probability
        self._lost = False

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        model = self._model
        for step in self._steps(index):
            self._lost = self._draws.uniform(step) < self._threshold
            self._threshold = model.probability + model.correlation * (self._lost - model.probability)
        return self._lost

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return self._model.probability


@dataclass(frozen=True)
class GilbertElliott:
    """Burst losses: a two-state Markov chain with one step per frame, and a loss probability in each state.

    to_bad = P(good → bad), to_good = P(bad → good); stationary P(bad) = to_bad / (to_bad + to_good).
    Gilbert 1960; Elliott 1963. The chain is stationary from the first frame on.

    to_bad: probability that a good frame is followed by a bad one.
    to_good: probability that a bad frame is followed by a good one.
    loss_bad: loss probability in the bad state.
    loss_good: loss probability in the good state.
    """

    to_bad: Probability
    to_good: Probability
    loss_bad: Probability = 1.0
    loss_good: Probability = 0.0

    def __post_init__(self) -> None:
        """Check the bounds, and that no state lasts for ever."""
        for name in ("to_bad", "to_good", "loss_bad", "loss_good"):
            check_probability(name, getattr(self, name))
        for name, state, loss in (("to_bad", "good", self.loss_good), ("to_good", "bad", self.loss_bad)):
            if not getattr(self, name):
                raise BadInput(
                    f"{name} is 0, the {state} state would never end: let {name} be above 0, or use bernoulli: {loss:g}"
                )

    @property
    def stationary_bad(self) -> float:
        """Long-run fraction of frames in the bad state."""
        return self.to_bad / (self.to_bad + self.to_good)

    @property
    def mean(self) -> float:
        """P(bad)·loss_bad + P(good)·loss_good."""
        return self.stationary_bad * self.loss_bad + (1 - self.stationary_bad) * self.loss_good

    @property
    def memory(self) -> Memory:
        """Covariance (loss_bad − loss_good)² P(bad) P(good) · (1 − to_bad − to_good)ᵏ."""
        bad = self.stationary_bad
        return Memory((self.loss_bad - self.loss_good) ** 2 * bad * (1 - bad), 1 - self.to_bad - self.to_good)

    def stage(self, around: Surroundings) -> LossStage:
        """A stage whose chain starts in its stationary distribution."""
        return _GilbertElliottStage(self, around.stream("loss"), around.stream("loss-state"), around.steps())


class _GilbertElliottStage:
    __slots__ = ("_bad", "_draws", "_model", "_moves", "_steps")

    def __init__(self, model: GilbertElliott, draws: Stream, moves: Stream, steps: Steps) -> None:
        self._model = model
        self._draws = draws
        self._moves = moves
        self._steps = steps
        self._bad: bool | None = None

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        model = self._model
        for step in self._steps(index):
            move = self._moves.uniform(step)
            if self._bad is None:
                self._bad = move < model.stationary_bad
            elif self._bad:
                self._bad = move >= model.to_good
            else:
                self._bad = move < model.to_bad
        chance = model.loss_bad if self._bad else model.loss_good
        return chance == 1.0 or (chance > 0.0 and self._draws.uniform(index) < chance)

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return self._model.mean


@dataclass(frozen=True)
class BitError:
    """Each bit is flipped independently; a frame of n bits is lost with probability 1 − (1 − p)ⁿ.

    probability: p.
    """

    probability: Probability

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_probability("bit error probability", self.probability)

    @property
    def mean(self) -> float:
        """NaN: the long-run loss depends on the length of the frames."""
        return math.nan

    @property
    def memory(self) -> Memory:
        """None."""
        return Memory()

    def loss_of(self, bits: int) -> float:
        """Probability that a frame of this many bits is lost."""
        if self.probability == 1.0:
            return float(bits > 0)
        return -math.expm1(bits * math.log1p(-self.probability))

    def stage(self, around: Surroundings) -> LossStage:
        """A memoryless stage."""
        return _BitErrorStage(self, around.stream("loss"))


class _BitErrorStage:
    __slots__ = ("_bits", "_draws", "_loss", "_model")

    def __init__(self, model: BitError, draws: Stream) -> None:
        self._model = model
        self._draws = draws
        self._bits = 0
        self._loss = 0.0

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        if bits != self._bits:
            self._bits, self._loss = bits, self._model.loss_of(bits)
        return self._draws.uniform(index) < self._loss

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return self._model.loss_of(bits)


@dataclass(frozen=True)
class Frames:
    """Loss of given frames: sequence numbers of the link from 0, or ranges (first, last).

    Numbers restart at 0 with each incarnation of the sender. On a paired channel they are numbers of slots.

    lost: numbers or ranges, as in [3, [10, 20]].
    """

    lost: tuple[int | tuple[int, int], ...]

    def __post_init__(self) -> None:
        """Check the bounds."""
        if not self.lost:
            raise BadInput("frames names no frame: write for example frames: [3, [10, 20]]")
        for first, last in self._spans():
            if first < 0 or last < first:
                raise BadInput(
                    f"frames from {first} to {last}: sequence numbers are at least 0, and the first comes first"
                )

    def _spans(self) -> list[tuple[int, int]]:
        return sorted((entry, entry) if isinstance(entry, int) else entry for entry in self.lost)

    @property
    def mean(self) -> float:
        """0: the list is finite."""
        return 0.0

    @property
    def memory(self) -> Memory:
        """No covariance: the losses are not random."""
        return Memory()

    def stage(self, _around: Surroundings) -> LossStage:
        """A stage without draws."""
        firsts: list[int] = []
        lasts: list[int] = []
        for first, last in self._spans():
            firsts.append(first)
            lasts.append(max(last, lasts[-1]) if lasts else last)
        return _FramesStage(firsts, lasts)


@dataclass(slots=True)
class _FramesStage:
    """Ascending starts of ranges, and for each the largest end of the ranges up to it."""

    firsts: list[int]
    lasts: list[int]

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        begun = bisect_right(self.firsts, index)
        return begun > 0 and index <= self.lasts[begun - 1]

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return float(self.lost(index, start_ns, bits))
