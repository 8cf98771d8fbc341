"""The sending side of a node: its transmitters, what is offered to them, and when the next frames can start.

An *outlet* is where frames leave: a neighbour's name for the link to it, or AIR for the radio that all links of a
shared medium have in common.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import TYPE_CHECKING

from ..errors import BadInput
from ..randomness import stream
from ..topologies import natural_key
from ..transport.clock import Clock
from ..transport.csma import Contention, Csma
from ..transport.events import DATA, FOREVER_NS, HANDLER, OFFER, SOURCE, TIME, TRANSMIT, Event
from ..transport.frames import AirFrame, Frame, Message
from ..transport.links import ACCESS, DELIVERED, LinkSettings
from ..transport.media import AIR, HalfDuplex, on_air
from ..transport.propagation import Copy, Propagation
from ..transport.stages import Surroundings
from ..transport.transmitter import Transmission, Transmitter
from .journal import Dropped, Sent

if TYPE_CHECKING:
    from .node import Node

Put = Callable[[str, Message], None]


class FrameTooLarge(BadInput):
    """A payload over the MTU of its link."""


class Sender:
    """The transmitters of one node.

    `outlets`: their names. `sent`: outlet → transmissions so far. `awaited`: outlet → the next start that is scheduled.
    """

    def __init__(self, node: Node, put: Put) -> None:
        self._node = node
        self._put = put
        self._count = 0
        ways = {target: self._way(target) for target in node.neighbours}
        shared = [way for way in ways.values() if on_air(way.settings.medium)]
        self.outlets = {
            target: Transmitter([way], int(natural_key(node.name) > natural_key(target)))
            for target, way in ways.items()
            if way not in shared
        }
        if shared:
            self.outlets[AIR] = Transmitter(shared, *node.plan.slots.get(node.name, (0, 1)))
        self.outlet_of = {way.target: name for name, outlet in self.outlets.items() for way in outlet.ways}
        self.sent = dict.fromkeys(self.outlets, 0)
        self.contention: Contention | None = None
        self._accesses = 0
        if shared:
            self._set_access()
        self.awaited: dict[str, int] = {}

    def _set_access(self) -> None:
        """Contend by carrier sense from now on, or no more, as the radio's settings say."""
        medium = self.outlets[AIR].settings.medium
        access = medium.access if isinstance(medium, HalfDuplex) else None
        if access == (self.contention.access if self.contention else None):
            return
        node = self._node
        self.contention = None
        if isinstance(access, Csma):
            self._accesses += 1
            words = (node.name, str(node.incarnation), str(self._accesses))
            self.contention = Contention(access, stream(node.plan.seed, "backoff", *words))

    def _way(self, target: str) -> Propagation:
        node, plan = self._node, self._node.plan
        around = Surroundings.of(
            plan.seed, node.name, target, node.incarnation, lambda time_ns: plan.distance_m(node.name, target, time_ns)
        )
        return Propagation(target, around, node.settings(target))

    # -- frames -------------------------------------------------------------------------------------------------

    def send(self, targets: Collection[str], payload: bytes, stream: str) -> None:
        """Hand a payload to one outlet; it is offered `compute` later.

        Raises:
            FrameTooLarge: the payload is over the MTU; it counts as refused.
        """
        node = self._node
        name = self.outlet_of[next(iter(targets))]
        outlet = self.outlets[name]
        if len(payload) > (mtu := outlet.settings.mtu):
            self._drop(outlet.count(targets), node.now_ns, "refused")
            raise FrameTooLarge(
                f"agent {node.name}: {len(payload)} B for {', '.join(targets)}, the link's MTU is {mtu} B"
            )
        self._count += 1
        data = (targets, payload, stream)
        node.schedule(node.now_ns + node.compute_ns, OFFER, name, self._count, self._on_offer, data)

    def broadcast(self, targets: Collection[str], payload: bytes, stream: str) -> None:
        """Hand a payload to every link: once for those of the radio, and to each of the others."""
        shared = [target for target in targets if self.outlet_of[target] == AIR]
        for group in ([shared] if shared else []) + [[target] for target in targets if target not in shared]:
            self.send(tuple(group), payload, stream)

    def _drop(self, numbered: Iterable[tuple[str, int]], time_ns: int, cause: str) -> None:
        self._node.journal.dropped += [Dropped(target, sequence, time_ns, cause) for target, sequence in numbered]

    def _on_offer(self, event: Event) -> None:
        if self._node.dead:
            return
        name = event[SOURCE]
        self._drop(self.outlets[name].offer(event[TIME], *event[DATA]), event[TIME], "queue")
        self._pump(name, event[TIME])

    def senses(self, event: Event) -> bool:
        """Whether at this event the radio has listened to the channel, and decides by what it heard."""
        return event[HANDLER] == self._on_sensed

    def contends(self, name: str) -> bool:
        """Whether an outlet gets hold of its medium by carrier sense."""
        return name == AIR and self.contention is not None

    def _contend(self, contention: Contention, from_ns: int) -> None:
        """Listen for the frame at the head of the queue, if none is in hand."""
        if contention.idle and self.outlets[AIR].waiting():
            self._listen(contention.begin(self.outlets[AIR].head_ready(from_ns)))

    def _listen(self, until_ns: int) -> None:
        self._count += 1
        self._node.schedule(until_ns, TRANSMIT, AIR, self._count, self._on_sensed, None)

    def _on_sensed(self, event: Event) -> None:
        contention, now_ns = self.contention, event[TIME]
        if self._node.dead or contention is None or contention.sense_ns != now_ns:
            return
        busy = self._node.receiver.ether.busy(now_ns - contention.access.cca, now_ns)
        if not contention.sensed(now_ns, busy=busy):
            self._drop(self.outlets[AIR].give_up(), now_ns, ACCESS)
            self._contend(contention, now_ns)
        elif contention.start_ns is not None:
            self._count += 1
            self._node.schedule(contention.start_ns, TRANSMIT, AIR, self._count, self._on_free, None)
        elif contention.sense_ns is not None:
            self._listen(contention.sense_ns)

    def _on_free(self, event: Event) -> None:
        """The channel was free, and the radio has turned round."""
        contention = self.contention
        if self._node.dead or contention is None or contention.start_ns != event[TIME]:
            return
        contention.started()
        if self.outlets[AIR].head_ready(event[TIME]) > event[TIME]:
            self._contend(contention, event[TIME])
            return
        transmission = self.outlets[AIR].transmit(event[TIME])
        self._contend(contention, event[TIME])
        self._transmit(AIR, transmission)

    def _on_transmit(self, event: Event) -> None:
        if self._node.dead:
            return
        name = event[SOURCE]
        if self.awaits(event):
            del self.awaited[name]
        self._pump(name, event[TIME])

    def _pump(self, name: str, now_ns: int) -> None:
        """Start the next frame if it may start now; while frames wait, there is an event for the next start."""
        if name == AIR and self.contention is not None:
            self._contend(self.contention, now_ns)
            return
        outlet = self.outlets[name]
        start = outlet.next_start(now_ns)
        if start is None or start > now_ns:
            self._come_back(name, start)
            return
        self.awaited.pop(name, None)
        transmission = outlet.transmit(now_ns)
        self._come_back(name, outlet.next_start(now_ns))
        self._transmit(name, transmission)

    def transmit_ahead(self, before_ns: int) -> None:
        """Put frames on the wire whose start is settled and lies before an instant, as nothing changes in between.

        Their nominal start, and all that follows from it, is the same; the network gains the time until then.
        """
        for name, outlet in self.outlets.items():
            while outlet.settled and (start := self.awaited.get(name, before_ns)) < before_ns:
                del self.awaited[name]
                transmission = outlet.transmit_ahead(start)
                self._come_back(name, outlet.next_start(start))
                self._transmit(name, transmission)

    def awaits(self, transmit: Event) -> bool:
        """Whether a frame still waits for this start, and was not put on the wire ahead of it."""
        return self.awaited.get(transmit[SOURCE]) == transmit[TIME]

    def _come_back(self, name: str, start: int | None) -> None:
        if self.contends(name):
            return
        if start is not None and start < self.awaited.get(name, FOREVER_NS):
            self.awaited[name] = start
            self._count += 1
            self._node.schedule(start, TRANSMIT, name, self._count, self._on_transmit, None)

    def _transmit(self, name: str, transmission: Transmission) -> None:
        self._node.receiver.note()
        payload, start, airtime, copies = transmission
        incarnation, journal = self._node.incarnation, self._node.journal.sent
        for target, sequence, copy, due, verdict in copies:
            if target not in self._node.wired:
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
        """A link has new settings from now on."""
        name = self.outlet_of[target]
        self.outlets[name].change(target, settings)
        if name == AIR:
            self._set_access()
            if self.contention is not None:
                self._contend(self.contention, self._node.now_ns)
        self._start_anew(name)

    def set_clock(self, clock: Clock) -> None:
        """Slots follow another reading from now on."""
        for name, outlet in self.outlets.items():
            outlet.set_clock(clock)
            self._start_anew(name)

    def _start_anew(self, name: str) -> None:
        """The next start is another, perhaps a later one, than it was."""
        self.awaited.pop(name, None)
        self._come_back(name, self.outlets[name].next_start(self._node.now_ns))

    def earliest_starts(self, ready_ns: Mapping[str, int]) -> dict[str, int]:
        """Outlet → earliest start of a frame in hand, or not offered before an instant; for ever stays for ever."""
        starts = {
            name: ready if ready >= FOREVER_NS else self.outlets[name].earliest_next(ready)
            for name, ready in ready_ns.items()
        }
        if AIR in starts and self.contention is not None:
            starts[AIR] = min(starts[AIR], self.contention.earliest_ns())
        return starts

    def finish(self) -> None:
        """Write down which frames still wait for their transmitter."""
        waiting: dict[str, list[int]] = {}
        for outlet in self.outlets.values():
            for target, sequence in outlet.waiting():
                waiting.setdefault(target, []).append(sequence)
        for target, sequences in waiting.items():
            self._node.journal.events.append({"event": "queued", "target": target, "sequences": sequences})


def _by_target(copies: Iterable[Copy]) -> dict[str, tuple[Copy, ...]]:
    arrivals: dict[str, tuple[Copy, ...]] = {}
    for copy in copies:
        arrivals[copy.target] = (*arrivals.get(copy.target, ()), copy)
    return arrivals
