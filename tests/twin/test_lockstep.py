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

from volery.agents.agent import Agent
from volery.agents.journal import Batch
from volery.agents.node import Node
from volery.agents.pacing import Beginning, Lockstep
from volery.agents.plan import Plan
from volery.experiments.accounting import account
from volery.experiments.record import Collector, Record
from volery.experiments.verify import compare, replay
from volery.transport.faults import Fault, Kill, LinkFault, Pause, kills_of
from volery.transport.frames import PROMISE_ONLY, Message, decode, encode
from volery.transport.latencies import Constant
from volery.transport.links import CUT, LinkSettings
from volery.transport.media import AIR, Aloha, FullDuplex, HalfDuplex, Tdma

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
        self._interventions = 0
        self._live: dict[str, Fault] = {}
        self._collector = Collector()
        self._subscribed = {agent.name for agent in plan.agents}
        self._over: set[tuple[str, int]] = set()
        self._outside: set[str] = set()
        self._standing_by: set[str] = set()
        self.done: set[str] = set()
        self.pacers: dict[str, Lockstep] = {}
        self.nodes: dict[str, Node] = {}
        for agent in plan.agents:
            self._make(agent.name)

    def _make(self, name: str, incarnation: int = 0, start_ns: int = 0, saved: bytes | None = None) -> None:
        done = partial(self._done, name, incarnation)
        pacer = Lockstep(cast("AbstractEventLoop", self), self._write(name), done, lambda wake: wake)
        self.pacers[name] = pacer
        self.nodes[name] = Node(self._plan, name, [], pacer.put, incarnation, start_ns, saved=saved)

    def _done(self, name: str, incarnation: int) -> None:
        """A node is at its end: of the run, or of a life, which has a next one where its kill has an end."""
        node = self.nodes[name]
        if not node.dead:
            self.done.add(name)
        elif (name, incarnation) not in self._over:
            self._over.add((name, incarnation))
            self._subscribed.discard(name)
            self._collector(node.take_journal())
            for link, queue in self._wire.items():
                if link[1] == name:
                    queue.clear()
            kill = self.kills(name)[incarnation]
            if kill.until_ns is None:
                self.done.add(name)
            else:
                self._woken.append(partial(self._stand_by, kill))

    def kills(self, name: str) -> list[Kill]:
        """The kills of an agent, those from outside the plan included."""
        return kills_of(({fault.id: fault for fault in self._plan.faults} | self._live).values(), name)

    def _stand_by(self, kill: Kill) -> None:
        """The next life of an agent has joined; it is told to begin some time later."""
        assert kill.until_ns is not None
        if kill.until_ns >= self._plan.duration_ns:
            self.done.add(kill.agent)
            return
        self.done.discard(kill.agent)
        self._subscribed.add(kill.agent)
        self._standing_by.add(kill.agent)
        self._woken.append(partial(self._revive, kill.agent, kill))

    def _revive(self, name: str, kill: Kill) -> None:
        assert kill.until_ns is not None
        self._standing_by.discard(name)
        before = self.nodes[name]
        self._promised.update({link: 0 for link in self._promised if link[0] == name})
        self._make(name, before.incarnation + 1, kill.until_ns, before.saved if kill.keep_state else None)
        for fault in self._live.values():
            self.nodes[name].arm(fault)
        self.pacers[name].begin(self.nodes[name], Beginning(0, self._plan.duration_ns, self._interventions))

    def _write(self, source: str) -> Callable[[str, Message], None]:
        def write(outlet: str, frame: Message) -> None:
            near = self._plan.agent(source).neighbours
            for target in near if outlet == AIR else (outlet,):
                link = (source, target)
                if target not in self._subscribed:
                    continue
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
            pacer.begin(self.nodes[name], Beginning(0, self._plan.duration_ns))

    def deliver(self) -> bool:
        """Deliver some of what is on one link, or wake somebody up; False when nothing is left to do."""
        busy = [link for link, queue in self._wire.items() if queue and link[1] not in self._standing_by]
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

    def kill_from_outside(self, name: str) -> None:
        """An agent's process is gone; some of what it sent is on the wire still, and everybody is told at some time."""
        incarnation = self.nodes[name].incarnation
        self._subscribed.discard(name)
        self.done.add(name)
        self._woken = [wake for wake in self._woken if getattr(wake, "__self__", None) is not self.pacers[name]]
        for link, queue in self._wire.items():
            if link[1] == name:
                queue.clear()
        batch = self.nodes[name].take_journal()
        self._collector(batch)
        self._outside.add(name)
        self._collector.event(
            {
                "event": "died",
                "agent": name,
                "incarnation": incarnation,
                "time_ns": 0,
                "cause": "was killed from outside",
            }
        )
        for other, pacer in self.pacers.items():
            if other != name:
                self._woken.append(partial(pacer.gone, name, incarnation))

    def deliver_until(self, reached: Callable[[], bool]) -> bool:
        """Deliver until something has come about, or nothing is left."""
        while not reached() and self.deliver():
            pass
        return reached()

    def inject(self, fault_from: Callable[[int], Fault]) -> Fault:
        """Arm a fault everywhere as a supervisor does: hold all, choose an instant beyond all, arm, release."""
        instants = []
        living = [self.pacers[name] for name in self.nodes if not self.nodes[name].dead]
        for pacer in living:
            instants.append(pacer.hold())
            self.deliver()
        fault = fault_from(max(instants) + 1)
        instant_ns = fault.at_ns if fault.until_ns is None else fault.until_ns
        self._interventions += 1
        self._live[fault.id] = fault
        self._promised = {link: min(promised, instant_ns) for link, promised in self._promised.items()}
        for pacer in living:
            assert pacer.arm([fault], instant_ns)
            self.deliver()
        if isinstance(fault, Kill) and fault.until_ns is not None:
            self._stand_by(fault)
        for pacer in living:
            pacer.release()
        return fault

    def finish(self) -> Record:
        """Deliver until nobody says anything more; everybody must have come to the end."""
        while self.deliver():
            pass
        waiting = {name: self.nodes[name].now_ns for name in self.nodes.keys() - self.done}
        assert not waiting, f"stuck, waiting for each other: {waiting}"
        for name, node in self.nodes.items():
            if name in self._outside:
                continue
            if not node.dead:
                node.finish()
            if batch := node.take_journal():
                self._collector(batch)
        self._collector.event({"event": "finished", "time_ns": self._plan.duration_ns})
        return self._collector.record(replace(self._plan, faults=(*self._plan.faults, *self._live.values())))


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


