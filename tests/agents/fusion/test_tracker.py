"""Agents that fuse what they measure by a distributed filter, run in the twin."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.agents import payloads
from volery.agents.fusion.tracker import Tracker
from volery.errors import BadInput
from volery.estimators.distributed.filtering import Filter
from volery.estimators.distributed.gaussian import Gaussian, corrected
from volery.experiments.analysis.metrics import Metrics, compute_metrics
from volery.experiments.evaluation.evaluation import Finding
from volery.experiments.record.record import Record
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded

SCENARIO: dict[str, Any] = {
    "name": "tracking",
    "seed": 3,
    "duration": "10 s",
    "topology": {"complete": 5},
    "agents": {"kind": "tracker", "payload": "float64"},
    "world": {"kind": "target"},
    "links": {"latency": "20 ms"},
}


def run(*overrides: str) -> Record:
    """The record of the scenario with these overrides."""
    plan = load_scenario(SCENARIO, overrides).plan
    return recorded(plan)


def means(record: Record) -> dict[str, NDArray[np.float64]]:
    """Agent → what it reported, a row a sample."""
    return {agent: series.value for agent, series in record.estimates("estimate").items()}


def found(metrics: Metrics) -> dict[str, Finding]:
    """The findings by name."""
    return {finding.name: finding for finding in metrics.findings}


@pytest.mark.parametrize("name", ["hybrid", "kalman-consensus-2009", "consensus-on-measurements/push-sum"])
def test_on_the_complete_graph_each_agent_is_the_centralised_filter(name: str) -> None:
    """To rounding: the oracle is the Kalman filter on all measurements of the same samples."""
    record = run(f"agents.filter={name}")
    metrics = compute_metrics(record)
    quantity = metrics.quantities["estimate"]
    assert (quantity.agents, quantity.samples) == (5, 19)
    assert quantity.oracle_error.steady_rms < 1e-6
    assert quantity.truth_error.steady_rms > 0.1
    findings = found(metrics)
    assert findings["ANEES"].value == pytest.approx(findings["ANEES, centralised"].value, rel=1e-6)
    assert findings["position error"].value == pytest.approx(findings["position error, centralised"].value, rel=1e-6)
    assert findings["position error"].unit == "m"


def test_the_anees_is_that_of_the_reported_means_and_covariances() -> None:
    """Worked out by hand, after a quarter of the run."""
    record = run("agents.filter=consensus-on-information")
    world: Any = record.plan.world
    values = []
    for agent, series in record.estimates("estimate").items():
        stated = record.estimates("covariance")[agent].value
        for sample, mean, upper in zip(series.sample.tolist(), series.value, stated, strict=True):
            if sample / 2 >= 2.5:
                matrix = np.zeros((4, 4))
                matrix[np.triu_indices(4)] = upper
                matrix = matrix + matrix.T - np.diag(np.diag(matrix))
                apart = mean - world.state(sample)
                values.append(apart @ np.linalg.solve(matrix, apart) / 4)
    assert found(compute_metrics(record))["ANEES"].value == pytest.approx(np.mean(values))


def test_the_covariance_is_no_estimate_that_has_errors() -> None:
    """It is reported aside."""
    assert set(compute_metrics(run("duration=3 s")).quantities) == {"estimate"}


def test_frames_carry_the_filter_s_numbers_and_no_more() -> None:
    """Sample, round, and 14 numbers of a pair: in float32 half of the bytes, and what is said beforehand is true."""
    sizes = {}
    for precision in ("float32", "float64"):
        record = run("agents.filter=consensus-on-information", f"agents.payload={precision}", "duration=3 s")
        told = {one.size for batch in record.batches.values() for one in batch.sent}
        vector = np.zeros(14)
        assert max(told) <= len(payloads.encode([65535, 3, vector], precision))
        offer = Tracker.offers(record.plan, "1")
        assert offer.per_second == 6.0
        sizes[precision] = offer.largest_payload or 0
    assert sizes["float64"] - sizes["float32"] == 14 * 4


def test_messages_that_are_samples_late_are_run_forward() -> None:
    """Latency of two samples and more: run forward, messages keep the error small; dropped or forgotten they do not."""
    late = ("links.latency=1.1 s", "topology={ring: 6}", "agents.filter=consensus-on-information", "duration=20 s")
    forward = found(compute_metrics(run(*late)))["position error"].value
    dropped = found(compute_metrics(run(*late, "agents.late=drop")))["position error"].value
    forgotten = found(compute_metrics(run(*late, "agents.memory=1")))["position error"].value
    assert forward < 0.5 * dropped
    assert forgotten == dropped


def test_an_agent_that_returns_begins_anew_and_is_soon_as_good_as_the_others() -> None:
    """Killed at 3 s, back at 5 s: reports go on, and the error to the centralised filter is theirs again."""
    record = run("faults=[{at: 3 s, until: 5 s, kill: 2}]", "duration=20 s", "agents.filter=hybrid-contributions")
    series = record.estimates("estimate")["2"]
    assert not {7, 8, 9} & set(series.sample.tolist())
    assert series.sample.tolist()[-1] == 38
    assert np.abs(series.value - record.central("estimate")["2"])[-1].max() < 1e-3


def test_the_graph_may_change_under_metropolis_weights() -> None:
    """A ring becomes a line: everybody still follows; weights of the whole graph are refused."""
    topology = "topology={schedule: [{from: 0 s, ring: 6}, {from: 4 s, line: 6}]}"
    metrics = compute_metrics(run(topology, "agents.filter=hybrid-contributions"))
    assert metrics.quantities["estimate"].oracle_error.steady_rms < 2.0
    with pytest.raises(BadInput, match="constant-edge weights are worked out for one graph, and this one changes"):
        run(topology, "agents.filter=hybrid/constant-edge")


def test_a_model_that_is_wrong_is_the_agents_own_business() -> None:
    """Taking noise for a tenth of what it is makes the covariance lie, and the oracle's with it."""
    findings = found(compute_metrics(run("agents.noise=0.2 m", "agents.filter=hybrid")))
    assert findings["ANEES"].value > 5
    assert findings["ANEES, centralised"].value > 5


