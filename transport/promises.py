"""Conservative synchronisation: how far an agent may go without hearing more.

Chandy and Misra 1979; Bryant 1977. Each neighbour promises the earliest instant at which its next transmission can
start. What starts then is due no sooner than airtime and shortest latency later, so everything before the least of
these instants may be handled. Every frame and promise carries the number of frames sent, so that a frame which the
middleware lost is noticed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..errors import RunFailed
from .events import FOREVER_NS, OVER_NS
from .faults import LinkFault, LinkName, effective
from .frames import Message
from .links import SHORTEST_TRAVEL_NS, LinkSettings

_NEVER = 2**31
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
        for start, end in zip(starts, [*starts[1:], OVER_NS], strict=True)
    )


def earliest_due(promise_ns: int, segments: tuple[Segment, ...]) -> int:
    """When a frame that starts at `promise_ns` or later can be due at the earliest."""
    if promise_ns >= FOREVER_NS:
        return FOREVER_NS
    return min(max(promise_ns, start) + ahead for start, end, ahead in segments if end > promise_ns)


class Horizon:
    """What the neighbours of one agent have promised, and who of them is down.

    A neighbour that is down until R starts nothing before, but what is meant for its next life must not be put before
    that has come: until it is heard of, nothing from R on is safe.

    Args:
        name: the agent.
        segments: neighbour → lookahead of the link from it over time.
        interventions: how often somebody has intervened in the run so far.
        lives: for an agent that comes to life in a swarm that runs already: neighbour → the first of its lives that
            counts. Its first message says how many frames came before.
    """

    def __init__(
        self,
        name: str,
        segments: Mapping[str, tuple[Segment, ...]],
        interventions: int = 0,
        *,
        lives: Mapping[str, int] | None = None,
    ) -> None:
        first = None if lives else 0
        self._name = name
        self.interventions = interventions
        self._segments = dict(segments)
        self._promises = dict.fromkeys(segments, 0)
        self._received: dict[str, int | None] = dict.fromkeys(segments, first)
        self._lives: dict[str, int | None] = dict.fromkeys(segments, first)
        self._over = {source: (lives or {}).get(source, 0) - 1 for source in segments}
        self._returns: dict[str, list[tuple[int, int]]] = {source: [] for source in segments}
        self._gone: dict[str, int] = {}
        self._bounds: dict[str, int] = {}
        for source in segments:
            self._rebound(source)

    def heard(self, source: str, message: Message) -> bool:
        """Take note of a frame or promise; False for one of a life that is over, which counts for nothing.

        Raises:
            FrameMissing: the sender has put more frames than have come.
        """
        known = self._lives[source]
        first = max(self._over[source] + 1, known or 0)
        if not first <= message.incarnation < self._gone.get(source, _NEVER):
            return False
        if message.incarnation != known:
            self._received[source] = None if known is None else 0
            self._lives[source] = message.incarnation
            self._promises[source] = 0
        received = self._received[source]
        if received is None:
            received = message.sent
        elif message.sequence >= 0:
            received += 1
        self._received[source] = received
        if received != message.sent:
            raise FrameMissing(f"link {source}>{self._name}: {message.sent} frames were sent, {received} have come")
        if message.promise_ns is not None and self._holds(message.promise_ns):
            self._promises[source] = max(self._promises[source], message.promise_ns)
        self._rebound(source)
        return True

    def _holds(self, promise_ns: int) -> bool:
        """Whether a promise still holds: one for ever does until somebody intervenes, that of the dead in any case."""
        return promise_ns < FOREVER_NS or promise_ns - FOREVER_NS >= self.interventions

    def forever_ns(self) -> int:
        """The promise for ever, which says how often somebody had intervened when it was given."""
        return FOREVER_NS + self.interventions

    def knows(self, source: str, incarnation: int) -> bool:
        """Whether this life of a neighbour has been heard of."""
        known = self._lives[source]
        return known is not None and known >= incarnation

    def relink(self, source: str, segments: tuple[Segment, ...]) -> None:
        """A live fault changes the lookahead of a link from an instant that nobody has passed."""
        self._segments[source] = segments
        self._rebound(source)

    def expect(self, source: str, returns: list[tuple[int, int]]) -> None:
        """A neighbour comes back: (life, from when on), for each of its restarts; one whose life was ended does not."""
        gone = self._gone.get(source, _NEVER)
        self._returns[source] = [(life, from_ns) for life, from_ns in returns if life < gone]
        self._rebound(source)

    def down(self, source: str) -> None:
        """A neighbour is down: it starts nothing until it comes back as expected."""
        self._promises[source] = OVER_NS
        self._rebound(source)

    def gone(self, source: str, incarnation: int) -> None:
        """A life ended from outside: what is heard of it from now on counts for nothing, and it starts nothing more.

        What the lives before it have said may still be on its way.
        """
        if source in self._promises:
            self._gone[source] = incarnation
            known = self._lives[source]
            if incarnation <= (self._over[source] + 1 if known is None else known):
                self._promises[source] = OVER_NS
            self.expect(source, self._returns[source])

    def intervene(self, instant_ns: int) -> None:
        """Somebody intervenes at an instant that nobody has passed: promises for ever hold until then only."""
        self.interventions += 1
        for source, promise_ns in self._promises.items():
            if FOREVER_NS <= promise_ns < OVER_NS:
                self._promises[source] = instant_ns
                self._rebound(source)

    def _rebound(self, source: str) -> None:
        """Nothing of a neighbour that is yet unheard is due before its bound."""
        due_ns = earliest_due(self._promises[source], self._segments[source])
        returns = (from_ns for life, from_ns in self._returns[source] if not self.knows(source, life))
        self._bounds[source] = min([due_ns, *returns])

    def safe_ns(self, sources: Iterable[str] | None = None) -> int:
        """Every frame due before this instant, of all or of some neighbours, is here."""
        bounds = self._bounds.values() if sources is None else (self._bounds[source] for source in sources)
        return min(bounds, default=FOREVER_NS)

    def unstarted_ns(self) -> int:
        """Nothing that is yet unheard starts before this instant, unless somebody intervenes."""
        returns = (
            from_ns
            for source, lives in self._returns.items()
            for life, from_ns in lives
            if not self.knows(source, life)
        )
        return min([*self._promises.values(), *returns], default=FOREVER_NS)

    def silent_before(self, time_ns: int, sources: Iterable[str]) -> set[str]:
        """Those of the sources that may still start something before an instant."""
        return {source for source in sources if self._promises[source] < time_ns}

    def blocking(self) -> set[str]:
        """The neighbours that must be heard, every one of them, before `safe_ns` can grow."""
        safe = self.safe_ns()
        return {source for source, bound in self._bounds.items() if bound == safe}
