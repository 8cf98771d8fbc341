"""What models of loss and latency are, and what their stages may know: random streams, and how far apart the ends are.

A model is data; its *stage* is the small state machine of one directed link.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

from ..errors import BadInput
from ..randomness import Stream, stream

StreamOf = Callable[[str], Stream]
DistanceOf = Callable[[int], float]
Steps = Callable[[int], Iterable[int]]
"""Index of a frame → the draws with which a chain steps on to that frame."""


def _nowhere(_time_ns: int) -> float:
    raise BadInput("the ends of this link have no positions, so there is no distance between them")


def _frame_by_frame(index: int) -> Iterable[int]:
    return (index,)


class _SlotBySlot:
    """Steps of a chain that moves in every slot from slot 0 on, whether a frame is sent in it or not."""

    def __init__(self) -> None:
        self._next = 0

    def __call__(self, index: int) -> Iterable[int]:
        due = range(self._next, index + 1)
        self._next = max(self._next, index + 1)
        return due


@dataclass(frozen=True)
class Surroundings:
    """One directed link as its stages see it.

    `stream(purpose)`: a stream of this direction and this life of the source, indexed by the frame's sequence number;
    with `slots`, of this direction alone and indexed by the slot of time, see `by_slots`.
    `channel(purpose)`: a stream of this direction that restarts of the source do not change, for what goes on in time.
    `path(purpose)`: a stream that both directions share, such as shadowing.
    `distance_m(time_ns)`: distance of the two ends in metres at a nominal instant.
    """

    stream: StreamOf
    channel: StreamOf
    path: StreamOf
    distance_m: DistanceOf = _nowhere
    slots: bool = False

    def steps(self) -> Steps:
        """How a chain steps on: with each frame, or with slots through all that have passed since the last frame."""
        return _SlotBySlot() if self.slots else _frame_by_frame

    def by_slots(self) -> Surroundings:
        """The same link with draws that belong to slots of time: a function of the link and the slot and nothing else.

        How many frames were sent before makes no difference, and neither does a restart of the source.
        """
        return replace(self, stream=self.channel, slots=True)

    def within(self, name: str) -> Surroundings:
        """The same link with streams of its own, for another stage that uses the same models."""
        return Surroundings(
            lambda purpose: self.stream(f"{name}-{purpose}"),
            lambda purpose: self.channel(f"{name}-{purpose}"),
            lambda purpose: self.path(f"{name}-{purpose}"),
            self.distance_m,
            self.slots,
        )

    @classmethod
    def of(
        cls, seed: int, source: str, target: str, incarnation: int = 0, distance_m: DistanceOf = _nowhere
    ) -> Surroundings:
        """Those of the link source → target."""
        ends = sorted((source, target))
        return cls(
            lambda purpose: stream(seed, purpose, source, target, str(incarnation)),
            lambda purpose: stream(seed, purpose, source, target),
            lambda purpose: stream(seed, purpose, *ends, "path"),
            distance_m,
        )


class Memory(NamedTuple):
    """How losses hang together: covariance c·rᵏ·exp(−λ·Δt) of two that are k frames and Δt between starts apart.

    `covariance` c, `per_frame` r, `rate` λ [1/ns].
    """

    covariance: float = 0.0
    per_frame: float = 1.0
    rate: float = 0.0


class LossStage(Protocol):
    """The state of one loss model on one directed link."""

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        """Whether a transmitted frame is lost; called once for each, in order.

        Args:
            index: its sequence number on the link, or the slot of time that it starts in.
            start_ns: when its transmission starts.
            bits: its length on the air, overhead included.
        """

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        """Probability that this frame is lost; may be asked for any frame at any time.

        Where the ends are and what shadows their path is given; the states of chains, and what they bring, are not.
        """


class Loss(Protocol):
    """A loss model."""

    @property
    def mean(self) -> float:
        """Long-run fraction of frames lost; NaN where it depends on their length or on where the ends are."""

    @property
    def memory(self) -> Memory:
        """Covariance of the losses of two frames, about their expected values."""

    def stage(self, around: Surroundings) -> LossStage:
        """The state machine of one link."""


LatencyStage = Callable[[int, int], int]
"""(index as of a loss stage, end of the airtime in nanoseconds) → latency in nanoseconds; called in order."""


class Latency(Protocol):
    """A latency model."""

    @property
    def minimum_ns(self) -> int:
        """No frame travels faster."""

    @property
    def mean_ns(self) -> float:
        """Long-run mean of the travel time."""

    @property
    def variance_inflation(self) -> float:
        """Upper bound of the long-run variance of the mean over many frames, relative to that of independent ones."""

    def expected_ns(self, end_ns: int) -> float:
        """Mean travel time of frames whose airtime ends at an instant."""

    def stage(self, around: Surroundings) -> LatencyStage:
        """What gives each frame of one link its latency."""
