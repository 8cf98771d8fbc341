"""Interfaces of loss and latency models, and the inputs of their stages: random streams and the distance of the ends.

A model is data; its *stage* is the state machine for one directed link.
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
"""Index of a frame → indices of the draws for the steps of a chain up to this frame."""


def _nowhere(_time_ns: int) -> float:
    raise BadInput("the ends of this link have no positions, so there is no distance between them")


def _frame_by_frame(index: int) -> Iterable[int]:
    return (index,)


class _SlotBySlot:
    """Steps of a chain that steps in every slot from slot 0 on, with or without a frame."""

    def __init__(self) -> None:
        self._next = 0

    def __call__(self, index: int) -> Iterable[int]:
        due = range(self._next, index + 1)
        self._next = max(self._next, index + 1)
        return due


@dataclass(frozen=True)
class Surroundings:
    """Inputs of the stages of one directed link.

    `stream(purpose)`: stream of this direction and this incarnation of the source, indexed by the frame's sequence
    number; with `slots`, of this direction only and indexed by the time slot, see `by_slots`.
    `channel(purpose)`: stream of this direction for all incarnations of the source, for processes in time.
    `path(purpose)`: stream common to both directions, such as for shadowing.
    `distance_m(time_ns)`: distance of the two ends in metres at a nominal instant.
    """

    stream: StreamOf
    channel: StreamOf
    path: StreamOf
    distance_m: DistanceOf = _nowhere
    slots: bool = False

    def steps(self) -> Steps:
        """Steps of a chain: one per frame, or with slots one per slot since the last frame."""
        return _SlotBySlot() if self.slots else _frame_by_frame

    def by_slots(self) -> Surroundings:
        """The same link with draws per time slot, which depend only on the link and the slot.

        They do not depend on earlier frames or on restarts of the source.
        """
        return replace(self, stream=self.channel, slots=True)

    def within(self, name: str) -> Surroundings:
        """The same link with separate streams, for another stage with the same models."""
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
        """The inputs of the link source → target."""
        ends = sorted((source, target))
        return cls(
            lambda purpose: stream(seed, purpose, source, target, str(incarnation)),
            lambda purpose: stream(seed, purpose, source, target),
            lambda purpose: stream(seed, purpose, *ends, "path"),
            distance_m,
        )


class Memory(NamedTuple):
    """Covariance of two losses that are k frames and Δt between starts apart: c·rᵏ·exp(−λ·Δt).

    `covariance` c, `per_frame` r, `rate` λ [1/ns].
    """

    covariance: float = 0.0
    per_frame: float = 1.0
    rate: float = 0.0


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


class Loss(Protocol):
    """A loss model."""

    @property
    def mean(self) -> float:
        """Long-run fraction of frames lost; NaN if it depends on their length or on the positions of the ends."""

    @property
    def memory(self) -> Memory:
        """Covariance of the losses of two frames, about their expected values."""

    def stage(self, around: Surroundings) -> LossStage:
        """Create the state machine for one link."""


LatencyStage = Callable[[int, int], int]
"""(index as of a loss stage, end of the airtime in nanoseconds) → latency in nanoseconds; called in order."""


class Latency(Protocol):
    """A latency model."""

    @property
    def minimum_ns(self) -> int:
        """Smallest latency."""

    @property
    def mean_ns(self) -> float:
        """Long-run mean of the latency."""

    @property
    def variance_inflation(self) -> float:
        """Upper bound of the long-run variance of the mean, relative to that of independent latencies."""

    def expected_ns(self, end_ns: int) -> float:
        """Mean latency of frames whose airtime ends at an instant."""

    def stage(self, around: Surroundings) -> LatencyStage:
        """Create the function that gives the latency of each frame of one link."""
