"""Conservative synchronisation: how far an agent may go without hearing more.

Chandy and Misra 1979; Bryant 1977. Each neighbour promises the earliest instant at which its next transmission can
start. What starts then is due no sooner than airtime and shortest latency later, so everything before the least of
these instants may be handled. Every frame and promise carries the number of frames sent, so that a frame which the
middleware lost is noticed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..errors import RunFailed
from .events import FOREVER_NS
from .faults import LinkFault, LinkName, effective
from .frames import Message
from .links import SHORTEST_TRAVEL_NS, LinkSettings

Segment = tuple[int, int, int]
"""From, until, and the lookahead of a link meanwhile, in nanoseconds."""


class FrameMissing(RunFailed):
    """The middleware lost a frame: the run cannot be exact any more."""


def lookahead_segments(base: LinkSettings, link: LinkName, faults: Iterable[LinkFault]) -> tuple[Segment, ...]:
    """The lookahead of a link over time, faults included."""
    touching = [fault for fault in faults if link in fault.links]
    ends = (end for fault in touching for end in (fault.at_ns, fault.until_ns) if end is not None)
    starts = sorted({0, *ends})
    return tuple(
        (start, end, max(SHORTEST_TRAVEL_NS, effective(base, link, touching, start).lookahead_ns()))
        for start, end in zip(starts, [*starts[1:], 2 * FOREVER_NS], strict=True)
    )


def earliest_due(promise_ns: int, segments: tuple[Segment, ...]) -> int:
    """When a frame that starts at `promise_ns` or later can be due at the earliest."""
    return min(max(promise_ns, start) + ahead for start, end, ahead in segments if end > promise_ns)


class Horizon:
    """What the neighbours of one agent have promised."""

    def __init__(self, name: str, segments: Mapping[str, tuple[Segment, ...]]) -> None:
        self._name = name
        self._segments = dict(segments)
        self._promises = dict.fromkeys(segments, 0)
        self._received = dict.fromkeys(segments, 0)

    def heard(self, source: str, frame: Message) -> None:
        """Take note of a frame or promise.

        Raises:
            FrameMissing: the sender has put more frames than have come.
        """
        if frame.sequence >= 0:
            self._received[source] += 1
        if self._received[source] != frame.sent:
            raise FrameMissing(
                f"agent {self._name}: {source} has sent {frame.sent} frames, {self._received[source]} have come"
            )
        if frame.promise_ns is not None:
            self._promises[source] = max(self._promises[source], frame.promise_ns)

    def relink(self, source: str, segments: tuple[Segment, ...]) -> None:
        """A live fault changes the lookahead of a link from an instant that nobody has passed."""
        self._segments[source] = segments

    def safe_ns(self) -> int:
        """Every frame due before this instant is here."""
        return min(
            (earliest_due(promise, self._segments[source]) for source, promise in self._promises.items()),
            default=FOREVER_NS,
        )

    def silent_before(self, time_ns: int, sources: Iterable[str]) -> set[str]:
        """Those of the sources that may still start something before an instant."""
        return {source for source in sources if self._promises[source] < time_ns}

    def blocking(self) -> set[str]:
        """The neighbours that must be heard, every one of them, before `safe_ns` can grow."""
        safe = self.safe_ns()
        return {
            source
            for source, promise in self._promises.items()
            if earliest_due(promise, self._segments[source]) == safe
        }
