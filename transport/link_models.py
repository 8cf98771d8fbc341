"""Base classes of loss and latency models, and of those that users write themselves.

A model is data: a frozen dataclass whose fields are its parameters. What runs it on one link is in `loss_stages` and
`latency_stages`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from inspect import get_annotations
from math import isnan, nan
from numbers import Real
from typing import NamedTuple

import numpy as np

from ..errors import BadInput, RunFailed, VoleryError
from ..overrides import check_overrides
from ..user_code import described
from .directed_link import DirectedLink


class Memory(NamedTuple):
    """Covariance of two losses that are k frames and Δt between starts apart: c·rᵏ·exp(−λ·Δt).

    `covariance` c, `per_frame` r, `rate` λ [1/ns].
    """

    covariance: float = 0.0
    per_frame: float = 1.0
    rate: float = 0.0


@dataclass(frozen=True, slots=True)
class SentFrame:
    """A frame at the start of its transmission on `link`, as models of users' own are told of it.

    `index`: its sequence number on the link, from 0 for each life of the sender; with `paired` the number of the time
    slot. `bits`: its length on the air, overhead included.
    """

    link: DirectedLink
    index: int
    start_ns: int
    bits: int

    @property
    def source(self) -> str:
        """Name of the sender."""
        return self.link.source

    @property
    def target(self) -> str:
        """Name of the receiver."""
        return self.link.target

    @property
    def distance_m(self) -> float:
        """Distance of the two when the transmission starts, in metres.

        Raises:
            BadInput: they have no positions.
        """
        return self.link.distance_m(self.start_ns)

    def uniform(self, purpose: str = "") -> float:
        """A random number of this frame, uniform in (0, 1): always the same one for the same purpose."""
        return self.link.stream(purpose).uniform(self.index)

    def normal(self, purpose: str = "") -> float:
        """As `uniform`, from the standard normal distribution."""
        return self.link.stream(purpose).normal(self.index)


@dataclass(frozen=True)
class Loss:
    """Base of all loss models."""

    @property
    def mean(self) -> float:
        """Long-run fraction of frames lost; NaN if it is not known, or depends on the frames or on positions."""
        return nan

    @property
    def memory(self) -> Memory:
        """Covariance of the losses of two frames, about their expected values; none of separate draws."""
        return Memory()


@dataclass(frozen=True)
class Latency:
    """Base of all latency models."""

    @property
    def minimum_ns(self) -> int:
        """Smallest latency, on which lockstep pace rests."""
        raise BadInput("a latency model has a property minimum_ns, its smallest latency")

    @property
    def mean_ns(self) -> float:
        """Long-run mean of the latency; NaN if it is not known."""
        return nan

    @property
    def variance_inflation(self) -> float:
        """Upper bound of the long-run variance of the mean, relative to that of independent latencies."""
        return 1.0

    def expected_ns(self, _end_ns: int) -> float:
        """Mean latency of frames whose airtime ends at an instant."""
        return self.mean_ns


class OwnModel:
    """What users' own models have in common."""

    def __init_subclass__(cls) -> None:
        """Refuse a field that would take a member of the base classes as its default."""
        super().__init_subclass__()
        members = {name for base in cls.__mro__[1:] if base.__module__ == __name__ for name in vars(base)}
        for name in members & get_annotations(cls).keys() - vars(cls).keys():
            raise TypeError(f"{cls.__name__}.{name} is a member of its base class: give the field another name")

    @property
    def import_string(self) -> str:
        """`module:Class`."""
        return f"{type(self).__module__}:{type(self).__qualname__}"

    def _function(self, frame: SentFrame) -> float:
        """What a subclass says of a frame, from the frame and the parameters alone."""
        raise NotImplementedError

    def begin(self, link: DirectedLink) -> Callable[[SentFrame], float]:
        """The function that is called once for each frame of one link, in order, if earlier frames matter.

        It may keep a state, which begins anew with each life of the sender and when a fault sets another model. Random
        numbers come from the frame, or from `link`: `stream(purpose)` by the frame's index, `channel(purpose)` and
        `path(purpose)` for what does not begin anew, the latter the same in both directions.
        """
        return self._function

    @property
    def keeps_state(self) -> bool:
        """Whether what becomes of a frame may depend on earlier ones."""
        return type(self).begin is not OwnModel.begin

    @property
    def variance_inflation(self) -> float:
        """Long-run variance of the mean, relative to that of independent frames.

        By default 1, and NaN with `begin`: not known, and the verdict on a run does not compare its links.
        """
        return nan if self.keeps_state else 1.0


