"""Loss models as data: parameters, long-run mean, and covariance of the losses of two frames.

Bernoulli, GilbertElliott, BitError and Frames depend on the sequence number of a frame; GilbertElliottTime, Markov and
LossTrace on the start of its transmission, not on earlier frames or restarts of the sender; Distance on the positions
of the ends. `loss_stages` runs them. If a link has several, each of them may lose a frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import exp, expm1, inf, isfinite, isnan, log1p, log10, tanh
from typing import Annotated

from ..errors import BadInput
from ..kinds import Kinds
from ..units import (
    Bounds,
    DecibelMilliwatts,
    Decibels,
    Duration,
    Metres,
    OneOrMany,
    Period,
    Probability,
    check_fields_above_zero,
)
from .link_models import Loss, LossModel, Memory, check_model_class
from .traces import Steps

SHORTEST_MEAN_NS = 100_000


def check_probability(name: str, value: float) -> None:
    """Refuse a number that is not a probability.

    Raises:
        BadInput: below 0, above 1, or not a number.
    """
    if not 0.0 <= value <= 1.0:
        raise BadInput(f"{name} is {value:g}, a probability lies between 0 and 1")


def check_mean(name: str, mean_ns: int) -> None:
    """Refuse mean sojourns that are practically independent losses, and slow to simulate.

    Raises:
        BadInput: below 100 us.
    """
    if mean_ns < SHORTEST_MEAN_NS:
        raise BadInput(f"{name} is {mean_ns} ns, it must be at least 100 us: what changes faster is bernoulli")


@dataclass(frozen=True)
class Bernoulli(Loss):
    """Every frame is lost with the same probability p, independently or with correlation ρ to the one before.

    P(lost | the one before) = p + ρ(1 − p) after a loss and p − ρp otherwise: the two-state Markov chain with mean p
    and autocorrelation ρᵏ, stationary from the first frame on. Long-run variance p(1−p)(1+ρ)/(1−ρ).

    probability: p.
    correlation: ρ, below 1.
    """

    probability: Probability
    correlation: Annotated[float, Bounds(least=0.0, below=1.0)] = 0.0

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


@dataclass(frozen=True)
class GilbertElliott(Loss):
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


@dataclass(frozen=True)
class BitError(Loss):
    """Each bit is flipped independently; a frame of n bits is lost with probability 1 − (1 − p)ⁿ.

    probability: p.
    """

    probability: Probability

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_probability("bit error probability", self.probability)

    def loss_of(self, bits: int) -> float:
        """Probability that a frame of this many bits is lost."""
        if self.probability == 1.0:
            return float(bits > 0)
        return -expm1(bits * log1p(-self.probability))


@dataclass(frozen=True)
class Frames(Loss):
    """Loss of given frames: sequence numbers of the link from 0, or ranges (first, last).

    Numbers restart at 0 with each incarnation of the sender. On a paired channel they are numbers of slots.

    lost: numbers or ranges, as in [3, [10, 20]].
    """

    lost: tuple[int | tuple[int, int], ...]

    def __post_init__(self) -> None:
        """Check the bounds."""
        if not self.lost:
            raise BadInput("frames names no frame: write for example frames: [3, [10, 20]]")
        for first, last in self.spans():
            if first < 0 or last < first:
                raise BadInput(
                    f"frames from {first} to {last}: sequence numbers are at least 0, and the first comes first"
                )

    def spans(self) -> list[tuple[int, int]]:
        """First and last of each range, in ascending order."""
        return sorted((entry, entry) if isinstance(entry, int) else entry for entry in self.lost)

    @property
    def mean(self) -> float:
        """0: the list is finite."""
        return 0.0


@dataclass(frozen=True)
class GilbertElliottTime(Loss):
    """Burst losses in time: a two-state Markov chain with exponential sojourns, and a loss probability in each state.

    P(bad) = mean_bad / (mean_good + mean_bad); the chain is stationary at time 0.

    mean_good: mean time in the good state.
    mean_bad: mean time in the bad state.
    loss_bad: loss probability in the bad state.
    loss_good: loss probability in the good state.
    """

    mean_good: Period
    mean_bad: Period
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


@dataclass(frozen=True)
class Markov(Loss):
    """The link is alternately up and down, for exponential times, and loses all frames that start while it is down.

    mean_up: mean time up.
    mean_down: mean time down.
    """

    mean_up: Period
    mean_down: Period

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_mean("mean_up", self.mean_up)
        check_mean("mean_down", self.mean_down)

    @property
    def chain(self) -> GilbertElliottTime:
        """The same as a chain that loses all frames in its bad state."""
        return GilbertElliottTime(self.mean_up, self.mean_down)

    @property
    def mean(self) -> float:
        """Long-run loss mean_down / (mean_up + mean_down)."""
        return self.chain.mean

    @property
    def memory(self) -> Memory:
        """Covariance P(up) P(down) · exp(−Δt·(1/mean_up + 1/mean_down))."""
        return self.chain.memory


@dataclass(frozen=True)
class LossTrace(Loss):
    """A loss probability as a function of time: `losses[i]` from `times[i]` on, the last one for ever.

    repeat: period after which the trace is repeated.
    """

    times: tuple[Duration, ...]
    losses: tuple[Probability, ...]
    repeat: Period | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        for loss in self.losses:
            check_probability("loss probability", loss)
        self.steps.check("losses")

    @property
    def steps(self) -> Steps[float]:
        """The loss probability over time."""
        return Steps(self.times, self.losses, self.repeat)

    @property
    def mean(self) -> float:
        """Mean over one period, or the last value without repetition."""
        return self.steps.mean


@dataclass(frozen=True)
class Distance(Loss):
    """Log-distance path loss with log-normal shadowing; the receiver loses half of the frames at its sensitivity.

    received = power − reference_loss − 10·exponent·log₁₀(d / reference_distance) − X,  X ~ N(0, shadowing²)
    P(lost) = 1 / (1 + exp((received − sensitivity) / width))
    Rappaport 2002, §4.9. Below the reference distance the path loss is constant. Both directions of a link have the
    same X. X is constant, or changes to a new random value after exponential times with mean `decorrelation`, so that
    its autocorrelation is exp(−t / decorrelation), the shape that Gudmundson 1991 measured.

    Letters: d distance of the ends at the start of transmission [m], X shadowing [dB].

    exponent: path loss exponent, 2 in free space, more indoors.
    sensitivity: received power at which half of the frames are lost.
    power: power of the transmitter.
    reference_loss: path loss at the reference distance; the default is that of free space over 1 m at 2.4 GHz.
    reference_distance: distance of the reference loss.
    width: width of the receiver's logistic curve; 0 makes it a threshold.
    shadowing: standard deviation of X.
    decorrelation: mean time between changes of X.
    """

    exponent: Annotated[float, Bounds(above=0.0)]
    sensitivity: DecibelMilliwatts
    power: DecibelMilliwatts = 0.0
    reference_loss: Decibels = 40.0
    reference_distance: Annotated[Metres, Bounds(above=0.0)] = 1.0
    width: Annotated[Decibels, Bounds(least=0.0)] = 1.0
    shadowing: Annotated[Decibels, Bounds(least=0.0)] = 0.0
    decorrelation: Period | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(self, "exponent", "reference_distance")
        for name in ("width", "shadowing"):
            if not 0 <= getattr(self, name) < inf:
                raise BadInput(f"{name} is {getattr(self, name):g} dB, it must be at least 0 dB")
        for name in ("sensitivity", "power", "reference_loss"):
            if not isfinite(getattr(self, name)):
                raise BadInput(f"{name} is {getattr(self, name):g}, it must be a finite number")
        if self.decorrelation is not None:
            check_mean("decorrelation", self.decorrelation)
            if not self.shadowing:
                raise BadInput("decorrelation is of shadowing, and there is none: give shadowing a standard deviation")

    def loss_at(self, distance_m: float, shadowing_db: float = 0.0) -> float:
        """Probability that a frame is lost at this distance and shadowing."""
        decades = log10(max(distance_m / self.reference_distance, 1.0))
        received = self.power - self.reference_loss - 10.0 * self.exponent * decades - shadowing_db
        margin = received - self.sensitivity
        if not self.width:
            return float(margin < 0.0)
        return 0.5 * (1.0 - tanh(0.5 * margin / self.width))


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
    entry_points="volery.losses",
    base=LossModel,
    check=check_model_class,
)
Losses = Annotated[tuple[Annotated[Loss, LOSSES], ...], OneOrMany(none="none")]
"""Loss models of a link, any of which may lose a frame."""


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
