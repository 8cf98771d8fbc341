"""Loss models at work: the state machine of one model on one directed link."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import isnan, nan, prod
from typing import Any, Protocol

from ..errors import RunFailed
from .directed_link import DirectedLink
from .link_models import Loss, LossModel, SentFrame, answer, begun, own_name
from .loss_settings import (
    Bernoulli,
    BitError,
    Distance,
    Frames,
    GilbertElliott,
    GilbertElliottTime,
    LossTrace,
    Markov,
)
from .sojourns import Sojourns

_PROBABILITY = "probability"


class LossStage(Protocol):
    """The state of one loss model on one directed link."""

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        """Whether a transmitted frame is lost; called once for each frame, in order.

        Args:
            index: sequence number on the link, or number of the time slot of the start.
            start_ns: start of the transmission.
            bits: length on the air, including overhead.
        """

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        """Probability that this frame is lost; may be called for any frame at any time.

        Conditional on the positions of the ends and on shadowing, but not on the states of chains.
        """


class _BernoulliStage:
    __slots__ = ("_draws", "_probability")

    def __init__(self, model: Bernoulli, link: DirectedLink) -> None:
        self._probability = model.probability
        self._draws = link.stream("loss")

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        return self._draws.uniform(index) < self._probability

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return self._probability


class _CorrelatedStage:
    __slots__ = ("_draws", "_lost", "_model", "_steps", "_threshold")

    def __init__(self, model: Bernoulli, link: DirectedLink) -> None:
        self._model = model
        self._draws = link.stream("loss")
        self._steps = link.steps()
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


def _bernoulli_stage(model: Bernoulli, link: DirectedLink) -> LossStage:
    return _CorrelatedStage(model, link) if model.correlation else _BernoulliStage(model, link)


class _GilbertElliottStage:
    """A chain that starts in its stationary distribution."""

    __slots__ = ("_bad", "_draws", "_model", "_moves", "_steps")

    def __init__(self, model: GilbertElliott, link: DirectedLink) -> None:
        self._model = model
        self._draws = link.stream("loss")
        self._moves = link.stream("loss-state")
        self._steps = link.steps()
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


class _BitErrorStage:
    __slots__ = ("_bits", "_draws", "_loss", "_model")

    def __init__(self, model: BitError, link: DirectedLink) -> None:
        self._model = model
        self._draws = link.stream("loss")
        self._bits = 0
        self._loss = 0.0

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        if bits != self._bits:
            self._bits, self._loss = bits, self._model.loss_of(bits)
        return self._draws.uniform(index) < self._loss

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return self._model.loss_of(bits)


class _FramesStage:
    """Ascending starts of ranges, and for each the largest end of the ranges up to it."""

    __slots__ = ("_firsts", "_lasts")

    def __init__(self, model: Frames, _link: DirectedLink) -> None:
        self._firsts: list[int] = []
        self._lasts: list[int] = []
        for first, last in model.spans():
            self._firsts.append(first)
            self._lasts.append(max(last, self._lasts[-1]) if self._lasts else last)

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        begun = bisect_right(self._firsts, index)
        return begun > 0 and index <= self._lasts[begun - 1]

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return float(self.lost(index, start_ns, bits))


class _TimeChainStage:
    """A chain that is stationary at time 0."""

    __slots__ = ("_bad_first", "_draws", "_model", "_sojourns")

    def __init__(self, model: GilbertElliottTime, link: DirectedLink) -> None:
        self._model = model
        self._draws = link.stream("loss")
        self._bad_first = link.channel("loss-state").uniform(0) < model.stationary_bad
        means = (model.mean_bad, model.mean_good) if self._bad_first else (model.mean_good, model.mean_bad)
        self._sojourns = Sojourns(link.channel("loss-sojourns"), *means)

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        bad = self._bad_first == (self._sojourns.number(start_ns) % 2 == 0)
        return self._draws.uniform(index) < (self._model.loss_bad if bad else self._model.loss_good)

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return self._model.mean


class _TraceStage:
    __slots__ = ("_draws", "_steps")

    def __init__(self, model: LossTrace, link: DirectedLink) -> None:
        self._steps = model.steps
        self._draws = link.stream("loss")

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        return self._draws.uniform(index) < self._steps.at(start_ns)

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        return self._steps.at(start_ns)


class _DistanceStage:
    __slots__ = ("_distance_m", "_draws", "_model", "_normals", "_sojourns")

    def __init__(self, model: Distance, link: DirectedLink) -> None:
        self._model = model
        self._draws = link.stream("loss")
        self._distance_m = link.distance_m
        self._normals = link.path("shadowing")
        self._sojourns = (
            None if model.decorrelation is None else Sojourns(link.path("shadowing-sojourns"), model.decorrelation)
        )

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        return self._draws.uniform(index) < self.expected(index, start_ns, bits)

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        model = self._model
        shadowing = 0.0
        if model.shadowing:
            number = 0 if self._sojourns is None else self._sojourns.number(start_ns)
            shadowing = model.shadowing * self._normals.normal(number)
        return model.loss_at(self._distance_m(start_ns), shadowing)


class _OwnStage:
    """A model of a user's own, with random streams apart from the one that decides."""

    __slots__ = ("_draws", "_link", "_model", "_name", "_probability")

    def __init__(self, model: LossModel, link: DirectedLink) -> None:
        self._model = model
        self._draws = link.stream("loss")
        self._link = link.within("own")
        self._name = own_name(model, link)
        self._probability = begun(model, self._link, self._name)

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        frame = SentFrame(self._link, index, start_ns, bits)
        return self._draws.uniform(index) < self._checked(self._probability(frame, _PROBABILITY), frame)

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        """The model's long-run mean, else what it says of this frame alone; NaN where it has a state and no mean."""
        if self._model.keeps_state or not isnan(self._model.mean):
            return nan if isnan(self._model.memory.per_frame) else self._model.mean
        frame = SentFrame(self._link, index, start_ns, bits)
        return self._checked(answer(self._model.probability, frame, self._name, _PROBABILITY), frame)

    def _checked(self, found: float, frame: SentFrame) -> float:
        if not 0.0 <= found <= 1.0:
            raise RunFailed(f"{self._name}: the probability of frame {frame.index} is {found:g}, and not from 0 to 1")
        return found


_STAGES: Mapping[type[Loss], Callable[[Any, DirectedLink], LossStage]] = {
    Bernoulli: _bernoulli_stage,
    GilbertElliott: _GilbertElliottStage,
    GilbertElliottTime: _TimeChainStage,
    Markov: lambda model, link: _TimeChainStage(model.chain, link),
    BitError: _BitErrorStage,
    Distance: _DistanceStage,
    LossTrace: _TraceStage,
    Frames: _FramesStage,
}


def loss_stage(model: Loss, link: DirectedLink) -> LossStage:
    """The state machine of a model on one link."""
    return _STAGES.get(type(model), _OwnStage)(model, link)


def loss_stages(models: Sequence[Loss], link: DirectedLink, what: str = "") -> list[LossStage]:
    """The stages of several models on one link, each with separate streams; `what` separates those of corruption."""
    names = [f"{what}{number or ''}" for number in range(len(models))]
    return [loss_stage(model, link.within(name) if name else link) for name, model in zip(names, models, strict=True)]


def expected_loss(stages: Iterable[LossStage], index: int, start_ns: int, bits: int) -> float:
    """Probability that any of several models loses a frame: 1 − Π(1 − pₘ)."""
    return 1.0 - prod(1.0 - stage.expected(index, start_ns, bits) for stage in stages)
