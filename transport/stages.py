"""What the stages of a directed link may know: their random streams, and how far apart the two ends are.

A model of loss or latency is data; its *stage* is the small state machine of one directed link.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..errors import BadInput
from ..randomness import Stream, stream

StreamOf = Callable[[str], Stream]
DistanceOf = Callable[[int], float]


def _nowhere(_time_ns: int) -> float:
    raise BadInput("the ends of this link have no positions, so there is no distance between them")


@dataclass(frozen=True)
class Surroundings:
    """One directed link as its stages see it.

    `stream(purpose)`: a stream of this direction and this life of the source, indexed by the frame's sequence number.
    `channel(purpose)`: a stream of this direction that restarts of the source do not change, for what goes on in time.
    `path(purpose)`: a stream that both directions share, such as shadowing.
    `distance_m(time_ns)`: distance of the two ends in metres at a nominal instant.
    """

    stream: StreamOf
    channel: StreamOf
    path: StreamOf
    distance_m: DistanceOf = _nowhere

    def within(self, name: str) -> Surroundings:
        """The same link with streams of its own, for another stage that uses the same models."""
        return Surroundings(
            lambda purpose: self.stream(f"{name}-{purpose}"),
            lambda purpose: self.channel(f"{name}-{purpose}"),
            lambda purpose: self.path(f"{name}-{purpose}"),
            self.distance_m,
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
