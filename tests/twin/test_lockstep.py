"""Lockstep pace without processes: the real pacers, wired by an in-memory network that delivers when it pleases.

Every pacer runs its node as in a process of its own. The network keeps order on each link, as one subscriber does, and
nothing else: which link delivers next, how many of its frames at once, and when a woken agent wakes up, is drawn.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

from volery.agents.journal import Batch
from volery.agents.node import Node
from volery.agents.pacing import Lockstep
from volery.agents.plan import Plan
from volery.experiments.accounting import account
from volery.experiments.record import Collector, Record
from volery.transport.faults import Fault, LinkFault, Pause
from volery.transport.frames import PROMISE_ONLY, Message, decode, encode
from volery.transport.latencies import Constant
from volery.transport.media import AIR, Aloha, FullDuplex, HalfDuplex

if TYPE_CHECKING:
    from asyncio import AbstractEventLoop

MS = 1_000_000

SEEDS = range(30)


class Network:
    """All nodes of a plan in lockstep pace, and the wire between them. It watches that promises are kept."""

    def __init__(self, plan: Plan, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._plan = plan
        self._wire: dict[tuple[str, str], deque[bytes]] = {link: deque() for link in plan.links}
        self._promised = dict.fromkeys(plan.links, 0)
        self._woken: list[Callable[[], None]] = []
        self.done: set[str] = set()
        self.pacers: dict[str, Lockstep] = {}
        self.nodes: dict[str, Node] = {}
        for agent in plan.agents:
            done = partial(self.done.add, agent.name)
            pacer = Lockstep(cast("AbstractEventLoop", self), self._write(agent.name), done, lambda wake: wake)
            self.pacers[agent.name] = pacer
            self.nodes[agent.name] = Node(plan, agent.name, [], pacer.put)

    def _write(self, source: str) -> Callable[[str, Message], None]:
        def write(outlet: str, frame: Message) -> None:
            near = self._plan.agent(source).neighbours
            for target in near if outlet == AIR else (outlet,):
                link = (source, target)
                if frame.sequence != PROMISE_ONLY:
                    assert frame.start_ns >= self._promised[link], f"{link}: a frame starts before the promise"
                assert frame.promise_ns is not None
                assert frame.promise_ns >= self._promised[link], f"{link}: a promise was taken back"
                self._promised[link] = frame.promise_ns
                self._wire[link].append(encode(frame))

        return write

    def call_soon_threadsafe(self, wake: Callable[[], None]) -> None:
        """All that a pacer asks of its loop."""
        self._woken.append(wake)

    def start(self) -> None:
        """Bring all nodes to life."""
        for name, pacer in self.pacers.items():
            pacer.begin(self.nodes[name], 0)

    def deliver(self) -> bool:
        """Deliver some of what is on one link, or wake somebody up; False when nothing is left to do."""
        busy = [link for link, queue in self._wire.items() if queue]
        if not busy and not self._woken:
            return False
        choice = self._rng.integers(len(busy) + len(self._woken))
        if choice >= len(busy):
            self._woken.pop(choice - len(busy))()
            return True
        source, target = busy[choice]
        queue = self._wire[source, target]
        for _ in range(self._rng.integers(1, len(queue) + 1)):
            self.pacers[target].arrived(source, decode(queue.popleft()))
        return True

    def deliver_some(self, times: int) -> None:
        """Deliver that often, if there is so much."""
        for _ in range(times):
            self.deliver()

    def inject(self, fault_from: Callable[[int], Fault]) -> Fault:
        """Arm a fault everywhere as a supervisor does: hold all, choose an instant beyond all, arm, release."""
        instants = []
        for pacer in self.pacers.values():
            instants.append(pacer.hold())
            self.deliver()
        fault = fault_from(max(instants) + 1)
        for pacer in self.pacers.values():
            assert pacer.arm(fault, fault.at_ns if fault.until_ns is None else fault.until_ns)
            self.deliver()
        for pacer in self.pacers.values():
            pacer.release()
        return fault

    def finish(self) -> Record:
        """Deliver until nobody says anything more; everybody must have come to the end."""
        while self.deliver():
            pass
        waiting = {name: self.nodes[name].now_ns for name in self.nodes.keys() - self.done}
        assert not waiting, f"stuck, waiting for each other: {waiting}"
        collector = Collector()
        for node in self.nodes.values():
            node.finish()
            collector(node.take_journal())
        collector.event({"event": "finished", "time_ns": self._plan.duration_ns})
        return collector.record(self._plan)


def _entries(batches: Mapping[Any, Batch]) -> dict[Any, list[Any]]:
    """What was written down, without the order in which frames of different links were."""

    def by_link(entries: Iterable[Any]) -> list[Any]:
        return sorted(entries, key=lambda entry: entry[0])

    return {
        life: [batch.estimates, by_link(batch.sent), by_link(batch.heard), by_link(batch.dropped), batch.events]
        for life, batch in batches.items()
    }


def assert_equal(locked: Record, twin: Record) -> None:
    """The same estimates and stories, no frame late, and every account closed."""
    assert _entries(locked.batches) == _entries(twin.batches)
    assert not any(batch.late for record in (locked, twin) for batch in record.batches.values())
    assert all(link.closes for link in account(locked).values())


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("who", ["talker", "answerer"])
def test_lockstep_equals_the_twin(
    who: str, seed: int, drawn_plan: Any, twin_run: Callable[[Plan], Record], request: pytest.FixtureRequest
) -> None:
    """No promise is broken, nobody waits for ever, and every estimate and every frame's story is the twin's."""
    plan = drawn_plan(request.getfixturevalue(who), seed)
    network = Network(plan, seed)
    network.start()
    assert_equal(network.finish(), twin_run(plan))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("who", ["talker", "answerer"])
def test_radios_in_lockstep_equal_the_twin(
    who: str, seed: int, radio_plan: Any, twin_run: Callable[[Plan], Record], request: pytest.FixtureRequest
) -> None:
    """Nobody decides on a frame from the air before everybody who could destroy it has been heard."""
    plan = radio_plan(request.getfixturevalue(who), seed)
    network = Network(plan, seed)
    network.start()
    assert_equal(network.finish(), twin_run(plan))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("who", ["talker", "answerer"])
def test_live_faults_equal_the_twin(
    who: str, seed: int, drawn_plan: Any, twin_run: Callable[[Plan], Record], request: pytest.FixtureRequest
) -> None:
    """A fault from outside, and its end, take effect at one instant everywhere: the twin that knew of it agrees."""
    plan = drawn_plan(request.getfixturevalue(who), seed)
    network = Network(plan, seed)
    network.start()
    rng = np.random.default_rng(seed)
    network.deliver_some(int(rng.integers(0, 60)))
    begun = network.inject(lambda at_ns: _live_fault(rng, plan, at_ns))
    network.deliver_some(int(rng.integers(0, 60)))
    ended = network.inject(lambda at_ns: replace(begun, until_ns=at_ns))
    assert_equal(network.finish(), twin_run(replace(plan, faults=(*plan.faults, ended))))


def _live_fault(rng: np.random.Generator, plan: Plan, at_ns: int) -> Fault:
    """Some change of everything, or a pause, until it is cleared."""
    agent = plan.agents[rng.integers(len(plan.agents))]
    if rng.random() < 0.25:
        return Pause("l1", at_ns, None, agent.name)
    medium = HalfDuplex(access=Aloha()) if rng.random() < 0.5 else FullDuplex()
    changes = {"latency": Constant(int(rng.integers(0, 5 * MS))), "rate": 2e6, "medium": medium}
    edge = (agent.name, agent.neighbours[0])
    return LinkFault("l1", at_ns, None, (edge, edge[::-1]), changes)
