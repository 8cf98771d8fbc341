"""Metrics of runs whose errors are known in closed form."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from io import StringIO
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from volery.agents.journal import Batch, Estimate, Late, Sent
from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.analysis.fidelity import Lateness
from volery.experiments.analysis.metrics import Metrics, compute_metrics, contraction
from volery.experiments.cli.metric_tables import metrics_tables
from volery.experiments.record.record import Record
from volery.experiments.record.samples import samples
from volery.experiments.scenario.fault_labels import fault_label
from volery.transport.faults import ClockFault, Hog, Kill, LinkFault, Pause, SensorFault
from volery.transport.latency_settings import Normal
from volery.transport.loss_settings import Bernoulli, GilbertElliott

MS = 1_000_000
Make = Callable[..., Any]
MEAN = 1.5
"""What the oracle of agents 1 and 2 says, with the opposite sign in the second component."""


def printed(metrics: Metrics) -> str:
    """The tables as text."""
    out = StringIO()
    Console(width=140, file=out).print(*metrics_tables(metrics))
    return out.getvalue()


def decaying(agent: str, sign: float) -> Batch:
    """Twenty reports, one each 50 ms, that differ from the oracle by ±0.5^k in the first component."""
    batch = Batch(agent, 0)
    for index in range(20):
        batch.estimates.append(Estimate(50 * MS * index, "estimate", index, [MEAN + sign * 0.5**index, -MEAN]))
    return batch


def test_metrics_of_estimates_that_diverged_are_written(record_of: Make) -> None:
    """What is infinite is a text in JSON, which has no infinity; what is not defined is null."""
    record = record_of(Batch("1", 0, [Estimate(0, "estimate", 0, [math.inf, 0.0])]))
    error = json.loads(compute_metrics(record).to_json())["quantities"]["estimate"]["truth_error"]
    assert error["final"] == "inf"
    assert json.loads(compute_metrics(record_of(decaying("1", 1))).to_json())["wall_s"] is None


def test_errors_of_a_known_course(record_of: Make) -> None:
    """Two agents at ±0.5^k about the oracle: disagreement and error are 0.5^k, the truth is one off."""
    metrics = compute_metrics(record_of(decaying("1", 1), decaying("2", -1)), threshold=0.1)
    found = metrics.quantities["estimate"]
    steady = 0.5 ** np.arange(15, 20)  # from 0.75 s on
    assert (found.agents, found.samples) == (2, 20)
    for one in (found.disagreement, found.oracle_error):
        assert one.steady_rms == pytest.approx(math.sqrt(np.mean(steady**2)))
        assert one.final == pytest.approx(0.5**19)
        assert one.convergence_s == 0.2  # 0.5⁴ is the first that is at most 0.1
    assert found.truth_error.steady_rms == pytest.approx(math.sqrt(np.mean(1 + steady**2)))
    assert math.isnan(found.truth_error.convergence_s)
    assert math.isnan(found.contraction)


def test_components_are_in_their_units(record_of: Make) -> None:
    """The labels of the agents' class name the components and scale them."""
    altitude, roll = compute_metrics(record_of(decaying("1", 1), decaying("2", -1))).quantities["estimate"].components
    assert (altitude.name, altitude.unit, roll.name, roll.unit) == ("altitude", "mm", "roll", "deg")
    assert altitude.oracle_rms == pytest.approx(1e3 * math.sqrt(np.mean(0.25 ** np.arange(15, 20))))
    assert (roll.oracle_rms, roll.truth_rms) == (0.0, 0.0)


def test_recovery_after_a_fault(record_of: Make) -> None:
    """The time from the end of the cut until the error is back within three times its median of the second before."""
    cut = LinkFault("t1", 200 * MS, 201 * MS, (("1", "2"), ("2", "1")), {"cut": True})
    batches = [Batch(name, 0) for name in ("1", "2")]
    for batch in batches:
        errors = [0.1] * 4 + [1.0] * 3 + [0.2] * 13
        batch.estimates = [Estimate(50 * MS * k, "estimate", k, [MEAN + e, -MEAN]) for k, e in enumerate(errors)]
    (recovery,) = compute_metrics(record_of(*batches, faults=(cut,))).quantities["estimate"].recoveries
    assert (recovery.fault, recovery.label, recovery.of) == ("t1", "cut all", "error to oracle")
    assert recovery.threshold == pytest.approx(0.3)
    assert recovery.recovery_s == 0.149  # small again at 350 ms, the cut ended at 201 ms


@pytest.mark.parametrize(("back", "recovery_s"), [(True, 0.0), (False, math.nan)])
def test_an_agent_that_never_comes_back_has_not_recovered(record_of: Make, *, back: bool, recovery_s: float) -> None:
    """However well the others estimate: a kill has recovered where its agent has reported again."""
    kill = Kill("t1", 200 * MS, 300 * MS, "2")
    batches = [Batch(name, 0) for name in ("1", "2")]
    for batch in batches:
        batch.estimates = [Estimate(50 * MS * k, "estimate", k, [MEAN + 0.1, -MEAN]) for k in range(20)]
    if not back:
        batches[1].estimates = batches[1].estimates[:4]
    (recovery,) = compute_metrics(record_of(*batches, faults=(kill,))).quantities["estimate"].recoveries
    assert recovery.recovery_s == pytest.approx(recovery_s, nan_ok=True)


