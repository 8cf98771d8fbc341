"""Links are held to their settings: what is as asked is within its bounds, and what is not is found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from volery.agents.journal import Arrived, Batch, Heard, Sent
from volery.agents.plan import Plan
from volery.experiments.analysis.accounting import airtime_utilisation
from volery.experiments.analysis.metrics import compute_metrics
from volery.experiments.evaluation.comparisons import Channel
from volery.experiments.record.channels import channels
from volery.experiments.record.frame_fates import frame_fates
from volery.experiments.record.record import Collector, Record
from volery.transport.faults import LinkFault
from volery.transport.latency_settings import Constant, Gamma, LatencyTrace, Normal, Uniform
from volery.transport.links import Bucket, LinkSettings, Queue
from volery.transport.loss_settings import Bernoulli, BitError, GilbertElliott, GilbertElliottTime, LossTrace, Markov
from volery.transport.media_settings import FullDuplex, HalfDuplex, Medium

from ...surroundings import seeds

MS = 1_000_000
Make = Callable[..., Any]
TwinRun = Callable[[Plan], Record]
LINK = ("1", "2")
EVERYTHING = LinkSettings(
    rate=20_000.0,
    overhead=4,
    queue=Queue(1000),
    bucket=Bucket(16_000.0, 200),
    loss=(GilbertElliott(0.1, 0.4),),
    corruption=(Bernoulli(0.3),),
    duplication=0.3,
    latency=Normal(20 * MS, 2 * MS),
)
QUANTITIES = ("loss", "corruption", "duplication", "latency", "rate", "burst")


@pytest.fixture(scope="session")
def runs() -> dict[str, Record]:
    """Where the tests of this module keep what takes long."""
    return {}


@pytest.fixture
def everything(plan_of: Make, twin_run: TwinRun, runs: dict[str, Record]) -> Record:
    """A minute of two agents, 1200 frames each way, over a link with every impairment."""
    if "everything" not in runs:
        runs["everything"] = twin_run(plan_of([LINK], 60_000, settings=EVERYTHING))
    return runs["everything"]


def of_link(record: Record) -> Channel:
    """What was asked of 1→2 and what was got."""
    return channels(record)[LINK]


def decisions(record: Record) -> dict[str, str]:
    """Quantity → decision, on 1→2."""
    return {name: str(one.decision) for name, one in of_link(record).comparisons().items()}


def test_what_is_as_asked_is_within_its_bounds(everything: Record) -> None:
    """All six quantities can be told after 1200 frames, and the verdict is good."""
    assert decisions(everything) == dict.fromkeys(QUANTITIES, "within")
    found = of_link(everything)
    assert found.frames == 1199
    assert (found.loss.asked, found.corruption.asked, found.duplication.asked) == pytest.approx((0.2, 0.3, 0.3))
    assert (found.rate.asked, found.rate.got) == pytest.approx((20_000.0, 20_000.0), rel=1e-6)
    assert found.burst.got <= found.burst.asked == 1600.0
    assert compute_metrics(everything).fidelity.as_asked


@pytest.mark.parametrize(
    ("quantity", "asked"),
    [
        ("loss", {"loss": (GilbertElliott(0.2, 0.2),)}),
        ("corruption", {"corruption": ()}),
        ("duplication", {"duplication": 0.1}),
        ("latency", {"latency": Normal(21 * MS, 2 * MS)}),
        ("rate", {"rate": 20_100.0}),
        ("burst", {"bucket": Bucket(2000.0, 200)}),
    ],
)
def test_what_is_not_as_asked_is_outside(everything: Record, quantity: str, asked: dict[str, Any]) -> None:
    """The same record held to other settings: that quantity is outside, and no other; the verdict names it."""
    plan = replace(everything.plan, links=dict.fromkeys(everything.plan.links, replace(EVERYTHING, **asked)))
    record = replace(everything, plan=plan)
    assert decisions(record) == dict.fromkeys(QUANTITIES, "within") | {quantity: "outside"}
    fidelity = compute_metrics(record).fidelity
    assert not fidelity.as_asked
    assert fidelity.outside[0].startswith(f"{quantity} of 1→2: ")
    assert f"{quantity} of 1→2" in fidelity.verdict
    assert fidelity.decisions.get(quantity) == {"outside": 2}


@pytest.mark.parametrize("seed", seeds(1, 3))
@pytest.mark.parametrize(
    "settings",
    [
        LinkSettings(loss=(Bernoulli(0.2, correlation=0.6),), latency=Normal(20 * MS, 2 * MS, correlation=0.5)),
        LinkSettings(loss=(Markov(1000 * MS, 300 * MS),), latency=Gamma(20 * MS, 5 * MS, correlation=-0.5)),
        LinkSettings(loss=(BitError(1e-3), GilbertElliottTime(2000 * MS, 400 * MS, 0.8)), latency=Uniform(MS, 9 * MS)),
        LinkSettings(
            loss=(LossTrace((0, 30_000 * MS), (0.1, 0.7)),), latency=LatencyTrace((0, MS), (MS, 3 * MS), 7 * MS)
        ),
        LinkSettings(
            loss=(GilbertElliott(0.2, 0.3, 0.8),),
            corruption=(Bernoulli(0.2, correlation=0.4),),
            duplication=0.3,
            latency=Normal(20 * MS, 2 * MS, correlation=0.2),
            paired=100 * MS,
        ),
    ],
    ids=["correlated", "markov", "sum", "trace", "paired"],
)
def test_bounds_know_the_models(plan_of: Make, twin_run: TwinRun, settings: LinkSettings, seed: int) -> None:
    """Losses in bursts, of long frames, over time, and correlated latencies: sound runs are never outside."""
    record = twin_run(replace(plan_of([LINK], 60_000, settings=settings), seed=seed))
    assert set(decisions(record).values()) <= {"within", "too few", "nothing"}
    assert decisions(record)["latency"] == "within"


def test_settings_are_read_when_the_transmission_starts(plan_of: Make, twin_run: TwinRun) -> None:
    """A fault's loss counts while it holds; a cut is not the loss model's doing."""
    links = LinkSettings(latency=Constant(5 * MS))
    fault = LinkFault("t1", 500 * MS, None, (LINK,), {"loss": (Bernoulli(1.0),)})
    cut = LinkFault("t2", 500 * MS, None, (LINK[::-1],), {"cut": True})
    record = twin_run(plan_of([LINK], 1000, settings=links, faults=(fault, cut)))
    found = channels(record)
    one, back = found[LINK], found[LINK[::-1]]
    assert one.frames == 19  # sent 1 ms after 50, 100, … 950 ms
    assert one.loss.asked == one.loss.got == pytest.approx(10 / 19)
    assert one.latency.asked == one.latency.got == 5 * MS
    assert (back.frames, back.loss.samples, back.loss.got, back.loss.decision) == (19, 9, 0.0, "within")


def test_what_the_medium_destroys_is_not_compared(plan_of: Make, twin_run: TwinRun) -> None:
    """Both ends always talk at once and hear nothing; the loss models lost nothing."""
    settings = LinkSettings(medium=HalfDuplex(), rate=20_000.0, latency=Constant(5 * MS))
    record = twin_run(plan_of([LINK], settings=settings))
    assert {frame.fate for frame in frame_fates(record)[LINK]} == {"half-duplex"}
    assert (of_link(record).loss.got, of_link(record).loss.decision) == (0.0, "within")


def test_order_makes_latencies_incomparable(plan_of: Make, twin_run: TwinRun) -> None:
    """Where frames waited for earlier ones their mean is larger by rights; where none had to, it is compared."""
    wide = LinkSettings(latency=Normal(200 * MS, 60 * MS), reordering=False)
    assert decisions(twin_run(plan_of([LINK], 60_000, settings=wide)))["latency"] == "not comparable"
    narrow = replace(wide, latency=Normal(20 * MS, 2 * MS))
    assert decisions(twin_run(plan_of([LINK], 60_000, settings=narrow)))["latency"] == "within"


@pytest.mark.parametrize(("second", "decision"), [(63, "outside"), (64, "within")])
def test_overlapping_frames_are_faster_than_the_rate(plan_of: Make, second: int, decision: str) -> None:
    """Two frames of 64 ms airtime, as asked: the second may start when the first has ended."""
    collector = Collector()
    starts = enumerate((0, second))
    sent = [Sent("2", number, 8, start * MS, 64 * MS, (start + 69) * MS, "delivered") for number, start in starts]
    collector(Batch("1", 0, sent=sent))
    record = collector.record(plan_of([LINK], settings=LinkSettings(rate=1000.0, latency=Constant(5 * MS))))
    assert of_link(record).rate.decision == decision


def test_a_newer_frame_may_go_out_before_an_older_one(plan_of: Make) -> None:
    """As the queue policy `latest` lets it: in the order of their starts they do not overlap."""
    starts = ((1, 0), (0, 64))
    sent = [Sent("2", number, 8, start * MS, 64 * MS, (start + 69) * MS, "delivered") for number, start in starts]
    collector = Collector()
    collector(Batch("1", 0, sent=sent))
    settings = LinkSettings(rate=1000.0, latency=Constant(5 * MS), queue=Queue(policy="latest"))
    assert of_link(collector.record(plan_of([LINK], settings=settings))).rate.decision == "within"


@pytest.mark.parametrize(
    ("medium", "used"),
    [
        (FullDuplex(), {"1>2": 0.02, "1>3": 0.02, "2>1": 0.03, "3>1": 0.0}),
        (HalfDuplex(), {"1-2": 0.05, "1-3": 0.02}),
        (HalfDuplex("node"), {"radio 1": 0.02, "radio 2": 0.03, "radio 3": 0.0}),
    ],
    ids=["full-duplex", "edge", "node"],
)
def test_airtime_of_each_medium(plan_of: Make, medium: Medium, used: dict[str, float]) -> None:
    """Two broadcasts of 10 ms and an answer of 30 ms in one second: on a radio a broadcast is on the air once."""
    collector = Collector()
    broadcasts = [
        Sent(target, number, 10, 100 * number * MS, 10 * MS, (100 * number + 15) * MS, "delivered")
        for number in range(2)
        for target in ("2", "3")
    ]
    collector(Batch("1", 0, sent=broadcasts))
    collector(Batch("2", 0, sent=[Sent("1", 0, 30, 500 * MS, 30 * MS, 535 * MS, "delivered")]))
    collector.event({"event": "finished", "time_ns": 1000 * MS})
    record = collector.record(plan_of([LINK, ("1", "3")], settings=LinkSettings(medium=medium)))
    assert airtime_utilisation(record) == pytest.approx(used)


@pytest.mark.parametrize(("late_ms", "decision"), [(0, "within"), (1, "within"), (38, "outside")])
def test_latency_is_that_of_frames_that_really_came_late(plan_of: Make, late_ms: int, decision: str) -> None:
    """Drawn is 20 ms; by the wall clock every frame came later than that, and the table and the verdict say so."""
    starts = [100 * number * MS for number in range(40)]
    collector = Collector()
    sent = [Sent("2", number, 8, start, 0, start + 20 * MS, "delivered") for number, start in enumerate(starts)]
    receiver = Batch("2", 0, heard=[Heard("1", 0, one.sequence, one.due_ns, "delivered") for one in sent])
    receiver.arrived += [
        Arrived("1", 0, one.sequence, one.due_ns + late_ms * MS, one.due_ns + (late_ms + 2) * MS) for one in sent
    ]
    collector(Batch("1", 0, sent=sent))
    collector(receiver)
    collector.event({"event": "finished", "time_ns": 5000 * MS})
    record = collector.record(plan_of([LINK], settings=LinkSettings(latency=Constant(20 * MS))))
    latency = of_link(record).latency
    assert (latency.asked, latency.got, latency.decision) == (20 * MS, (20 + late_ms) * MS, decision)
    link = compute_metrics(record).links["1>2"]
    assert link.account.latency_ns == ((20 + late_ms) * MS,) * 3
    verdict = compute_metrics(record).fidelity.verdict
    assert ("latency of 1→2: 20 ms asked, 58 ms got, 19 to 21 ms allowed" in verdict) == (decision == "outside")


def test_time_for_which_a_link_held_a_frame_is_no_latency(plan_of: Make, twin_run: TwinRun) -> None:
    """What a fault holds back for 300 ms came as asked."""
    hold = LinkFault("t1", 200 * MS, 500 * MS, (LINK,), {"hold": True})
    links = LinkSettings(latency=Constant(5 * MS))
    record = twin_run(plan_of([LINK], 1000, settings=links, faults=(hold,)))
    assert max(frame.held_until_ns or 0 for frame in frame_fates(record)[LINK]) == 500 * MS
    latency = of_link(record).latency
    assert (latency.asked, latency.got, latency.decision) == (5 * MS, 5 * MS, "within")
