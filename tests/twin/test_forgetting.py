"""Nodes forget the transmissions that can meet no frame any more: memory is bounded, and no fate changes."""

from __future__ import annotations

import pytest

from volery.agents import receiver
from volery.agents.agent import Agent
from volery.agents.plan import Plan
from volery.experiments.record.record import Collector, Record
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import Twin

from .network import Network

AIR = "links={medium: {kind: half-duplex, per: node, access: aloha}, rate: 50 kbit/s, latency: %s}"
EDGES = "links={medium: {kind: half-duplex, per: edge, access: aloha}, rate: 50 kbit/s, latency: %s}"
SENSED = "links={medium: {kind: half-duplex, per: node, access: csma}, rate: 50 kbit/s, latency: %s}"
SPREAD = "{uniform: {low: 1 ms, high: 400 ms}}"
HELD = "faults=[{at: 1 s, for: 3 s, hold: all}, {at: 5 s, for: 1 s, pause: 2}, {at: 6 s, until: 7 s, kill: 3}]"
CROWD = "agents={kind: beacon, rate: 40 Hz, size: 40 B, pattern: poisson, broadcast: true, talkers: %s}"


def plan(*changes: str) -> Plan:
    """Four beacons, each in reach of all others."""
    return load_scenario("beacons", ["topology={complete: 4}", "overload=true", *changes]).plan


def run(of: Plan) -> tuple[Record, Twin]:
    """A run, and the twin at its end."""
    collector = Collector()
    twin = Twin(of, collector)
    twin.run()
    return collector.record(of), twin


def remembered(twin: Twin) -> int:
    """How many transmissions the node that remembers most has in mind."""
    return max(
        len(node.receiver.ether) + sum(len(outlet.transceiver) for outlet in node.sender.outlets.values())
        for node in twin.nodes.values()
    )


@pytest.mark.parametrize("medium", [AIR, EDGES, SENSED])
@pytest.mark.parametrize("faults", ["faults=[]", HELD])
def test_what_is_forgotten_changes_no_fate(medium: str, faults: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames of 1 to 400 ms, held ones and those of another life meet just what they meet where all is remembered."""
    of = plan(CROWD % "all", medium % SPREAD, "duration=10 s", faults)
    monkeypatch.setattr(receiver, "TIDY_EVERY", 10**9)
    full, all_of_it = run(of)
    monkeypatch.setattr(receiver, "TIDY_EVERY", 3)
    forgetful, some = run(of)
    assert {key: batch.heard for key, batch in forgetful.batches.items()} == {
        key: batch.heard for key, batch in full.batches.items()
    }
    assert remembered(some) < 200 < remembered(all_of_it)


@pytest.mark.parametrize("talkers", ["all", "[1]"])
def test_memory_stays_bounded_over_a_long_run(talkers: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight times as long, as much is remembered in the end, also by who never hears anybody."""
    monkeypatch.setattr(receiver, "TIDY_EVERY", 16)
    changes = CROWD % talkers, AIR % "5 ms"
    counts = [remembered(run(plan(*changes, f"duration={seconds} s"))[1]) for seconds in (10, 80)]
    assert max(counts) <= 16 + 4 * 3


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("kind", ["drawn_plan", "radio_plan"])
def test_in_lockstep_promises_say_what_can_be_forgotten(
    kind: str, seed: int, answerer: type[Agent], request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the network delivers first, each frame meets what it meets in the twin that remembers everything."""
    of = request.getfixturevalue(kind)(answerer, seed)
    monkeypatch.setattr(receiver, "TIDY_EVERY", 10**9)
    full, _ = run(of)
    monkeypatch.setattr(receiver, "TIDY_EVERY", 1)
    network = Network(of, seed)
    network.start()
    locked = network.finish()
    for key, batch in full.batches.items():
        assert sorted(locked.batches[key].heard) == sorted(batch.heard)
