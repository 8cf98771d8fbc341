"""Loss models by name. If a link has several, each of them may lose a frame.

Models per frame are in `frame_losses`, models in time in `time_losses`, the model of distance in `distance_losses`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import exp, isnan, prod
from typing import Annotated

from ..kinds import Kinds
from ..units import OneOrMany
from .distance_losses import Distance
from .frame_losses import Bernoulli, BitError, Frames, GilbertElliott
from .stages import Loss, LossStage, Memory, Surroundings
from .time_losses import GilbertElliottTime, LossTrace, Markov

__all__ = [
    "LOSSES",
    "Bernoulli",
    "BitError",
    "Distance",
    "Frames",
    "GilbertElliott",
    "GilbertElliottTime",
    "Loss",
    "LossStage",
    "LossTrace",
    "Losses",
    "Markov",
    "Memory",
    "expected_loss",
    "loss_stages",
    "loss_variance",
]

LOSSES = Kinds(
    "loss model",
    {
        "bernoulli": Bernoulli,
        "gilbert-elliott": GilbertElliott,
        "gilbert-elliott-time": GilbertElliottTime,
        "markov": Markov,
        "bit-error": BitError,
        "distance": Distance,
        "trace": LossTrace,
        "frames": Frames,
    },
    scalar="bernoulli",
)
Losses = Annotated[tuple[Annotated[Loss, LOSSES], ...], OneOrMany(none="none")]
"""Loss models of a link, any of which may lose a frame."""


def loss_stages(models: Sequence[Loss], around: Surroundings, what: str = "") -> list[LossStage]:
    """The stages of several models on one link, each with separate streams; `what` separates those of corruption."""
    names = [f"{what}{number or ''}" for number in range(len(models))]
    return [model.stage(around.within(name) if name else around) for name, model in zip(names, models, strict=True)]


def expected_loss(stages: Iterable[LossStage], index: int, start_ns: int, bits: int) -> float:
    """Probability that any of several models loses a frame: 1 − Π(1 − pₘ)."""
    return 1.0 - prod(1.0 - stage.expected(index, start_ns, bits) for stage in stages)


def loss_variance(models: Iterable[Loss], frames: Sequence[tuple[int, int]], expected: Iterable[float]) -> float:
    """Variance of the number of frames lost by several models, about the sum of the expected losses.

    Σ pᵢ(1 − pᵢ) + 2 Σᵢ﹤ⱼ cov(i, j). A frame must survive all models, so cov(i, j) = Π(qₘ² + cₘ(i, j)) − Πqₘ², with qₘ
    the long-run fraction that survives model m and cₘ its memory. Models without a long-run fraction are left out of
    the covariances, which can only make them larger.

    Args:
        models: the loss models of a link.
        frames: sequence number and start [ns] of each, ascending.
        expected: loss probabilities of the frames, from `expected_loss`.
    Returns:
        The variance; divided by Σ pᵢ(1 − pᵢ) it is the inflation by bursts.
    """
    terms = [Memory(1.0)]
    for model in models:
        if isnan(model.mean):
            continue
        survival, own = (1.0 - model.mean) ** 2, model.memory
        kept = [term._replace(covariance=term.covariance * survival) for term in terms]
        joined = [_product(term, own) for term in terms] if own.covariance else []
        terms = kept + joined
    independent = sum(loss * (1.0 - loss) for loss in expected)
    return max(0.0, independent + sum(2.0 * _pairs(term, frames) for term in terms[1:]))


def _product(first: Memory, second: Memory) -> Memory:
    return Memory(first.covariance * second.covariance, first.per_frame * second.per_frame, first.rate + second.rate)


def _pairs(memory: Memory, frames: Sequence[tuple[int, int]]) -> float:
    """Sum of the covariances of all pairs, in one pass: a running sum over all earlier frames that decays."""
    total = shared = 0.0
    for (number, start), (next_number, next_start) in pairwise(frames):
        decay = memory.per_frame ** (next_number - number) * exp(memory.rate * (start - next_start))
        shared = decay * (1.0 + shared)
        total += shared
    return memory.covariance * total