def test_a_filter_that_diverges_says_so_and_is_infinite() -> None:
    """It is noted once an agent, and what it reports from then on is no estimate."""
    record = run(f"agents.filter={__name__}:Runaway", "duration=20 s")
    metrics = compute_metrics(record)
    assert found(metrics)["noted: diverged"].value == 5
    assert all(np.isinf(values[-1]).all() for values in means(record).values())
    assert found(metrics)["position error"].value == np.inf


class Runaway(Filter):
    """Ten times farther with every sample."""

    def end(self) -> Gaussian:
        """Away."""
        self.belief = Gaussian(10 * self.belief.mean + 1, self.belief.covariance)
        return self.belief


class Shouting(Filter):
    """A filter of ones own, by its module."""

    def message(self, target: str) -> NDArray[np.float64]:
        """How loud."""
        return np.ones(3)

    def end(self) -> Gaussian:
        """As if alone."""
        self.belief = corrected(self.belief, [self.measured()])
        return self.belief


def test_a_filter_of_ones_own_runs_by_its_module() -> None:
    """Its estimates are those of the local filter, and its messages are on the air."""
    own, local = run(f"agents.filter={__name__}:Shouting"), run("agents.filter=local")
    for agent, values in means(own).items():
        np.testing.assert_array_equal(values, means(local)[agent])
    assert Tracker.offers(own.plan, "1").per_second == 6.0
    assert Tracker.offers(local.plan, "1").per_second == 0.0


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("agents.filter=locale", "did you mean 'local'"),
        ("agents.filter=hybrid/mean", "averaging 'mean' is not known"),
        ("agents.rounds=0", "rounds is 0, at least 1 is needed"),
        ("agents.memory=0", "memory is 0"),
        (
            "agents={kind: tracker, late: drop, memory: 4}",
            "memory is 4, and late is drop, so no message is run forward",
        ),
        ("agents.payload=float16", "payload is float16"),
        ("agents.noise=0 m", "noise is 0"),
        ("agents={kind: tracker, options: {gain: 1}}", "has no option 'gain'"),
        ("agents={kind: tracker, filter: kalman-consensus-2007, options: {gain: -1}}", "gain is -1"),
        ("world={kind: moving, circle: {radius: 1 m, period: 9 s}}", "tracker needs a target"),
        ("agents={kind: tracker, only: [{where: 1, kind: tracker, rounds: 2}]}", "are all alike"),
    ],
)
def test_bad_input_is_refused(override: str, message: str) -> None:
    """With the remedy."""
    with pytest.raises(BadInput, match=re.escape(message)):
        run(override)