@dataclass(frozen=True)
class LossModel(OwnModel, Loss):
    """Base of users' own loss models: override `probability`, or `begin` where it depends on earlier frames."""

    def probability(self, frame: SentFrame) -> float:
        """Probability that a frame is lost, from the frame and the parameters alone."""
        raise BadInput("a loss model has a method probability(frame), or begin(link)")

    def _function(self, frame: SentFrame) -> float:
        """That probability."""
        return self.probability(frame)

    @property
    def memory(self) -> Memory:
        """That of losses with the same mean and long-run variance whose correlation is ρᵏ: ρ = (f − 1) / (f + 1)."""
        inflation = self.variance_inflation
        return Memory(self.mean * (1.0 - self.mean), (inflation - 1.0) / (inflation + 1.0))

    def check(self) -> None:
        """Refuse statistics that cannot be.

        Raises:
            BadInput: a mean that is no probability, or an error in a property.
        """
        with naming(own_name(self), BadInput):
            mean, _ = self.mean, self.memory
        if not (isnan(mean) or 0.0 <= mean <= 1.0):
            raise BadInput(f"{own_name(self)}: mean is {mean:g}, a probability lies between 0 and 1")


@dataclass(frozen=True)
class LatencyModel(OwnModel, Latency):
    """Base of users' own latency models: override `minimum_ns`, and `latency_ns`, or `begin` where it has a state."""

    def latency_ns(self, frame: SentFrame) -> float:
        """Latency of a frame from its last bit on, from the frame and the parameters alone."""
        raise BadInput("a latency model has a method latency_ns(frame), or begin(link)")

    def _function(self, frame: SentFrame) -> float:
        """That latency."""
        return self.latency_ns(frame)

    def check(self) -> None:
        """Refuse statistics that cannot be.

        Raises:
            BadInput: no minimum, one that is no whole number from 0 on, or an error in a property.
        """
        with naming(own_name(self), BadInput):
            least, _, _ = self.minimum_ns, self.mean_ns, self.variance_inflation
        if type(least) is not int or least < 0:
            raise BadInput(f"{own_name(self)}: minimum_ns is {least!r}, it is a whole number of nanoseconds from 0 on")


def own_name(model: LossModel | LatencyModel, link: DirectedLink | None = None) -> str:
    """How messages name a model, and the link that it works on."""
    what = "loss" if isinstance(model, LossModel) else "latency"
    place = f" on link {link.source}>{link.target}" if link else ""
    return f"{what} model {model.import_string}{place}"


@contextmanager
def naming(name: str, kind: type[VoleryError] = RunFailed) -> Iterator[None]:
    """Let errors of a user's code name the model."""
    try:
        yield
    except (Exception, SystemExit) as error:
        raise kind(f"{name}: {described(error)}") from error


def begun(model: OwnModel, link: DirectedLink, name: str) -> Callable[[SentFrame, str], float]:
    """The function of a model on one link, which is called with each frame and what it says of it.

    Raises:
        RunFailed: here or at a call, it fails, or returns no number.
    """
    with naming(name):
        function = model.begin(link)
    if not callable(function):
        raise RunFailed(f"{name}: begin returned {function!r}: return the function that is called with each frame")
    return lambda frame, what: answer(function, frame, name, what)


def answer(function: Callable[[SentFrame], float], frame: SentFrame, name: str, what: str) -> float:
    """What a function of a user's says of a frame.

    Raises:
        RunFailed: it fails, or returns no number.
    """
    with naming(name):
        found = function(frame)
    if isinstance(found, bool | np.bool_ | Real):
        return float(found)
    raise RunFailed(f"{name}: the {what} of frame {frame.index} is {found!r}, and no number")


def check_model_class(kind: type[OwnModel], what: str) -> None:
    """Check a class of a user's.

    Raises:
        BadInput: methods that are called with other arguments, or fields that are none.
    """
    for base in (OwnModel, LossModel if issubclass(kind, LossModel) else LatencyModel):
        check_overrides(kind, base, what)
    if get_annotations(kind) and "__dataclass_params__" not in vars(kind):
        raise BadInput(f"{what} has fields and is no dataclass: write @dataclass(frozen=True) above it")
