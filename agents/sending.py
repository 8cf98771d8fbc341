"""The sending side of a node: its transmitters, what is offered to them, and when the next frames can start.

An *outlet* is where frames leave: a neighbour's name for the link to it, or AIR for the radio that all links of a
shared medium have in common.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import TYPE_CHECKING

from ..errors import BadInput
from ..topologies import natural_key
from ..transport.clock import Clock
from ..transport.events import DATA, FOREVER_NS, OFFER, SOURCE, TIME, TRANSMIT, Event
from ..transport.frames import AirFrame, Frame, Message
from ..transport.links import DELIVERED, LinkSettings
from ..transport.media import AIR, on_air
from ..transport.propagation import Propagation
from ..transport.stages import Surroundings
from ..transport.transmitter import Transmission, Transmitter
from .journal import Dropped, Sent

if TYPE_CHECKING:
    from .node import Node

Put = Callable[[str, Message], None]


class FrameTooLarge(BadInput):
    """A payload over the MTU of its link."""


class Sending:
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
        self.awaited: dict[str, int] = {}

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

    def _on_transmit(self, event: Event) -> None:
        if self._node.dead:
            return
        name = event[SOURCE]
        if self.awaits(event):
            del self.awaited[name]
        self._pump(name, event[TIME])

    def _pump(self, name: str, now_ns: int) -> None:
        """Start the next frame if it may start now; while frames wait, there is an event for the next start."""
        outlet = self.outlets[name]
        start = outlet.next_start(now_ns)
        if start is None or start > now_ns:
            self._come_back(name, start)
            return
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
        if start is not None and start < self.awaited.get(name, FOREVER_NS):
            self.awaited[name] = start
            self._count += 1
            self._node.schedule(start, TRANSMIT, name, self._count, self._on_transmit, None)

    def _transmit(self, name: str, transmission: Transmission) -> None:
        payload, start, airtime, copies = transmission
        incarnation, journal = self._node.incarnation, self._node.journal.sent
        for target, sequence, copy, due, verdict in copies:
            journal.append(Sent(target, sequence, len(payload), start, airtime, due, verdict, copy))
            if name != AIR:
                self.sent[name] = sent = self.sent[name] + 1
                carried = payload if verdict == DELIVERED else b""
                self._put(name, Frame(incarnation, sequence, start, airtime, due, verdict, carried, sent, None, copy))
        if name == AIR:
            self.sent[name] = sent = self.sent[name] + 1
            shaded = tuple(way.target for way in self.outlets[AIR].ways if way.settings.cut or not way.settings.present)
            air = AirFrame(incarnation, sent - 1, start, airtime, payload, sent, None, tuple(copies), shaded)
            self._put(name, air)

    # -- changes ------------------------------------------------------------------------------------------------

    def change(self, target: str, settings: LinkSettings) -> None:
        """A link has new settings from now on."""
        name = self.outlet_of[target]
        self.outlets[name].change(target, settings)
        self._come_back(name, self.outlets[name].next_start(self._node.now_ns))

    def set_clock(self, clock: Clock) -> None:
        """Slots follow another reading from now on."""
        for name, outlet in self.outlets.items():
            outlet.set_clock(clock)
            self._come_back(name, outlet.next_start(self._node.now_ns))

    def earliest_starts(self, ready_ns: Mapping[str, int]) -> dict[str, int]:
        """Outlet → earliest start of a frame that is not offered before an instant; for ever stays for ever."""
        return {
            name: ready if ready >= FOREVER_NS else self.outlets[name].earliest_next(ready)
            for name, ready in ready_ns.items()
        }

    def finish(self) -> None:
        """Write down which frames still wait for their transmitter."""
        waiting: dict[str, list[int]] = {}
        for outlet in self.outlets.values():
            for target, sequence in outlet.waiting():
                waiting.setdefault(target, []).append(sequence)
        for target, sequences in waiting.items():
            self._node.journal.events.append({"event": "queued", "target": target, "sequences": sequences})
