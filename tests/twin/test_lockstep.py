"""Lockstep pace without processes: the real pacers, wired by an in-memory network that delivers when it pleases.

Every pacer runs its node as in a process of its own. The network keeps order on each link, as one subscriber does, and
nothing else: which link delivers next, and how many of its frames at once, is drawn.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pytest

from volery.agents.agent import Agent
from volery.agents.journal import Batch
from volery.agents.node import Node
from volery.agents.pacing import Lockstep
from volery.agents.plan import Plan, World
from volery.experiments.accounting import account
from volery.experiments.record import Collector, Record
from volery.transport.faults import Fault, LinkFault, Pause
from volery.transport.frames import PROMISE_ONLY, Frame, decode, encode
from volery.transport.latencies import Constant, Normal, Uniform
from volery.transport.links import LinkSettings, Queue
from volery.transport.losses import Bernoulli, GilbertElliott
from volery.transport.media import Aloha, FullDuplex, HalfDuplex, Tdma

MS = 1_000_000
DURATION_MS = 200

SEEDS = range(30)


class Network:
    """All nodes of a plan in lockstep pace, and the wire between them. It watches that promises are kept."""

    def __init__(self, plan: Plan, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._plan = plan
        self._wire: dict[tuple[str, str], deque[bytes]] = {link: deque() for link in plan.links}
        self._promised = dict.fromkeys(plan.links, 0)
        self.promises = 0
        self.done: set[str] = set()
        self.pacers: dict[str, Lockstep] = {}
        self.nodes: dict[str, Node] = {}
        for agent in plan.agents:
            pacer = Lockstep(self._write(agent.name), lambda name=agent.name: self.done.add(name))  # type: ignore[misc]
            self.pacers[agent.name] = pacer
            self.nodes[agent.name] = Node(plan, agent.name, [], pacer.put)

    def _write(self, source: str) -> Callable[[str, Frame], None]:
        def write(target: str, frame: Frame) -> None:
            link = (source, target)
            if frame.sequence == PROMISE_ONLY:
                self.promises += 1
            else:
                assert frame.start_ns >= self._promised[link], f"{link}: a frame starts before the promise"
            assert frame.promise_ns is not None
            assert frame.promise_ns >= self._promised[link], f"{link}: a promise was taken back"
            self._promised[link] = frame.promise_ns
            self._wire[link].append(encode(frame))

        return write

    def start(self) -> None:
        """Bring all nodes to life."""
        for name, pacer in self.pacers.items():
            pacer.begin(self.nodes[name], 0)

    def deliver(self) -> bool:
        """Deliver some of what is on one link; False when nothing is under way."""
        busy = [link for link, queue in self._wire.items() if queue]
        if not busy:
            return False
        source, target = busy[self._rng.integers(len(busy))]
        queue = self._wire[source, target]
        some = [queue.popleft() for _ in range(self._rng.integers(1, len(queue) + 1))]
        self.pacers[target].arrived([(source, decode(data)) for data in some])
        return True

    def run(self) -> Record:
        """Deliver until nobody says anything more; everybody must have come to the end."""
        self.start()
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


def _one(rng: np.random.Generator, *choices: Any) -> Any:
    return choices[rng.integers(len(choices))]


def _medium(rng: np.random.Generator) -> Any:
    tdma = Tdma(_one(rng, 60.0, 90.0, 100.0), int(rng.integers(0, 400_000)))
    return _one(rng, FullDuplex(), HalfDuplex(access=Aloha()), HalfDuplex(access=tdma))


def _latency(rng: np.random.Generator) -> Any:
    low = int(rng.integers(0, 8 * MS))
    return _one(rng, Constant(0), Constant(low), Uniform(low, low + 3 * MS), Normal(low, low // 4))


def _rate(rng: np.random.Generator) -> Any:
    return _one(rng, None, 115_200.0, 250_000.5, 1e6)


def _loss(rng: np.random.Generator) -> Any:
    return _one(rng, (), (Bernoulli(0.3),), (GilbertElliott(0.2, 0.4),))


def _settings(rng: np.random.Generator, medium: Any) -> LinkSettings:
    return LinkSettings(
        medium=medium,
        rate=_rate(rng),
        overhead=int(rng.integers(0, 5)),
        queue=Queue(int(rng.integers(1, 5)), _one(rng, "drop-tail", "drop-head", "latest")),
        loss=_loss(rng),
        latency=_latency(rng),
    )


def _edges(rng: np.random.Generator) -> list[tuple[str, str]]:
    """A random tree of two to five agents, and perhaps one edge more."""
    count = int(rng.integers(2, 6))
    edges = [(str(int(rng.integers(1, late))), str(late)) for late in range(2, count + 1)]
    extra = tuple(str(end) for end in sorted(rng.choice(np.arange(1, count + 1), 2, replace=False)))
    return edges if extra in edges else [*edges, (extra[0], extra[1])]


def _faults(rng: np.random.Generator, edges: list[tuple[str, str]]) -> list[Fault]:
    """Changes of everything that shapes a promise, and pauses; on whole milliseconds, so that instants coincide."""
    faults: list[Fault] = []
    for number in range(int(rng.integers(0, 6))):
        at = int(rng.integers(0, DURATION_MS)) * MS
        until = None if rng.random() < 0.3 else at + int(rng.integers(1, 60)) * MS
        a, b = edges[rng.integers(len(edges))]
        changes = _one(
            rng,
            {"latency": _latency(rng)},
            {"rate": _rate(rng)},
            {"medium": _medium(rng)},
            {"rate": _rate(rng), "latency": _latency(rng), "loss": _loss(rng)},
            {"cut": True},
            None,
        )
        if changes is None:
            faults.append(Pause(f"t{number}", at, until or at + 20 * MS, a))
        else:
            faults.append(LinkFault(f"t{number}", at, until, ((a, b), (b, a)), changes))
    return faults


@pytest.fixture(name="drawn_plan")
def drawn_plan_fixture(plan_of: Callable[..., Plan], parameters_of: Callable[..., Any], probe: World) -> Any:
    """Draw a plan: graph, media, rates, latencies, losses, queues, phases, faults."""

    def draw(kind: type[Agent], seed: int) -> Plan:
        rng = np.random.default_rng(seed)
        edges = _edges(rng)
        media = {edge: _medium(rng) for edge in edges}
        links = {link: _settings(rng, medium) for edge, medium in media.items() for link in (edge, (edge[1], edge[0]))}
        names = {name for edge in edges for name in edge}
        phases = {name: int(rng.integers(0, 20)) * MS // 2 for name in sorted(names)}
        parameters = {name: parameters_of(_one(rng, 20.0, 30.0, 50.0), phase) for name, phase in phases.items()}
        return plan_of(
            edges,
            kind,
            links,
            _faults(rng, edges),
            DURATION_MS,
            parameters=parameters,
            compute_ns=_one(rng, 200_000, MS, 3 * MS),
            seed=seed,
            world=_one(rng, None, probe),
        )

    return draw


def _entries(batches: Mapping[Any, Batch]) -> dict[Any, list[Any]]:
    """What was written down, without the order in which frames of different links were."""

    def by_link(entries: Iterable[Any]) -> list[Any]:
        return sorted(entries, key=lambda entry: entry[0])

    return {
        life: [batch.estimates, by_link(batch.sent), by_link(batch.heard), by_link(batch.dropped), batch.events]
        for life, batch in batches.items()
    }


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("who", ["talker", "answerer"])
def test_lockstep_equals_the_twin(
    who: str, seed: int, drawn_plan: Any, twin_run: Callable[[Plan], Record], request: pytest.FixtureRequest
) -> None:
    """No promise is broken, nobody waits for ever, and every estimate and every frame's story is the twin's."""
    plan = drawn_plan(request.getfixturevalue(who), seed)
    locked, twin = Network(plan, seed).run(), twin_run(plan)
    assert _entries(locked.batches) == _entries(twin.batches)
    assert not any(batch.late for record in (locked, twin) for batch in record.batches.values())
    assert all(link.closes for link in account(locked).values())
