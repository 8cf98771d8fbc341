"""The sender of a node: its transmitters, what is offered to them, and when the next frames can start.

An *outlet* is where frames leave: a neighbour's name for the link to it, or AIR for the radio that all links of a
shared medium have in common.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from ..randomness import stream
from ..topologies import natural_key
from ..transport.clock import Clock
from ..transport.csma import Contention
from ..transport.directed_link import DirectedLink
from ..transport.events import DATA, FOREVER_NS, HANDLER, OFFER, SOURCE, TIME, TRANSMIT, Event
from ..transport.frames import AirFrame, Frame, Message
from ..transport.links import ACCESS, DELIVERED, LinkSettings
from ..transport.media import Ether
from ..transport.media_settings import AIR, Csma, HalfDuplex, on_air
from ..transport.propagation import Copy, Propagation
from ..transport.transmitter import Transmission, Transmitter
from .journal import Dropped, Sent
from .node_state import NodeState
from .plan import Plan

Put = Callable[[str, Message], None]
"""Called with (outlet, message) when a transmission starts."""


class Sender:
    """The transmitters of one node.

    Args:
        state: of the node.
        plan: for random streams, slots and distances.
        settings: neighbour → settings of the link to it at the start.
        ether: the transmissions that the node hears, for carrier sensing.
        put: takes the messages.

    `outlets`: name → transmitter. `outlet_of`: neighbour → name of its outlet. `mtus`: outlet → MTU [bytes]. `sent`:
    outlet → transmissions so far. `contention`: of the radio, where it accesses its medium by carrier sense.
    """

    def __init__(
        self, state: NodeState, plan: Plan, settings: Mapping[str, LinkSettings], ether: Ether, put: Put
    ) -> None:
        self._state, self._ether, self._put = state, ether, put
        self._seed = plan.seed
        self._count = 0
        ways = [Propagation(target, _surroundings(state, plan, target), link) for target, link in settings.items()]
        shared = [way for way in ways if on_air(way.settings.medium)]
        self.outlets = {
            way.target: Transmitter([way], int(natural_key(state.name) > natural_key(way.target)))
            for way in ways
            if way not in shared
        }
        if shared:
            self.outlets[AIR] = Transmitter(shared, *plan.slots.get(state.name, (0, 1)))
        self.outlet_of = {way.target: name for name, outlet in self.outlets.items() for way in outlet.ways}
        self.mtus = {name: outlet.settings.mtu for name, outlet in self.outlets.items()}
        self.sent = dict.fromkeys(self.outlets, 0)
        self.contention: Contention | None = None
        self._accesses = 0
        if shared:
            self._set_access()
        self._scheduled: dict[str, int] = {}

    def _set_access(self) -> None:
        """Begin or end carrier sensing, as the radio's settings say."""
        medium = self.outlets[AIR].settings.medium
        access = medium.access if isinstance(medium, HalfDuplex) else None
        if access == (self.contention.access if self.contention else None):
            return
        self.contention = None
        if isinstance(access, Csma):
            self._accesses += 1
            words = (self._state.name, str(self._state.incarnation), str(self._accesses))
            self.contention = Contention(access, stream(self._seed, "backoff", *words))

    # -- frames -------------------------------------------------------------------------------------------------

    def offer(self, targets: tuple[str, ...], payload: bytes, stream: str) -> None:
        """Offer a payload to the outlet of its targets, `compute` later."""
        name = self.outlet_of[targets[0]]
        self._count += 1
        ready_ns = self._state.now_ns + self._state.compute_ns
        self._state.schedule_sending(ready_ns, OFFER, name, self._count, self._on_offer, (targets, payload, stream))

    def refuse(self, targets: tuple[str, ...]) -> None:
        """Count a payload over the MTU."""
        outlet = self.outlets[self.outlet_of[targets[0]]]
        self._drop(outlet.count(targets), self._state.now_ns, "refused")

    def _drop(self, numbered: Iterable[tuple[str, int]], time_ns: int, cause: str) -> None:
        self._state.journal.dropped += [Dropped(target, sequence, time_ns, cause) for target, sequence in numbered]

    def _on_offer(self, event: Event) -> None:
        if self._state.dead:
            return
        name = event[SOURCE]
        self._drop(self.outlets[name].offer(event[TIME], *event[DATA]), event[TIME], "queue")
        self._start_next(name, event[TIME])

    def senses(self, event: Event) -> bool:
        """Whether this event ends a clear channel assessment of the radio."""
        return event[HANDLER] == self._on_sensed

    def contends(self, name: str) -> bool:
        """Whether an outlet accesses its medium by carrier sense."""
        return name == AIR and self.contention is not None

    def _contend(self, contention: Contention, from_ns: int) -> None:
        """Begin contention for the frame at the head of the queue, unless one is under way."""
        if contention.idle and self.outlets[AIR].waiting():
            self._listen(contention.begin(self.outlets[AIR].head_ready(from_ns)))

    def _listen(self, until_ns: int) -> None:
        self._count += 1
        self._state.schedule_sending(until_ns, TRANSMIT, AIR, self._count, self._on_sensed, None)

    def _on_sensed(self, event: Event) -> None:
        contention, now_ns = self.contention, event[TIME]
        if self._state.dead or contention is None or contention.sense_ns != now_ns:
            return
        busy = self._ether.busy(now_ns - contention.access.cca, now_ns)
        if not contention.sensed(now_ns, busy=busy):
            self._drop(self.outlets[AIR].give_up(), now_ns, ACCESS)
            self._contend(contention, now_ns)
        elif contention.start_ns is not None:
            self._count += 1
            self._state.schedule_sending(contention.start_ns, TRANSMIT, AIR, self._count, self._on_channel_free, None)
        elif contention.sense_ns is not None:
            self._listen(contention.sense_ns)

    def _on_channel_free(self, event: Event) -> None:
        """The channel was clear, and the radio has turned from receiving to transmitting."""
        contention = self.contention
        if self._state.dead or contention is None or contention.start_ns != event[TIME]:
            return
        contention.started()
        if self.outlets[AIR].head_ready(event[TIME]) > event[TIME]:
            self._contend(contention, event[TIME])
            return
        transmission = self.outlets[AIR].transmit(event[TIME])
        self._contend(contention, event[TIME])
        self._transmit(AIR, transmission)

    def _on_transmit(self, event: Event) -> None:
        if self._state.dead:
            return
        name = event[SOURCE]
        if self.awaits(event):
            del self._scheduled[name]
        self._start_next(name, event[TIME])

    def _start_next(self, name: str, now_ns: int) -> None:
        """Start the next frame if it may start now, and schedule the start after it while frames wait."""
        if name == AIR and self.contention is not None:
            self._contend(self.contention, now_ns)
            return
        outlet = self.outlets[name]
        start = outlet.next_start(now_ns)
        if start is None or start > now_ns:
            self._schedule_start(name, start)
            return
        self._scheduled.pop(name, None)
        transmission = outlet.transmit(now_ns)
        self._schedule_start(name, outlet.next_start(now_ns))
        self._transmit(name, transmission)

    def transmit_ahead(self, before_ns: int) -> None:
        """Put frames on the wire early, whose start before an instant is settled because nothing changes until then.

        Their nominal start, and all that follows from it, stays the same; the network gains the time until then.
        """
        for name, outlet in self.outlets.items():
            while outlet.settled and (start := self._scheduled.get(name, before_ns)) < before_ns:
                del self._scheduled[name]
                transmission = outlet.transmit_ahead(start)
                self._schedule_start(name, outlet.next_start(start))
                self._transmit(name, transmission)

    def awaits(self, transmit: Event) -> bool:
        """Whether a frame still waits for this start, and was not put on the wire early."""
        return self._scheduled.get(transmit[SOURCE]) == transmit[TIME]

    def _schedule_start(self, name: str, start: int | None) -> None:
        if self.contends(name):
            return
        if start is not None and start < self._scheduled.get(name, FOREVER_NS):
            self._scheduled[name] = start
            self._count += 1
            self._state.schedule_sending(start, TRANSMIT, name, self._count, self._on_transmit, None)

    def _transmit(self, name: str, transmission: Transmission) -> None:
        payload, start, airtime, copies = transmission
        incarnation, journal = self._state.incarnation, self._state.journal.sent
        for target, sequence, copy, due, verdict in copies:
            if target not in self._state.wired:
                journal.append(Sent(target, sequence, len(payload), start, airtime, due, verdict, copy))
            if name != AIR:
                self.sent[name] = sent = self.sent[name] + 1
                carried = payload if verdict == DELIVERED else b""
                self._put(name, Frame(incarnation, sequence, start, airtime, due, verdict, carried, sent, None, copy))
        if name == AIR:
            self.sent[name] = sent = self.sent[name] + 1
            shaded = tuple(way.target for way in self.outlets[AIR].ways if way.settings.cut or not way.settings.present)
            air = AirFrame(incarnation, sent - 1, start, airtime, payload, sent, None, _by_target(copies), shaded)
            self._put(name, air)

    # -- changes ------------------------------------------------------------------------------------------------

    def change(self, target: str, settings: LinkSettings) -> None:
        """Give a link new settings from now on."""
        name = self.outlet_of[target]
        self.outlets[name].change(target, settings)
        self.mtus[name] = self.outlets[name].settings.mtu
        if name == AIR:
            self._set_access()
            if self.contention is not None:
                self._contend(self.contention, self._state.now_ns)
        self._reschedule(name)

    def set_clock(self, clock: Clock) -> None:
        """Let slots follow another clock reading from now on."""
        for name, outlet in self.outlets.items():
            outlet.set_clock(clock)
            self._reschedule(name)

    def _reschedule(self, name: str) -> None:
        """Schedule the next start anew; it may be a later one."""
        self._scheduled.pop(name, None)
        self._schedule_start(name, self.outlets[name].next_start(self._state.now_ns))

    def earliest_starts(self, ready_ns: Mapping[str, int]) -> dict[str, int]:
        """Outlet → earliest start of a frame in hand, or of one not offered before an instant.

        Args:
            ready_ns: outlet → that instant; where it is FOREVER_NS or later it is returned as it is.
        """
        starts = {
            name: ready if ready >= FOREVER_NS else self.outlets[name].earliest_next(ready)
            for name, ready in ready_ns.items()
        }
        if AIR in starts and self.contention is not None:
            starts[AIR] = min(starts[AIR], self.contention.earliest_ns())
        return starts

    def finish(self) -> None:
        """Journal which frames still wait for their transmitter."""
        waiting: dict[str, list[int]] = {}
        for outlet in self.outlets.values():
            for target, sequence in outlet.waiting():
                waiting.setdefault(target, []).append(sequence)
        for target, sequences in waiting.items():
            self._state.journal.events.append({"event": "queued", "target": target, "sequences": sequences})


def _surroundings(state: NodeState, plan: Plan, target: str) -> DirectedLink:
    return DirectedLink.of(
        plan.seed, state.name, target, state.incarnation, lambda time_ns: plan.distance_m(state.name, target, time_ns)
    )


def _by_target(copies: Iterable[Copy]) -> dict[str, tuple[Copy, ...]]:
    arrivals: dict[str, tuple[Copy, ...]] = {}
    for copy in copies:
        arrivals[copy.target] = (*arrivals.get(copy.target, ()), copy)
    return arrivals
