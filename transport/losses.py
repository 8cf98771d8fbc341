"""Loss models: which transmitted frames the channel swallows.

A model is data; its stage is the small state machine of one directed link. Where several models are given, a frame is
lost if any of them loses it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ..errors import BadInput
from ..randomness import Stream
from .stages import Surroundings


class LossStage(Protocol):
    """The state of one loss model on one directed link."""

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        """Whether a transmitted frame is lost; called once for each, in order.

        Args:
            index: its sequence number on the link.
            start_ns: when its transmission starts.
            bits: its length on the air, overhead included.
        """


class Loss(Protocol):
    """A loss model."""

    @property
    def mean(self) -> float:
        """Long-run fraction of frames lost."""

    def stage(self, around: Surroundings) -> LossStage:
        """The state machine of one link."""


def _probability(name: str, value: float) -> None:
    if not 0.0 <= value <= 1.0:
        raise BadInput(f"{name} is {value:g}, a probability lies between 0 and 1")


@dataclass(frozen=True)
class Bernoulli:
    """Every frame is lost with the same probability, independently."""

    probability: float

    def __post_init__(self) -> None:
        """Check the bounds."""
        _probability("loss probability", self.probability)

    @property
    def mean(self) -> float:
        """The probability itself."""
        return self.probability

    def stage(self, around: Surroundings) -> LossStage:
        """A memoryless stage."""
        return _BernoulliStage(self.probability, around.stream("loss"))


@dataclass(slots=True)
class _BernoulliStage:
    probability: float
    draws: Stream

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        return self.draws.uniform(index) < self.probability


@dataclass(frozen=True)
class GilbertElliott:
    """Bursts: a two-state Markov chain that takes one step per frame, with a loss probability in each state.

    to_bad = P(good → bad), to_good = P(bad → good); stationary P(bad) = to_bad / (to_bad + to_good).
    Gilbert 1960; Elliott 1963. The first frame finds the chain in its stationary law.
    """

    to_bad: float
    to_good: float
    loss_bad: float = 1.0
    loss_good: float = 0.0

    def __post_init__(self) -> None:
        """Check the bounds; a chain that never moves has no stationary law."""
        for name in ("to_bad", "to_good", "loss_bad", "loss_good"):
            _probability(name, getattr(self, name))
        if self.to_bad + self.to_good == 0:
            raise BadInput("to_bad and to_good are both 0: the state would never change, use bernoulli instead")

    @property
    def stationary_bad(self) -> float:
        """Long-run fraction of frames that meet the bad state."""
        return self.to_bad / (self.to_bad + self.to_good)

    @property
    def mean(self) -> float:
        """P(bad)·loss_bad + P(good)·loss_good."""
        return self.stationary_bad * self.loss_bad + (1 - self.stationary_bad) * self.loss_good

    def stage(self, around: Surroundings) -> LossStage:
        """A stage whose chain starts in the stationary law."""
        return _GilbertElliottStage(self, around.stream("loss"), around.stream("loss-state"))


class _GilbertElliottStage:
    __slots__ = ("_bad", "_draws", "_model", "_moves")

    def __init__(self, model: GilbertElliott, draws: Stream, moves: Stream) -> None:
        self._model = model
        self._draws = draws
        self._moves = moves
        self._bad: bool | None = None

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        model = self._model
        move = self._moves.uniform(index)
        if self._bad is None:
            self._bad = move < model.stationary_bad
        elif self._bad:
            self._bad = move >= model.to_good
        else:
            self._bad = move < model.to_bad
        return self._draws.uniform(index) < (model.loss_bad if self._bad else model.loss_good)


LOSSES: dict[str, type[Bernoulli] | type[GilbertElliott]] = {
    "bernoulli": Bernoulli,
    "gilbert-elliott": GilbertElliott,
}
