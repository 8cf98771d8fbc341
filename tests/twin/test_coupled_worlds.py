"""Closed loops: what agents do moves the world, and what they see comes of it, in every engine alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from volery.agents.agent import Agent
from volery.agents.coupled_world import couple
from volery.agents.journal import MISSED, Late
from volery.agents.plan import WORLD, Plan
from volery.agents.sensor_samples import Disturbances, measured
from volery.errors import BadInput, RunFailed
from volery.experiments.analysis.metrics import compute_metrics
from volery.experiments.record.evaluation_pass import evaluated
from volery.experiments.record.record import Record
from volery.experiments.record.samples import samples
from volery.experiments.verify import compare, replay
from volery.transport.faults import Kill, LinkFault, Pause, SensorFault
from volery.transport.frames import Frame
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings
from volery.transport.loss_settings import Bernoulli

from ..surroundings import seeds
from .carts import CartWorld, Driver, SteadyDriver
from .network import Network
from .test_exact_pace import assert_equal

MS = 1_000_000
Twin = Callable[[Plan], Record]
RING = [("1", "2"), ("2", "3"), ("3", "1")]


class Pusher(Agent):
    """Pushes whatever there is."""

    def start(self) -> None:
        """At once."""
        self.context.command({"push": [1.0]})


class Line:
    """A world that goes its own way, with a gauge that sees nothing once."""

    def sensors(self, agent: str) -> dict[str, float]:
        """The gauge."""
        return {"gauge": 50.0}

    def measure(self, agent: str, sensor: str, index: int) -> Any:
        """By the index."""
        return None if index == 7 else np.array([index * 0.1, -index])

    def truth(self, time_ns: int) -> Any:
        """Nothing true here."""
        return np.zeros(2)


@pytest.fixture
def loop(plan_of: Any) -> Callable[..., Plan]:
    """Three carts on lossy links."""

    def make(kind: type[Agent] = Driver, duration_ms: int = 600, seed: int = 3, **world: Any) -> Plan:
        settings = LinkSettings(latency=Constant(2 * MS), loss=(Bernoulli(0.3),))
        plan: Plan = plan_of(RING, kind, settings, duration_ms=duration_ms, seed=seed)
        return couple(replace(plan, coupled=CartWorld(("1", "2", "3"), seed, **world)))

    return make


def test_commands_move_the_world_after_their_delays(loop: Callable[..., Plan], twin_run: Twin) -> None:
    """Seen at 0, told at the sense delay, pushed one compute time and the act delay later, and no earlier."""
    record = twin_run(loop(noise=0.0))
    pushed = [note["time_ns"] for note in record.notes if note["what"] == "pushed" and note["cart"] == "1"]
    compute_ns = record.plan.agents[0].compute_ns
    assert pushed[:2] == [4 * MS + compute_ns + 3 * MS, 24 * MS + compute_ns + 3 * MS]
    places = record.world_reports["places"]
    assert places.time_ns[:3].tolist() == [0, 40 * MS, 80 * MS]
    assert places.value[0].tolist() == [1.0, 2.0, 3.0]
    gap = places.value[:, 2] - places.value[:, 0]
    assert gap[-1] < gap[0] - 0.05


def test_truth_is_the_worlds_and_the_central_estimator_has_samples_and_commands(
    loop: Callable[..., Plan], twin_run: Twin
) -> None:
    """Estimates stand beside the true places of the same index, and beside what the central_estimator knew then."""
    record = twin_run(loop())
    assert record.quantities() == ("places",)
    seen = samples(record, "places")
    assert seen.agents == ("1", "2", "3")
    index = {sample: row for row, sample in enumerate(record.world_reports["places"].sample.tolist())}
    rows = [index[sample] for sample in seen.index.tolist()]
    for agent in range(3):
        np.testing.assert_array_equal(seen.truth[:, agent], record.world_reports["places"].value[rows])
    own = seen.estimate[:, [0, 1, 2], [0, 1, 2]]
    np.testing.assert_array_equal(own, seen.oracle[:, 0, :])
    pushes = [(push.time_ns, push.agent) for push in record.batches[WORLD, 0].commands]
    noted = [(note["time_ns"], note["cart"]) for note in record.notes if note["what"] == "pushed"]
    assert 0 < len(noted) <= len(pushes)
    assert pushes[: len(noted)] == noted
    assert [finding.value for finding in record.evaluated.findings] == [len(pushes)]


@pytest.mark.parametrize("seed", seeds(6, 12))
@pytest.mark.parametrize("kind", [Driver, SteadyDriver])
def test_closed_loops_in_lockstep_equal_the_twin(
    kind: type[Agent], seed: int, loop: Callable[..., Plan], twin_run: Twin
) -> None:
    """The world waits for commands and the agents for samples, and nobody waits for ever."""
    plan = loop(kind, 300, seed)
    network = Network(plan, seed)
    network.start()
    locked, twin = network.finish(), twin_run(plan)
    assert_equal(locked, twin)
    assert len(twin.batches[WORLD, 0].estimates) > 20


@pytest.mark.parametrize("seed", range(8))
def test_faults_in_closed_loops(seed: int, loop: Callable[..., Plan], twin_run: Twin) -> None:
    """Deaths, returns, pauses, cuts and sensor faults, in lockstep as in the twin; the others go on."""
    faults = (
        Kill("k", 90 * MS, 180 * MS, "2"),
        Pause("p", 60 * MS, 110 * MS, "1"),
        LinkFault("c", 50 * MS, 130 * MS, (("1", "3"), ("3", "1")), {"cut": True}),
        SensorFault("s", 40 * MS, 150 * MS, "3", "gauge", "stuck"),
        SensorFault("b", 100 * MS, 200 * MS, "1", "gauge", "bias", (0.5,)),
    )
    plan = replace(loop(duration_ms=300, seed=seed), faults=faults)
    network = Network(plan, seed)
    network.start()
    assert_equal(network.finish(), twin_run(plan))


@pytest.mark.parametrize("seed", range(6))
def test_live_faults_in_closed_loops(seed: int, loop: Callable[..., Plan]) -> None:
    """A sensor fault that is injected while the swarm runs reaches the world, and the replay is the same."""
    network = Network(loop(duration_ms=300, seed=seed), seed)
    network.start()
    network.deliver_some(100)
    network.inject(lambda at_ns: SensorFault("live", at_ns, None, "2", "gauge", "bias", (5.0,)))
    record = evaluated(network.finish())
    assert list(compare(record, replay(record), 0.0)) == []
    own = samples(record, "places").estimate[:, 1, 1]
    assert own.max() > 5.0


def test_a_world_goes_on_when_everybody_is_dead(loop: Callable[..., Plan], twin_run: Twin) -> None:
    """The truth is written down to the end."""
    faults = tuple(Kill(f"k{name}", 100 * MS, None, name) for name in "123")
    record = twin_run(replace(loop(duration_ms=400), faults=faults))
    assert record.world_reports["places"].time_ns[-1] == 360 * MS


def test_samples_of_closed_loops_suffer_the_same_faults(loop: Callable[..., Plan]) -> None:
    """Taken once in the order of their times, or as functions of their index: faults make the same of them."""
    faults = (
        SensorFault("a", 100 * MS, 400 * MS, "1", "gauge", "bias", (1.0,)),
        SensorFault("b", 200 * MS, 350 * MS, "1", "gauge", "stuck"),
        SensorFault("c", 250 * MS, 500 * MS, "1", "gauge", "noise", (0.1, 0.2)),
        SensorFault("d", 260 * MS, 300 * MS, "1", "gauge", "failed"),
        SensorFault("e", 120 * MS, 180 * MS, "2", "gauge", "failed"),
        SensorFault("f", 420 * MS, 480 * MS, "1", "gauge", "spikes", (3.0,), 0.5),
    )
    world = Line()
    plan = replace(loop(), world=world, faults=faults)
    disturbances = Disturbances(plan.seed)
    for index in range(40):
        raw = world.measure("1", "gauge", index)
        mine = disturbances.disturbed(faults, "1", "gauge", index, index * 20 * MS, raw)
        expected = measured(plan, faults, "1", "gauge", index)
        assert (mine is None) == (expected is None), index
        np.testing.assert_array_equal(mine, expected)


def test_faults_leave_alone_what_a_row_is_of() -> None:
    """Of samples with a row for each thing seen, whatever is wrong with the sensor, the first column stays."""
    seen = np.array([[2.0, 0.5, 0.5], [7.0, 1.0, 1.0]])
    for trouble, size in (("bias", (1.0,)), ("noise", (1.0, 2.0)), ("spikes", (3.0,))):
        fault = SensorFault("f", 0, None, "1", "eye", trouble, size)  # type: ignore[arg-type]
        mine = Disturbances(7).disturbed((fault,), "1", "eye", 0, 0, seen)
        assert mine is not None
        assert mine[:, 0].tolist() == [2.0, 7.0]
        assert np.all(mine[:, 1:] != seen[:, 1:])
        assert seen.tolist() == [[2.0, 0.5, 0.5], [7.0, 1.0, 1.0]]


def test_a_late_command_counts_as_late_and_is_no_frame_of_a_link(loop: Callable[..., Plan], twin_run: Twin) -> None:
    """By the wall clock wires may be late as links are: the verdict says so, and no table has a link to the world."""
    record = twin_run(loop(duration_ms=200))
    record.batches[WORLD, 0].late.append(Late("1", 0, 3, 68 * MS, 5 * MS))
    metrics = compute_metrics(record)
    assert (metrics.fidelity.late, metrics.fidelity.frames.max_ns) == (1, 5 * MS)
    assert "1 late frames (1 of them between agents and their world)" in metrics.fidelity.verdict
    assert set(metrics.links) == {">".join(link) for link in record.links()}
    assert all(link.account.late == 0 for link in metrics.links.values())


def test_what_the_middleware_loses_on_a_wire_is_noticed(loop: Callable[..., Plan]) -> None:
    """Nobody else tells of samples and commands: their receiver counts them."""
    network = Network(loop(duration_ms=300), 1)
    node = network.nodes["1"]
    network.start()
    first = next(message for message in network.wire(WORLD, "1") if isinstance(message, Frame))
    for sent in (1, 2, 5):
        node.receiver.receive(WORLD, first._replace(sequence=sent - 1, sent=sent))
    missed = [event for event in node.state.journal.events if event["event"] == MISSED]
    assert [(event["source"], event["count"]) for event in missed] == [(WORLD, 2)]


def test_commands_need_a_world_that_takes_them(plan_of: Any, twin_run: Twin) -> None:
    """Who commands where nothing can be commanded is told so."""
    with pytest.raises(RunFailed, match=r"agent 1 failed in .*: command: push for a world that takes no commands"):
        twin_run(plan_of(RING, Pusher, LinkSettings(latency=Constant(MS))))


def test_no_agent_may_be_called_as_the_world(plan_of: Any) -> None:
    """Its name is taken."""
    plan = plan_of([("1", "2")], Driver, LinkSettings(latency=Constant(MS)))
    plan = replace(plan, agents=(plan.agents[0], replace(plan.agents[1], name="world")))
    with pytest.raises(BadInput, match="call it something else"):
        couple(replace(plan, coupled=CartWorld(("1", "world"))))
