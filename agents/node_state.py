"""What a node, its sender and its receiver share."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heapify, heappush
from typing import Any

from ..transport.events import FAULT, OFFER, RANK, TIME, Event
from .journal import Batch
from .plan import AgentPlan


class NodeState:
    """One incarnation of an agent: its identity, its events, its nominal time and its journal.

    `now_ns` never goes back. `neighbours` are all that the agent ever has, those to whom it is wired included. `heap`
    is shared between the nodes of a twin, `index` tells them apart; `sending` has the agent's own offers and starts of
    transmissions, and is `heap` itself unless `part` is called. Whoever handles an event of a dead node ignores
    it.
    """

    def __init__(self, me: AgentPlan, heap: list[Event], incarnation: int, start_ns: int, index: int) -> None:
        self.name, self.wired, self.compute_ns = me.name, me.wired, me.compute_ns
        self.neighbours = me.neighbours + me.wired
        self.incarnation, self.start_ns, self.index = incarnation, start_ns, index
        self.heap = self.sending = heap
        self.journal = Batch(me.name, incarnation)
        self.now_ns = start_ns
        self.dead = False
        self._last: Event = (start_ns, FAULT, "", -1, 0, index, self.advance, None)

    def schedule(
        self, time_ns: int, rank: int, source: str, sequence: int, handler: Callable[[Event], None], data: Any
    ) -> None:
        """Put an event of this node into the heap."""
        heappush(self.heap, (time_ns, rank, source, sequence, 0, self.index, handler, data))

    def part(self) -> None:
        """Keep offers and starts of transmissions in a heap of their own from now on; not for the nodes of a twin."""
        self.sending = [event for event in self.heap if event[RANK] >= OFFER]
        self.heap = [event for event in self.heap if event[RANK] < OFFER]
        heapify(self.sending)
        heapify(self.heap)

    def schedule_sending(
        self, time_ns: int, rank: int, source: str, sequence: int, handler: Callable[[Event], None], data: Any
    ) -> None:
        """Put an offer or a start of a transmission of this node into its heap."""
        heappush(self.sending, (time_ns, rank, source, sequence, 0, self.index, handler, data))

    def has_passed(self, event: Event) -> bool:
        """Whether a later event was handled already."""
        return event < self._last

    def advance(self, event: Event) -> None:
        """Note that an event is being handled; a late one leaves the time as it is."""
        if event > self._last:
            self._last = event
            self.now_ns = max(self.now_ns, event[TIME])