def test_what_is_not_defined_is_nan_and_null(record_of: Make) -> None:
    """A quantity without oracle and truth, from one agent alone, has no errors and no disagreement."""
    record: Record = record_of(Batch("1", 0, [Estimate(0, "own", 0, [1.0])]))
    metrics = compute_metrics(record)
    found = metrics.quantities["own"]
    for one in (found.disagreement, found.oracle_error, found.truth_error):
        assert all(map(math.isnan, (one.steady_rms, one.final, one.threshold, one.convergence_s, one.ise)))
    data = json.loads(metrics.to_json())
    assert data["quantities"]["own"]["oracle_error"]["final"] is None
    assert data["links"]["1>2"]["account"]["latency_ns"] == [None, None, None]


def test_contraction_of_rounds(record_of: Make) -> None:
    """A quantity reported after each round of a consensus shows its factor, up to where rounding is the floor."""
    batches = [Batch(name, 0) for name in ("1", "2")]
    for batch, sign in zip(batches, (1, -1), strict=True):
        reports = ((k, sign * 0.25**k) for k in range(30))
        batch.estimates = [Estimate(k * MS, "estimate/round", k, [value]) for k, value in reports]
    found = compute_metrics(record_of(*batches)).quantities["estimate/round"]
    assert found.contraction == pytest.approx(0.25, rel=1e-9)