@pytest.mark.parametrize("seed", range(5))
def test_frames_carry_the_promises_of_an_agent_that_acts_on_timers(seed: int, plan_of: Any, talker: Any) -> None:
    """Each frame promises as far as the next one, so that a link needs one bare promise, at the beginning."""
    names = "12345678"
    settings = LinkSettings(medium=HalfDuplex(access=Tdma(100.0, 200_000)), rate=1e6, latency=Constant(10 * MS))
    plan = plan_of(list(zip(names, names[1:] + names[0], strict=True)), talker, settings, duration_ms=1000)
    network = Network(plan, seed)
    network.start()
    record = network.finish()
    assert sum(len(batch.sent) for batch in record.batches.values()) > 30 * len(plan.links)
    assert sum(pacer.promises for pacer in network.pacers.values()) == len(plan.links)


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
@pytest.mark.parametrize("kind", ["drawn_plan", "radio_plan"])
def test_graphs_that_change_in_lockstep_equal_the_twin(
    kind: str,
    who: str,
    seed: int,
    come_and_go: Callable[[Plan, int], Plan],
    twin_run: Callable[[Plan], Record],
    request: pytest.FixtureRequest,
) -> None:
    """Links come and go at the same nominal instants in both, and nobody waits for one that is not there."""
    plan = come_and_go(request.getfixturevalue(kind)(request.getfixturevalue(who), seed), seed)
    network = Network(plan, seed)
    network.start()
    record = network.finish()
    assert_equal(record, twin_run(plan))
    for (name, _), batch in record.batches.items():
        absent = [sent for sent in batch.sent if not plan.is_present((name, sent.target), sent.start_ns)]
        assert {sent.verdict for sent in absent} <= {CUT}


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


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("who", ["talker", "answerer"])
def test_deaths_and_returns_equal_the_twin(
    who: str, seed: int, drawn_plan: Any, twin_run: Callable[[Plan], Record], request: pytest.FixtureRequest
) -> None:
    """A dead neighbour holds back nobody but for its return, before which nothing is sent that is meant for it."""
    plan = drawn_plan(request.getfixturevalue(who), seed, kills=True)
    network = Network(plan, seed)
    network.start()
    assert_equal(network.finish(), twin_run(plan))


@pytest.mark.parametrize("keep_state", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_live_kills_and_restarts_equal_the_twin(
    seed: int, keep_state: bool, drawn_plan: Any, answerer: type[Agent], twin_run: Callable[[Plan], Record]
) -> None:
    """An agent is killed from outside the plan, and brought back, with its state or without."""
    plan = drawn_plan(answerer, seed)
    network = Network(plan, seed)
    network.start()
    victim = plan.agents[seed % len(plan.agents)].name
    network.deliver_some(40)
    begun = network.inject(lambda at_ns: Kill("l1", at_ns, None, victim, keep_state))
    network.deliver_some(200)
    if not network.nodes[victim].dead:
        assert begun.at_ns >= plan.duration_ns or network.deliver_until(lambda: network.nodes[victim].dead)
    ended = network.inject(lambda at_ns: replace(begun, until_ns=at_ns))
    assert_equal(network.finish(), twin_run(replace(plan, faults=(*plan.faults, ended))))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_death_from_outside_replays_in_the_twin(seed: int, drawn_plan: Any, answerer: type[Agent]) -> None:
    """Nobody waits for the dead; with what was heard of it last, the twin comes to the same estimates and stories."""
    plan = drawn_plan(answerer, seed)
    network = Network(plan, seed)
    network.start()
    network.deliver_some(30 + 7 * seed)
    network.kill_from_outside(plan.agents[seed % len(plan.agents)].name)
    record = network.finish()
    assert list(compare(record, replay(record), 0.0)) == []
    assert all(link.closes for link in account(record).values())


def _live_fault(rng: np.random.Generator, plan: Plan, at_ns: int) -> Fault:
    """Some change of everything, or a pause, until it is cleared."""
    agent = plan.agents[rng.integers(len(plan.agents))]
    if rng.random() < 0.25:
        return Pause("l1", at_ns, None, agent.name)
    medium = HalfDuplex(access=Aloha()) if rng.random() < 0.5 else FullDuplex()
    changes = {"latency": Constant(int(rng.integers(0, 5 * MS))), "rate": 2e6, "medium": medium}
    edge = (agent.name, agent.neighbours[0])
    return LinkFault("l1", at_ns, None, (edge, edge[::-1]), changes)
