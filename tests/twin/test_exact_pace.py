"""Exact pace without processes: whatever network and clock do, the twin's estimates and stories come of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from volery.agents.agent import Agent
from volery.agents.journal import Batch
from volery.agents.plan import Plan
from volery.experiments.analysis.accounting import account
from volery.experiments.record.record import Record
from volery.experiments.verify import compare, replay
from volery.transport.faults import Fault, Kill, LinkFault, LinkName, Pause
from volery.transport.latency_settings import Constant
from volery.transport.links import CUT, LinkSettings
from volery.transport.media_settings import Aloha, FullDuplex, HalfDuplex, Tdma

from ..surroundings import seeds
from .network import Network
from .talking import TalkerParameters

MS = 1_000_000

SEEDS = seeds(8, 30)


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
def test_lockstep_equals_the_twin(
    who: type[Agent], seed: int, drawn_plan: Any, twin_run: Callable[[Plan], Record]
) -> None:
    """No promise is broken, nobody waits for ever, and every estimate and every frame's story is the twin's."""
    plan = drawn_plan(who, seed)
    network = Network(plan, seed, clocked=seed % 2 == 1)
    network.start()
    assert_equal(network.finish(), twin_run(plan))


@pytest.mark.parametrize("seed", range(5))
def test_frames_carry_the_promises_of_an_agent_that_acts_on_timers(seed: int, plan_of: Any, talker: Any) -> None:
    """Each frame promises as far as the next one, so that a link needs one bare promise, at the beginning."""
    names = "12345678"
    settings = LinkSettings(medium=HalfDuplex(access=Tdma(100.0, 200_000)), rate=1e6, latency=Constant(10 * MS))
    plan = plan_of(list(zip(names, names[1:] + names[0], strict=True)), talker, settings, duration_ms=1000)
    network = Network(plan, seed, clocked=seed % 2 == 1)
    network.start()
    record = network.finish()
    assert sum(len(batch.sent) for batch in record.batches.values()) > 30 * len(plan.links)
    assert sum(pacer.promises for pacer in network.pacers.values()) == len(plan.links)


@pytest.mark.parametrize("seed", [*SEEDS, 43, 82])
def test_radios_in_lockstep_equal_the_twin(
    who: type[Agent], seed: int, radio_plan: Any, twin_run: Callable[[Plan], Record]
) -> None:
    """Nobody decides on a frame from the air before everybody who could destroy it has been heard."""
    plan = radio_plan(who, seed)
    network = Network(plan, seed, clocked=seed % 2 == 1)
    network.start()
    assert_equal(network.finish(), twin_run(plan))


@pytest.mark.parametrize("seed", SEEDS)
def test_graphs_that_change_in_lockstep_equal_the_twin(
    any_plan: Callable[..., Plan],
    who: type[Agent],
    seed: int,
    come_and_go: Callable[[Plan, int], Plan],
    twin_run: Callable[[Plan], Record],
) -> None:
    """Links come and go at the same nominal instants in both, and nobody waits for one that is not there."""
    plan = come_and_go(any_plan(who, seed), seed)
    network = Network(plan, seed, clocked=seed % 2 == 1)
    network.start()
    record = network.finish()
    assert_equal(record, twin_run(plan))
    for (name, _), batch in record.batches.items():
        absent = [sent for sent in batch.sent if not plan.is_present((name, sent.target), sent.start_ns)]
        assert {sent.verdict for sent in absent} <= {CUT}


@pytest.mark.parametrize("clocked", [False, True])
def test_nobody_runs_away_from_a_slow_receiver(
    clocked: bool, plan_of: Any, talker: Any, twin_run: Callable[[Plan], Record]
) -> None:
    """A node of 100 Hz, which its receiver does not hold back, stays within a second of what that has handled."""
    plan = plan_of(["12"], talker, duration_ms=5000, parameters={"1": TalkerParameters(100.0)})
    node, listener = plan.agents
    plan = replace(plan, agents=(node, replace(listener, kind="tests.twin.talking:Listener")))
    network = Network(plan, 3, clocked=clocked)
    network.start()
    most, more = 0, True
    while more:
        ahead = network.nodes["1"].state.now_ns - network.nodes["2"].state.now_ns
        assert ahead < 1100 * MS  # a second of credit, and what the listener has heard last
        most = max(most, len(network.wire("1", "2")))
        more = network.deliver()
    assert most <= 101
    assert_equal(network.finish(), twin_run(plan))


@pytest.mark.parametrize("seed", SEEDS)
def test_live_faults_equal_the_twin(
    who: type[Agent], seed: int, drawn_plan: Any, twin_run: Callable[[Plan], Record]
) -> None:
    """A fault from outside, and its end, take effect at one instant everywhere: the twin that knew of it agrees."""
    plan = drawn_plan(who, seed)
    network = Network(plan, seed, clocked=seed % 2 == 1)
    network.start()
    rng = np.random.default_rng(seed)
    network.deliver_some(int(rng.integers(0, 60)))
    begun = network.inject(lambda at_ns: _live_fault(rng, plan, at_ns))
    network.deliver_some(int(rng.integers(0, 60)))
    ended = network.inject(lambda at_ns: replace(begun, until_ns=at_ns))
    assert_equal(network.finish(), twin_run(replace(plan, faults=(*plan.faults, ended))))


@pytest.mark.parametrize("seed", SEEDS)
def test_deaths_and_returns_equal_the_twin(
    any_plan: Callable[..., Plan],
    who: type[Agent],
    seed: int,
    mortal: Callable[[Plan, int], Plan],
    twin_run: Callable[[Plan], Record],
) -> None:
    """A dead neighbour holds back nobody but for its return, before which nothing is sent that is meant for it.

    That holds for several lives, for neighbours that are dead together, and for instants that coincide.
    """
    plan = mortal(any_plan(who, seed), seed)
    network = Network(plan, seed, clocked=seed % 2 == 1)
    network.start()
    assert_equal(network.finish(), twin_run(plan))


@pytest.mark.parametrize("seed", SEEDS)
def test_interventions_beside_the_dead_equal_the_twin(
    any_plan: Callable[..., Plan],
    seed: int,
    mortal: Callable[[Plan, int], Plan],
    answerer: type[Agent],
    twin_run: Callable[[Plan], Record],
) -> None:
    """What the dead have promised holds through live faults, also where it is still on the wire."""
    plan = mortal(any_plan(answerer, seed), seed)
    network = Network(plan, seed, clocked=seed % 2 == 1)
    network.start()
    rng = np.random.default_rng(seed)
    for number in range(3):
        network.deliver_some(int(rng.integers(0, 120)))
        if network.living():
            a, b = list(plan.links)[rng.integers(len(plan.links))]
            changes = {"latency": Constant(int(rng.integers(0, 5 * MS)))}
            network.inject(partial(_link_fault, f"l{number}", ((a, b), (b, a)), changes))
    record = network.finish()
    assert_equal(record, twin_run(record.plan))


def _link_fault(name: str, links: tuple[LinkName, ...], changes: Mapping[str, Any], at_ns: int) -> Fault:
    return LinkFault(name, at_ns, None, links, changes)


@pytest.mark.parametrize("keep_state", [False, True])
@pytest.mark.parametrize("seed", seeds(6, 12))
def test_live_kills_and_restarts_equal_the_twin(
    seed: int, keep_state: bool, drawn_plan: Any, answerer: type[Agent], twin_run: Callable[[Plan], Record]
) -> None:
    """An agent is killed from outside the plan, and brought back, with its state or without."""
    plan = drawn_plan(answerer, seed)
    network = Network(plan, seed, clocked=seed % 2 == 1)
    network.start()
    victim = plan.agents[seed % len(plan.agents)].name
    network.deliver_some(40)
    begun = network.inject(lambda at_ns: Kill("l1", at_ns, None, victim, keep_state))
    network.deliver_some(200)
    if not network.nodes[victim].state.dead:
        assert begun.at_ns >= plan.duration_ns or network.deliver_until(lambda: network.nodes[victim].state.dead)
    ended = network.inject(lambda at_ns: replace(begun, until_ns=at_ns))
    assert_equal(network.finish(), twin_run(replace(plan, faults=(*plan.faults, ended))))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("others_die", [False, True])
def test_a_death_from_outside_replays_in_the_twin(
    any_plan: Callable[..., Plan],
    others_die: bool,
    seed: int,
    mortal: Callable[[Plan, int], Plan],
    answerer: type[Agent],
) -> None:
    """Nobody waits for the dead; with what was heard of it last, the twin comes to the same estimates and stories."""
    plan = any_plan(answerer, seed)
    network = Network(mortal(plan, seed) if others_die else plan, seed, clocked=seed % 2 == 1)
    network.start()
    network.deliver_some(30 + 7 * seed)
    living = network.living()
    network.kill_from_outside(living[seed % len(living)])
    record = network.finish()
    assert list(compare(record, replay(record), 0.0)) == []
    assert all(link.closes for link in account(record).values())


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("others_die", [False, True])
def test_a_death_from_outside_between_the_phases_of_an_intervention(
    any_plan: Callable[..., Plan],
    others_die: bool,
    seed: int,
    mortal: Callable[[Plan, int], Plan],
    answerer: type[Agent],
) -> None:
    """The fault takes effect at its instant everywhere else, and the twin comes to the same estimates and stories."""
    plan = any_plan(answerer, seed)
    network = Network(mortal(plan, seed) if others_die else plan, seed, clocked=seed % 2 == 1)
    network.start()
    network.deliver_some(30 + 5 * seed)
    living = network.living()
    a, b = list(plan.links)[seed % len(plan.links)]
    fault = partial(_link_fault, "l1", ((a, b), (b, a)), {"cut": True})
    network.inject(fault, lambda: network.kill_from_outside(living[seed % len(living)]))
    network.deliver_some(60)
    if network.living():
        network.inject(partial(_link_fault, "l2", ((a, b),), {"latency": Constant(3 * MS)}))
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
