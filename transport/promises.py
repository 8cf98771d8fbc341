"""Conservative synchronisation: up to which instant an agent may handle events.

Chandy and Misra 1979; Bryant 1977. Each neighbour promises the earliest instant at which its next transmission can
start. The frame is due at least airtime and minimum latency later, so all events before the smallest of these instants
may be handled. Every frame and promise carries the number of frames sent, so that a frame lost by the middleware is
noticed.
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
    """The middleware lost a frame, so that the run cannot be exact."""


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
    """Earliest due time of a frame that starts at `promise_ns` or later."""
    if promise_ns >= FOREVER_NS:
        return FOREVER_NS
    return min(max(promise_ns, start) + ahead for start, end, ahead in segments if end > promise_ns)


class NeighbourPromises:
    """Promises of the neighbours of one agent, and which of them are down.

    A neighbour that is down until R starts no transmission before R. Frames for its next incarnation must not be put
    before that is running: until its first message, nothing from R on is safe.

    Args:
        name: the agent.
        segments: neighbour → lookahead of the link from it over time.
        interventions: instants of the live faults of the run so far, in their order; each is beyond all that was
            handled when it was chosen, so that promises hold until then and no further.
        incarnations: for an agent that joins a running swarm: neighbour → its first incarnation that counts. The first
            message of that says how many frames came before.
        start_ns: when the agent starts; its neighbours are taken to have come as far.
    """

    def __init__(
        self,
        name: str,
        segments: Mapping[str, tuple[Segment, ...]],
        interventions: Iterable[int] = (),
        *,
        incarnations: Mapping[str, int] | None = None,
        start_ns: int = 0,
    ) -> None:
        first = None if incarnations else 0
        self._name = name
        self.interventions = list(interventions)
        self._given = dict.fromkeys(segments, 0)
        self._segments = dict(segments)
        self._promises = dict.fromkeys(segments, 0)
        self._received: dict[str, int | None] = dict.fromkeys(segments, first)
        self._incarnations: dict[str, int | None] = dict.fromkeys(segments, first)
        self._ended = {source: (incarnations or {}).get(source, 0) - 1 for source in segments}
        self._returns: dict[str, list[tuple[int, int]]] = {source: [] for source in segments}
        self._killed_externally: dict[str, int] = {}
        self._progress = dict.fromkeys(segments, start_ns)
        self._bounds: dict[str, int] = {}
        for source in segments:
            self._update_bound(source)

    def heard(self, source: str, message: Message) -> bool:
        """Note a frame or promise; False for one of an incarnation that has ended, which is to be ignored.

        Raises:
            FrameMissing: the sender has put more frames than have come.
        """
        known = self._incarnations[source]
        first = max(self._ended[source] + 1, known or 0)
        if not first <= message.incarnation < self._killed_externally.get(source, _NEVER):
            return False
        if message.incarnation != known:
            self._received[source] = None if known is None else 0
            self._incarnations[source] = message.incarnation
            self._promises[source] = 0
            self._progress[source] = self._given[source] = 0
        self._progress[source] = max(self._progress[source], message.start_ns)
        received = self._received[source]
        if received is None:
            received = message.sent
        elif message.sequence >= 0:
            received += 1
        self._received[source] = received
        if received != message.sent:
            raise FrameMissing(f"link {source}>{self._name}: {message.sent} frames were sent, {received} have come")
        if message.promise_ns is not None:
            self._take_promise(source, message.promise_ns, message.interventions)
        self._update_bound(source)
        return True

    def _take_promise(self, source: str, promise_ns: int, given: int) -> None:
        """Note a promise that was given with so many interventions known; that of the dead holds through all.

        One that knows of an intervention which is not known here yet takes the place of all before.
        """
        if promise_ns < OVER_NS:
            promise_ns = min([promise_ns, *self.interventions[given:]])
        if given > max(self._given[source], len(self.interventions)):
            self._promises[source] = promise_ns
        else:
            self._promises[source] = max(self._promises[source], promise_ns)
        self._given[source] = max(self._given[source], given)

    def knows(self, source: str, incarnation: int) -> bool:
        """Whether an incarnation of a neighbour has been heard."""
        known = self._incarnations[source]
        return known is not None and known >= incarnation

    def relink(self, source: str, segments: tuple[Segment, ...]) -> None:
        """Give a link another lookahead, which a live fault changes from an instant that no agent has passed."""
        self._segments[source] = segments
        self._update_bound(source)

    def expect(self, source: str, returns: list[tuple[int, int]]) -> None:
        """Expect a neighbour back: (incarnation, start) of each restart; an external kill cancels those to come."""
        killed = self._killed_externally.get(source, _NEVER)
        self._returns[source] = [(incarnation, from_ns) for incarnation, from_ns in returns if incarnation < killed]
        self._update_bound(source)

    def down(self, source: str) -> None:
        """Note that a neighbour is down: it starts nothing until it returns as expected."""
        self._promises[source] = OVER_NS
        self._update_bound(source)

    def external_kill(self, source: str, incarnation: int) -> None:
        """Ignore further messages of an incarnation that was killed externally; it starts nothing more.

        Messages of the incarnations before it may still be on their way.
        """
        if source in self._promises:
            self._killed_externally[source] = incarnation
            known = self._incarnations[source]
            if incarnation <= (self._ended[source] + 1 if known is None else known):
                self._promises[source] = OVER_NS
            self.expect(source, self._returns[source])

    def intervene(self, instant_ns: int) -> None:
        """Note an intervention at an instant that no agent has passed: promises that do not know of it end there."""
        self.interventions.append(instant_ns)
        for source, promise_ns in self._promises.items():
            if instant_ns < promise_ns < OVER_NS and self._given[source] < len(self.interventions):
                self._promises[source] = instant_ns
                self._update_bound(source)

    def _update_bound(self, source: str) -> None:
        """Bound of a neighbour: no frame of it that is yet unheard is due before."""
        due_ns = earliest_due(self._promises[source], self._segments[source])
        returns = (start_ns for number, start_ns in self._returns[source] if not self.knows(source, number))
        self._bounds[source] = min([due_ns, *returns])

    def safe_ns(self, sources: Iterable[str] | None = None) -> int:
        """Every frame due before this instant, of all or of some neighbours, is here."""
        bounds = self._bounds.values() if sources is None else (self._bounds[source] for source in sources)
        return min(bounds, default=FOREVER_NS)

    def awaited_ns(self) -> int:
        """The earliest expected return of a neighbour that has not been heard since."""
        returns = (
            from_ns
            for source, expected in self._returns.items()
            for incarnation, from_ns in expected
            if not self.knows(source, incarnation)
        )
        return min(returns, default=FOREVER_NS)

    def unstarted_ns(self) -> int:
        """No transmission that is yet unheard starts before this instant, unless there is an intervention."""
        return min([*self._promises.values(), self.awaited_ns()])

    def silent_before(self, time_ns: int, sources: Iterable[str]) -> set[str]:
        """Those of the sources that may still start something before an instant."""
        return {source for source in sources if self._promises[source] < time_ns}

    def blocking(self, time_ns: int, sources: Iterable[str] | None = None) -> set[str]:
        """Those of all or some neighbours that must be heard before an instant is safe."""
        bounds = self._bounds
        return {source for source in (bounds if sources is None else sources) if bounds[source] <= time_ns}

    def credit_ns(self) -> int:
        """The least instant before which a living neighbour has handled everything, as far as it has said."""
        living = (self._progress[source] for source, promise_ns in self._promises.items() if promise_ns < OVER_NS)
        return min(living, default=FOREVER_NS)

    def behind(self, time_ns: int) -> set[str]:
        """The living neighbours that have not said to have handled everything before an instant."""
        return {
            source
            for source, promise_ns in self._promises.items()
            if promise_ns < OVER_NS and self._progress[source] < time_ns
        }