def test_contraction_is_measured_within_a_consensus(record_of: Make) -> None:
    """Where each sample starts a consensus anew, told by its oracle, the jumps between them do not count."""
    batches = [Batch(name, 0) for name in ("1", "2")]
    for batch, sign in zip(batches, (1, -1), strict=True):
        batch.estimates = [Estimate(k * MS, "estimate/round", k, [sign * 0.5 ** (k % 3)]) for k in range(30)]
    record = record_of(*batches)
    assert compute_metrics(record).quantities["estimate/round"].contraction != pytest.approx(0.5, abs=0.1)
    seen = samples(record, "estimate/round")
    restarts = dataclasses.replace(
        seen, oracle=np.zeros_like(seen.oracle) + (seen.index // 3)[:, np.newaxis, np.newaxis]
    )
    assert contraction(restarts) == pytest.approx(0.5)


def test_reports_without_numbers_are_held(record_of: Make) -> None:
    """Agents that number nothing are compared at every instant with what each said last, but not while it is down."""
    first = Batch("1", 0, [Estimate(t * MS, "x", 0, [float(t)]) for t in (0, 30)])
    second = Batch("2", 0, [Estimate(t * MS, "x", 0, [float(t)]) for t in (10, 20)])
    seen = samples(record_of(first, second, faults=(Kill("t1", 25 * MS, None, "2"),)), "x")
    assert seen.time_ns.tolist() == [0, 10 * MS, 20 * MS, 30 * MS]
    nan = math.nan
    np.testing.assert_array_equal(seen.estimate[:, :, 0], [[0, nan], [0, 10], [0, 20], [30, nan]])


def test_last_report_of_a_sample_counts(record_of: Make) -> None:
    """Several reports for one sample are several rounds: the last stands; a sample that an agent missed is NaN."""
    first = Batch("1", 0, [Estimate(1, "x", 0, [1.0]), Estimate(2, "x", 0, [2.0]), Estimate(5, "x", 1, [3.0])])
    second = Batch("2", 0, [Estimate(4, "x", 0, [4.0])])
    seen = samples(record_of(first, second), "x")
    assert (seen.agents, seen.index.tolist(), seen.time_ns.tolist()) == (("1", "2"), [0, 1], [4, 5])
    np.testing.assert_array_equal(seen.estimate[:, :, 0], [[2.0, 4.0], [3.0, math.nan]])


def test_reference_of_another_length_is_an_error(record_of: Make) -> None:
    """The message names the agent and both lengths."""
    with pytest.raises(BadInput, match=r"agent 1: the truth of 'estimate' has 2 components, the agents report 1"):
        samples(record_of(Batch("1", 0, [Estimate(0, "estimate", 0, [1.0])])), "estimate")


def test_verdict_names_every_flaw(record_of: Make) -> None:
    """Late frames, missing frames and agents that died unasked stand in the verdict; a good run says so."""
    good = compute_metrics(record_of(Batch("1", 0))).fidelity
    assert good.verdict == "as asked: no late frame, none lost by the middleware, no link outside its bounds"
    assert good.as_asked
    died = {"event": "died", "agent": "2", "incarnation": 0, "time_ns": 0, "cause": "was killed from outside"}
    late = Batch("2", 0, late=[Late("1", 0, 1, 0, 4 * MS)])
    late_fault = {"event": "late-fault", "time_ns": 0, "id": "f1"}
    found = compute_metrics(
        record_of(Batch("1", 0, [], [Sent("2", 1, 1, 0, 0, 5 * MS, "loss")]), late, events=[died, late_fault])
    ).fidelity
    assert found.verdict == (
        "not as asked: 1 late frames, by 4.0 ms at most; 1 frames lost by the middleware; "
        "1 faults that reached an agent late; died unasked: agent 2; "
        "loss of 1→2: 0 % asked, 100 % got, exactly that allowed"
    )
    assert not found.as_asked
    assert (found.frames.max_ns, found.broken_off, found.late_faults) == (4 * MS, ("2",), 1)


def test_lateness_of_timers_is_that_of_the_worst_agent(record_of: Make) -> None:
    """Each quantile on its own; agents of which nobody knows it are left aside."""
    done = {"event": "done", "cpu_s": 0.1, "pss_kb": 1}
    first = Batch("1", 0, events=[{**done, "lateness_ns": [10, 20, 90]}])
    second = Batch("2", 0, events=[{**done, "lateness_ns": [15, 16, 17]}])
    silent = Batch("2", 1, events=[{**done, "lateness_ns": []}])
    assert compute_metrics(record_of(first, second, silent)).fidelity.timers == Lateness(15.0, 20.0, 90.0)


def test_speed_relative_to_real_time(record_of: Make) -> None:
    """One nominal second in a quarter of a second is four times real time; it stands under the verdict."""
    record = dataclasses.replace(record_of(Batch("1", 0)), info={"wall_s": 0.25})
    metrics = compute_metrics(record)
    assert metrics.times_real_time == 4.0
    assert "speed: 1.0 s of the run took 0.2 s, 4.0 × real time" in printed(metrics)
    assert math.isnan(compute_metrics(record_of(Batch("1", 0))).times_real_time)


@pytest.mark.parametrize(
    ("fault", "label"),
    [
        (LinkFault("a", 0, 1, (("3", "7"), ("7", "3")), {"cut": True}), "cut 3–7"),
        (LinkFault("a", 0, 1, (("10", "2"),), {"cut": True}), "cut 10→2"),
        (LinkFault("a", 0, 1, (("1", "2"),) * 4, {"loss": (Bernoulli(0.5),)}), "loss 0.5 all"),
        (LinkFault("a", 0, 1, (("1", "2"),), {"loss": ()}), "loss none 1→2"),
        (LinkFault("a", 0, 1, (("1", "2"),), {"loss": (GilbertElliott(0.1, 0.3),)}), "loss 0.1, 0.3 1→2"),
        (LinkFault("a", 0, 1, (("1", "2"),), {"latency": Normal(2 * MS, MS // 2)}), "latency 2 ms, 0.5 ms 1→2"),
        (LinkFault("a", 0, 1, (("1", "2"), ("1", "3"), ("1", "4")), {"rate": 9600.0}), "rate 9.6 kbit/s 3 links"),
        (Kill("a", 0, 1, "5"), "kill 5"),
        (LinkFault("a", 0, 1, (("1", "2"),), {"hold": True}), "hold 1→2"),
        (LinkFault("a", 0, 1, (("1", "2"),), {"cut": False}), "no cut 1→2"),
        (Kill("a", 0, 1, "5", keep_state=True), "kill 5, state kept"),
        (Pause("a", 0, 1, "5"), "pause 5"),
        (Hog("a", 0, 1, "5", 0.5), "hog 5 50%"),
        (ClockFault("a", 0, 1, "5", -20 * MS, 50_000), "clock 5 -20 ms, +50 ppm"),
        (ClockFault("a", 0, 1, "5", 0, -200), "clock 5 -0.2 ppm"),
        (SensorFault("a", 0, 1, "5", "distance", "failed"), "5.distance failed"),
        (SensorFault("a", 0, 1, "5", "gyro", "bias", (0.1, 0.0)), "5.gyro bias 0.1, 0"),
        (SensorFault("a", 0, 1, "5", "gyro", "spikes", (2.0,), 0.1), "5.gyro spikes 2, 0.1 of samples"),
    ],
)
def test_faults_have_short_names(fault: Any, label: str) -> None:
    """What and where, as a person would write it."""
    assert fault_label(fault, 4) == label


def test_tables_say_what_matters(plan_of: Make, twin_run: Callable[[Plan], Record]) -> None:
    """The tables name components, faults, fates and the closing of the sum."""
    faults = (LinkFault("t1", 300 * MS, 400 * MS, (("1", "2"), ("2", "1")), {"cut": True}),)
    said = printed(compute_metrics(twin_run(plan_of([("1", "2"), ("2", "3")], faults=faults))))
    for words in (
        "altitude",
        "roll",
        "cut 1–2",
        "lost (cut)",
        "the sum of frames closes on every link",
        "as asked",
        "1→2",
        "Age of information, the oldest 4 of 4",
        "Busiest media, 4 of 4",
        "latency of the links, asked against got: 4 within the bounds",
    ):
        assert words in said
