"""The twin: all nodes of a plan in one process, on one heap.

Frames are handed over as they are; tests hold that to what comes of their encoded bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from heapq import heappush
from typing import Any, Protocol

from ..agents.journal import Batch
from ..agents.node import Node
from ..agents.plan import Plan
from ..agents.sender import Put
from ..transport import fabric
from ..transport.events import DATA, FAULT, TIME, Event
from ..transport.frames import Message
from ..transport.media_settings import AIR
from .record.evaluation_pass import evaluated
from .record.machine import one_blas_thread
from .record.record import Collector, Record

_PROGRESS_EVERY_NS = 100_000_000
_RESTART = 2
"""Sequence of a restart among the events of its kill, after its start and its end."""

Life = tuple[str, int]
"""Name of an agent, and incarnation."""

LastHeard = Mapping[tuple[Life, Life], int]
"""(source, target) → number of transmissions that the target received from an externally killed source."""


class RecordSink(Protocol):
    """Receives the journals and events of a run from an engine."""

    def __call__(self, batch: Batch) -> None:
        """Add the entries of one agent."""

    def event(self, event: dict[str, Any]) -> None:
        """Add an event of the run."""


class Twin:
    """One run of a plan in this process, repeatable bit for bit.

    Args:
        plan: the plan.
        sink: receives journals and events.
        last_heard: last transmissions of externally killed agents that their neighbours received.
    """

    def __init__(self, plan: Plan, sink: RecordSink, last_heard: LastHeard | None = None) -> None:
        self._plan = plan
        self._sink = sink
        self._last_heard = last_heard or {}
        self.heap: list[Event] = []
        self._dead: list[Node] = []
        self._order = {agent.name: index for index, agent in enumerate(plan.all_agents)}
        with one_blas_thread():
            self.nodes = {agent.name: self._node(agent.name, 0, 0) for agent in plan.all_agents}
        for agent in plan.agents:
            for incarnation, kill in enumerate(plan.kills(agent.name), start=1):
                if kill.until_ns is not None:
                    self._restart_at(kill.until_ns, kill.id, agent.name, incarnation)

    def _restart_at(self, time_ns: int, fault: str, name: str, incarnation: int) -> None:
        heappush(self.heap, (time_ns, FAULT, fault, _RESTART, 0, self._order[name], self._restart, (name, incarnation)))

    def _node(self, name: str, incarnation: int, start_ns: int, saved: bytes | None = None) -> Node:
        index = self._order[name] + incarnation * len(self._order)
        node = Node(self._plan, name, self.heap, self._carry(name), incarnation, start_ns, index, saved)
        node.receiver.unheard_ns = lambda: node.state.now_ns  # here every transmission is received at its start
        return node

    def _carry(self, source: str) -> Put:
        def put(outlet: str, message: Message) -> None:
            for target in self._reached(source, outlet):
                node = self.nodes[target]
                last = self._last_heard.get(((source, message.incarnation), (target, node.state.incarnation)))
                if last is None or last >= message.sent:
                    node.receiver.receive(source, message)

        return put

    def _reached(self, source: str, outlet: str) -> Iterable[str]:
        """The agents that an outlet reaches: one neighbour, or all in reach of the radio."""
        if outlet != AIR:
            return (outlet,)
        return [way.target for way in self.nodes[source].sender.outlets[AIR].ways]

    def _restart(self, event: Event) -> None:
        name, incarnation = event[DATA]
        dead = self.nodes[name]
        self._dead.append(dead)
        keeps = self._plan.kills(name)[incarnation - 1].keep_state
        self.nodes[name] = self._node(name, incarnation, event[TIME], dead.saved if keeps else None)
        self._sink.event({"event": "restarted", "agent": name, "incarnation": incarnation, "time_ns": event[TIME]})

    def run(self, go_on: Callable[[int], bool] | None = None) -> int:
        """Handle every event before the end; the nominal time that was reached [ns].

        `go_on` is called with the nominal time now and then; the run ends there if it returns False.
        """

        def flush(now_ns: int) -> bool:
            for node in (*self._dead, *self.nodes.values()):
                if batch := node.take_journal():
                    self._sink(batch)
            return go_on is None or go_on(now_ns)

        self._sink.event({"event": "started", "time_ns": 0})
        with one_blas_thread():
            end_ns = fabric.run(self.heap, self._plan.duration_ns, _PROGRESS_EVERY_NS, flush)
        for node in self.nodes.values():
            if not node.state.dead:
                node.finish()
        flush(end_ns)
        if end_ns < self._plan.duration_ns:
            self._sink.event({"event": "stopped", "time_ns": end_ns})
        self._sink.event({"event": "finished", "time_ns": end_ns})
        return end_ns


def recorded(plan: Plan) -> Record:
    """The record of a plan, run in the twin to its end, evaluated and kept in memory."""
    collector = Collector()
    Twin(plan, collector).run()
    return evaluated(collector.record(plan))
