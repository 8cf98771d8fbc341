"""What the stages of one directed link work with: random streams, indices of draws, and the distance of the ends."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

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
class DirectedLink:
    """Inputs of the stages of the link from `source` to `target`.

    `stream(purpose)`: stream of this direction and this incarnation of the source, indexed by the frame's sequence
    number; with `slots`, of this direction only and indexed by the time slot, see `by_slots`.
    `channel(purpose)`: stream of this direction for all incarnations of the source, for processes in time.
    `path(purpose)`: stream common to both directions, such as for shadowing.
    `distance_m(time_ns)`: distance of the two ends in metres at a nominal instant.
    """

    source: str
    target: str
    stream: StreamOf
    channel: StreamOf
    path: StreamOf
    distance_m: DistanceOf = _nowhere
    slots: bool = False

    def steps(self) -> Steps:
        """Steps of a chain: one per frame, or with slots one per slot since the last frame."""
        return _SlotBySlot() if self.slots else _frame_by_frame

    def by_slots(self) -> DirectedLink:
        """The same link with draws per time slot, which depend only on the link and the slot.

        They do not depend on earlier frames or on restarts of the source.
        """
        return replace(self, stream=self.channel, slots=True)

    def within(self, name: str) -> DirectedLink:
        """The same link with separate streams, for another stage with the same models."""
        return replace(
            self,
            stream=lambda purpose: self.stream(f"{name}-{purpose}"),
            channel=lambda purpose: self.channel(f"{name}-{purpose}"),
            path=lambda purpose: self.path(f"{name}-{purpose}"),
        )

    @classmethod
    def of(
        cls, seed: int, source: str, target: str, incarnation: int = 0, distance_m: DistanceOf = _nowhere
    ) -> DirectedLink:
        """The inputs of the link source → target."""
        ends = sorted((source, target))
        return cls(
            source,
            target,
            lambda purpose: stream(seed, purpose, source, target, str(incarnation)),
            lambda purpose: stream(seed, purpose, source, target),
            lambda purpose: stream(seed, purpose, *ends, "path"),
            distance_m,
        )
