"""The receiver of a node: frames that come in, what becomes of them, and those that a link holds back."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from heapq import heappush

from ..transport.events import DATA, FRAME, HANDLER, SOURCE, TIME, Event
from ..transport.frames import AirFrame, Frame, Message
from ..transport.links import DELIVERED, fate
from ..transport.media import Ether
from ..transport.media_settings import AIR
from .journal import LAST_HEARD, MISSED, Arrived, Heard, Late, Released
from .node_state import NodeState
from .sender import Sender

_INCARNATION_SHIFT = 48
_SETTLED_KEPT = 256
TIDY_EVERY = 1024
"""After so many transmissions, own ones and others', those that can overlap no frame any more are forgotten."""


class Receiver:
    """What reaches one node from its neighbours.

    Args:
        state: of the node.
        sender: its transceivers cannot receive while they transmit.
        ether: the transmissions of others, noted here.
        deliver: called with the event of a frame that has arrived.

    `unheard_ns` says before which instant no transmission starts that is yet unheard. Unless the pace knows better that
    follows from the order of each neighbour's frames, so that one which never sends keeps everything remembered.
    `wall_ns` is nominal time by the wall clock, for a pace that has one.
    """

    def __init__(self, state: NodeState, sender: Sender, ether: Ether, deliver: Callable[[Event], None]) -> None:
        self._state, self._sender, self.ether, self._deliver = state, sender, ether, deliver
        self.unheard_ns: Callable[[], int] = self._in_order_ns
        self.wall_ns: Callable[[], int] | None = None
        self._newest = {source: 0 for source in state.neighbours if source not in state.wired}
        self._noted = 0
        self._settled: deque[tuple[int, int, str, Frame]] = deque(maxlen=_SETTLED_KEPT)
        self._settled_end_ns = 0
        self._holding: set[str] = set()
        self._held: dict[str, list[Event]] = {}
        self._arrivals: dict[tuple[str, int, int, int], int] = {}
        self._transmissions: dict[tuple[str, int], int] = {}
        self._external_kills: set[tuple[str, int]] = set()

    def receive(self, source: str, message: Message, arrived_ns: int = 0) -> None:
        """Take in a message as soon as the network has it; a frame is handled when it is due, or at once if it is late.

        A frame that started before this incarnation is ignored.

        Args:
            source: who sent it.
            message: a frame, or a transmission of a radio.
            arrived_ns: when it arrived by `wall_ns`, if there is one.
        """
        self._count(source, message)
        if source in self._newest:
            self._newest[source] = message.start_ns
        if message.start_ns < self._state.start_ns:
            return
        if isinstance(message, Frame):
            self._take(source, message, arrived_ns)
            return
        if self._state.name not in message.shaded:
            self._overhear(source, message)
        for frame in message.for_target(self._state.name):
            self._take(source, frame, arrived_ns)
        self.note_transmission()

    def _count(self, source: str, message: Message) -> None:
        """Count transmissions; on a wire the middleware may lose none, so a gap is journalled."""
        known = self._transmissions.get((source, message.incarnation))
        self._transmissions[source, message.incarnation] = message.sent
        missing = message.sent - (known or 0) - 1
        if missing > 0 and source in self._state.wired and (known is not None or self._state.start_ns == 0):
            entry = {"event": MISSED, "source": source, "count": missing, "time_ns": message.start_ns}
            self._state.journal.events.append(entry)

    def _take(self, source: str, frame: Frame, arrived_ns: int) -> None:
        state = self._state
        if self.wall_ns is not None and source not in state.wired:
            self._arrivals[source, frame.incarnation, frame.sequence, frame.copy] = arrived_ns
        sequence = (frame.incarnation << _INCARNATION_SHIFT) + frame.sequence
        event = (frame.due_ns, FRAME, source, sequence, frame.copy, state.index, self._on_arrival, frame)
        if state.has_passed(event):
            self._late(source, frame, state.now_ns - frame.due_ns)
            self._on_arrival(event)
        else:
            heappush(state.heap, event)

    def _late(self, source: str, frame: Frame, behind_ns: int) -> None:
        late = Late(source, frame.incarnation, frame.sequence, frame.due_ns, behind_ns, frame.copy)
        self._state.journal.late.append(late)

    def _overhear(self, source: str, air: AirFrame) -> None:
        """Note a transmission's interval; where it would have destroyed a frame whose fate is settled, it is late."""
        end = air.start_ns + air.airtime_ns
        self.ether.hear(air.start_ns, end, source)
        if air.start_ns >= self._settled_end_ns:
            return
        for begun, ended, other, frame in self._settled:
            if other != source and begun < end and air.start_ns < ended:
                self._late(other, frame, self._state.now_ns - air.start_ns)

    def _on_arrival(self, event: Event) -> None:
        state = self._state
        frame: Frame = event[DATA]
        source = event[SOURCE]
        if state.dead and frame.due_ns >= state.now_ns:
            return
        if source in self._held:
            self._held[source].append(event)
            return
        start, end = frame.start_ns, frame.start_ns + frame.airtime_ns
        outlet = self._sender.outlet_of[source]
        collided = outlet == AIR and self.ether.collided(start, end, source)
        deaf = self._sender.outlets[outlet].transceiver.deaf(start, end)
        became = fate(frame.verdict, deaf=deaf, collided=collided)
        if source not in state.wired:
            heard = Heard(source, frame.incarnation, frame.sequence, frame.due_ns, became, frame.copy)
            state.journal.heard.append(heard)
            self._note_arrival(source, frame)
        if outlet == AIR:
            self._settled.append((start, end, source, frame))
            self._settled_end_ns = max(self._settled_end_ns, end)
        if became == DELIVERED:
            self._deliver(event)

    def _note_arrival(self, source: str, frame: Frame) -> None:
        """Journal when a frame really came, where there is a wall clock."""
        if self.wall_ns is None:
            return
        number = (frame.incarnation, frame.sequence, frame.copy)
        if (arrived_ns := self._arrivals.pop((source, *number), None)) is not None:
            row = Arrived(source, frame.incarnation, frame.sequence, arrived_ns, self.wall_ns(), frame.copy)
            self._state.journal.arrived.append(row)

    # -- what is forgotten ------------------------------------------------------------------------------------------

    def note_transmission(self) -> None:
        """Count a transmission that is remembered, and forget old ones now and then."""
        self._noted += 1
        if self._noted >= TIDY_EVERY:
            self._noted = 0
            self._forget()

    def _forget(self) -> None:
        """Forget transmissions that ended before every frame which they may yet overlap: frames due, held or unheard.

        Carrier sensing looks back by one clear channel assessment.
        """
        state, contention = self._state, self._sender.contention
        coming = [event for event in state.heap if event[HANDLER] == self._on_arrival]
        starts = (event[DATA].start_ns for events in (coming, *self._held.values()) for event in events)
        listened_ns = state.now_ns - (contention.access.cca if contention else 0)
        before_ns = min([listened_ns, self.unheard_ns(), *starts])
        self.ether.forget(before_ns)
        for outlet in self._sender.outlets.values():
            outlet.transceiver.forget(before_ns)

    def _in_order_ns(self) -> int:
        return min(self._newest.values(), default=self._state.now_ns)

    # -- links that hold frames back ----------------------------------------------------------------------------

    def set_hold(self, source: str, *, hold: bool) -> None:
        """Hold frames from a neighbour back that are due from now on, or release them."""
        if hold:
            self._holding.add(source)
            self._held.setdefault(source, [])
        elif source in self._held:
            self._holding.discard(source)
            self._state.schedule(self._state.now_ns, FRAME, source, -1, self._on_release, None)

    def _on_release(self, event: Event) -> None:
        """Frames that were held arrive now, in their order, unless another fault of this instant holds them."""
        source = event[SOURCE]
        if self._state.dead or source in self._holding:
            return
        for held in self._held.pop(source, ()):
            frame: Frame = held[DATA]
            released = Released(source, frame.incarnation, frame.sequence, event[TIME], frame.copy)
            self._state.journal.released.append(released)
            self._on_arrival((event[TIME], *held[1:]))

    # -- the end ------------------------------------------------------------------------------------------------

    def external_kill(self, source: str, incarnation: int) -> None:
        """Journal how much was heard of an agent that was killed externally, now and at the end."""
        if source in self._state.neighbours:
            self._external_kills.add((source, incarnation))
            self._note_last(source, incarnation)

    def _note_last(self, source: str, incarnation: int) -> None:
        sent = self._transmissions.get((source, incarnation), 0)
        entry = {"event": LAST_HEARD, "source": source, "incarnation": incarnation, "sent": sent}
        self._state.journal.events.append(entry)

    def finish(self) -> None:
        """Journal which frames are still held back."""
        for source, incarnation in sorted(self._external_kills):
            self._note_last(source, incarnation)
        for source, events in self._held.items():
            by_incarnation: dict[int, list[tuple[int, int]]] = {}
            for event in events:
                by_incarnation.setdefault(event[DATA].incarnation, []).append((event[DATA].sequence, event[DATA].copy))
            for incarnation, sequences in by_incarnation.items():
                entry = {"event": "held", "source": source, "incarnation": incarnation, "sequences": sequences}
                self._state.journal.events.append(entry)
