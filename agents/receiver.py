"""The hearing side of a node: frames that come in, what became of them, and those that a link holds back."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..transport.events import DATA, FRAME, HANDLER, SOURCE, TIME, Event
from ..transport.frames import AirFrame, Frame, Message
from ..transport.links import DELIVERED, fate
from ..transport.media import AIR, Ether
from .journal import LAST_HEARD, MISSED, Heard, Late

if TYPE_CHECKING:
    from .node import Node

_INCARNATION_SHIFT = 48
_SETTLED_KEPT = 256
TIDY_EVERY = 1024
"""After so many transmissions, own ones and others', those that can meet no frame any more are forgotten."""


class Receiver:
    """What reaches one node from its neighbours.

    `unheard_ns` says before which instant nothing starts that is yet unheard. Unless the pace knows better that is told
    by the order of each neighbour's frames, so that one which never sends keeps everything remembered.
    """

    def __init__(self, node: Node) -> None:
        self.unheard_ns: Callable[[], int] = self._in_order_ns
        self._newest = {source: 0 for source in node.neighbours if source not in node.wired}
        self._noted = 0
        self._node = node
        self.ether = Ether()
        self._settled: deque[tuple[int, int, str, Frame]] = deque(maxlen=_SETTLED_KEPT)
        self._settled_end_ns = 0
        self._held: dict[str, list[Event]] = {}
        self._transmissions: dict[tuple[str, int], int] = {}
        self._gone: set[tuple[str, int]] = set()

    def receive(self, source: str, message: Message) -> None:
        """Take in a message as soon as the network has it; a frame is handled when it is due, or at once if it is late.

        A frame that started before this incarnation came to life is none of its business.
        """
        self._count(source, message)
        if source in self._newest:
            self._newest[source] = message.start_ns
        if message.start_ns < self._node.start_ns:
            return
        if isinstance(message, Frame):
            self._take(source, message)
            return
        if self._node.name not in message.shaded:
            self._overhear(source, message)
        for frame in message.for_target(self._node.name):
            self._take(source, frame)
        self.note()

    def _count(self, source: str, message: Message) -> None:
        """Note how much has come; on a wire nothing may be missing, and nobody else would tell."""
        known = self._transmissions.get((source, message.incarnation))
        self._transmissions[source, message.incarnation] = message.sent
        missing = message.sent - (known or 0) - 1
        if missing > 0 and source in self._node.wired and (known is not None or self._node.start_ns == 0):
            entry = {"event": MISSED, "source": source, "count": missing, "time_ns": message.start_ns}
            self._node.journal.events.append(entry)

    def _take(self, source: str, frame: Frame) -> None:
        node = self._node
        sequence = (frame.incarnation << _INCARNATION_SHIFT) + frame.sequence
        event = (frame.due_ns, FRAME, source, sequence, frame.copy, node.index, self._on_arrival, frame)
        if node.has_passed(event):
            self._late(source, frame, node.now_ns - frame.due_ns)
            self._on_arrival(event)
        else:
            node.push(event)

    def _late(self, source: str, frame: Frame, behind_ns: int) -> None:
        late = Late(source, frame.incarnation, frame.sequence, frame.due_ns, behind_ns, frame.copy)
        self._node.journal.late.append(late)

    def _overhear(self, source: str, air: AirFrame) -> None:
        """Note the interval; where it would have destroyed a frame whose fate is settled, it is late."""
        end = air.start_ns + air.airtime_ns
        self.ether.hear(air.start_ns, end, source)
        if air.start_ns >= self._settled_end_ns:
            return
        for begun, ended, other, frame in self._settled:
            if other != source and begun < end and air.start_ns < ended:
                self._late(other, frame, self._node.now_ns - air.start_ns)

    def _on_arrival(self, event: Event) -> None:
        node = self._node
        frame: Frame = event[DATA]
        source = event[SOURCE]
        if node.dead and frame.due_ns >= node.now_ns:
            return
        if source in self._held:
            self._held[source].append(event)
            return
        start, end = frame.start_ns, frame.start_ns + frame.airtime_ns
        outlet = node.sender.outlet_of[source]
        collided = outlet == AIR and self.ether.collided(start, end, source)
        deaf = node.sender.outlets[outlet].transceiver.deaf(start, end)
        became = fate(frame.verdict, deaf=deaf, collided=collided)
        if source not in node.wired:
            heard = Heard(source, frame.incarnation, frame.sequence, frame.due_ns, became, frame.copy)
            node.journal.heard.append(heard)
        if outlet == AIR:
            self._settled.append((start, end, source, frame))
            self._settled_end_ns = max(self._settled_end_ns, end)
        if became == DELIVERED:
            node.admit(event, node.deliver)

    # -- what is forgotten ------------------------------------------------------------------------------------------

    def note(self) -> None:
        """One more transmission is remembered, which is the time to forget others now and then."""
        self._noted += 1
        if self._noted >= TIDY_EVERY:
            self._noted = 0
            self._forget()

    def _forget(self) -> None:
        """Forget transmissions that ended before whatever may yet ask for them: frames that are due, held or unheard.

        The radio listens to no more than the time of one assessment of the channel before now.
        """
        node, contention = self._node, self._node.sender.contention
        coming = [event for event in node.heap if event[HANDLER] == self._on_arrival]
        starts = (event[DATA].start_ns for events in (coming, *self._held.values()) for event in events)
        listened_ns = node.now_ns - (contention.access.cca if contention else 0)
        before_ns = min([listened_ns, self.unheard_ns(), *starts])
        self.ether.forget(before_ns)
        for outlet in node.sender.outlets.values():
            outlet.transceiver.forget(before_ns)

    def _in_order_ns(self) -> int:
        return min(self._newest.values(), default=self._node.now_ns)

    # -- hold and release ---------------------------------------------------------------------------------------

    def hold(self, source: str) -> None:
        """Frames from a neighbour that are due from now on wait."""
        self._held.setdefault(source, [])

    def release(self, source: str) -> None:
        """Frames that waited arrive at this instant, in their order, once all faults of it have begun or ended."""
        if source in self._held:
            self._node.schedule(self._node.now_ns, FRAME, source, -1, self._on_release, None)

    def _on_release(self, event: Event) -> None:
        source = event[SOURCE]
        if self._node.dead or self._node.holds(source):
            return
        for held in self._held.pop(source, ()):
            self._on_arrival((event[TIME], *held[1:]))

    # -- lives that somebody ends from outside, and the own end -----------------------------------------------------

    def gone(self, source: str, incarnation: int) -> None:
        """A neighbour was killed from outside: how much of it was heard is written down, now and at the end."""
        self._gone.add((source, incarnation))
        self._note_last(source, incarnation)

    def _note_last(self, source: str, incarnation: int) -> None:
        sent = self._transmissions.get((source, incarnation), 0)
        entry = {"event": LAST_HEARD, "source": source, "incarnation": incarnation, "sent": sent}
        self._node.journal.events.append(entry)

    def finish(self) -> None:
        """Write down which frames are still held back."""
        for life in sorted(self._gone):
            self._note_last(*life)
        for source, events in self._held.items():
            lives: dict[int, list[tuple[int, int]]] = {}
            for event in events:
                lives.setdefault(event[DATA].incarnation, []).append((event[DATA].sequence, event[DATA].copy))
            for incarnation, sequences in lives.items():
                entry = {"event": "held", "source": source, "incarnation": incarnation, "sequences": sequences}
                self._node.journal.events.append(entry)
