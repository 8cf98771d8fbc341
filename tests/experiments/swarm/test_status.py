"""The live status says what the tables say."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.agents.agent import Agent
from volery.agents.journal import Batch, Estimate
from volery.agents.plan import Plan
from volery.experiments.evaluation.evaluation import Evaluation
from volery.experiments.record.evaluation_pass import evaluated
from volery.experiments.record.frame_fates import frame_fates
from volery.experiments.record.record import Collector
from volery.experiments.record.samples import samples
from volery.experiments.swarm.status import Status, WatchedSink
from volery.experiments.swarm.supervisor import told_once
from volery.experiments.twin import Twin
from volery.quantities import Quantity
from volery.transport.faults import Kill, LinkFault
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings, Queue
from volery.transport.loss_settings import Bernoulli
from volery.transport.media_settings import FullDuplex, HalfDuplex, Medium

MS = 1_000_000
Floats = NDArray[np.float64]
Make = Callable[..., Any]
NARROW = LinkSettings(rate=2000.0, queue=Queue(1), loss=(Bernoulli(0.2),), duplication=0.3, latency=Constant(60 * MS))
KILLS = (Kill("t1", 1000 * MS, 1300 * MS, "2"), Kill("t2", 2510 * MS, None, "3"))
HOLD = LinkFault("t3", 400 * MS, 900 * MS, (("1", "2"),), {"hold": True})


@pytest.mark.parametrize(("medium", "lost"), [(FullDuplex(), "loss"), (HalfDuplex(), "half-duplex")])
def test_fates_are_those_of_the_tables(plan_of: Make, medium: Medium, lost: str) -> None:
    """Queues that overflow, losses, duplicates, a hold, agents that die: what the display counts, the record has."""
    links = LinkSettings(**{**vars(NARROW), "medium": medium})
    plan: Plan = plan_of([("1", "2"), ("2", "3")], 3000, settings=links, faults=(*KILLS, HOLD))
    collector = Collector()
    status = Status(plan)

    def go_on(now_ns: int) -> bool:
        status.time_ns = now_ns
        assert status.fates()["in-flight"] == 0
        return True

    Twin(plan, WatchedSink(collector, status)).run(go_on)
    fates = Counter(frame.fate for of_link in frame_fates(collector.record(plan)).values() for frame in of_link)
    assert {"queue", "receiver-down", "sender-down", "in-flight", lost} <= set(fates)
    del fates["in-flight"]
    assert status.fates() == fates
    told = status.to_dict()
    assert told["discarded"] == {"queue": fates["queue"]}
    assert told["lost"] == fates.total() - fates["queue"] - fates["delivered"]
    assert told["frames"] == fates.total()


def shorter_way(estimate: Floats, reference: Floats) -> Floats:
    """The difference of headings, between −π and π."""
    return np.asarray((estimate - reference + np.pi) % (2 * np.pi) - np.pi)


class CompassEvaluation(Evaluation):
    """Of headings [rad]."""

    quantities = (Quantity("heading", difference=shorter_way), Quantity("bias", is_shared=False))


class Compass(Agent):
    """Agents that report headings."""

    evaluation = CompassEvaluation


class BrokenEvaluation(CompassEvaluation):
    """Fails where it is made."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        raise KeyError


class Broken(Agent):
    """Agents whose evaluation fails."""

    evaluation = BrokenEvaluation


def test_an_evaluation_that_fails_does_not_end_the_run(plan_of: Make) -> None:
    """The display has no disagreement then; what is wrong is told at the end."""
    plan = plan_of([("1", "2")], kind=Broken)
    status = Status(plan)
    status.alive = {"1", "2"}
    for name in "12":
        status.take(Batch(name, 0, [Estimate(0, "heading", 1, [float(name)])]))
    assert status.to_dict()["disagreement"] is None


def test_what_several_agents_say_is_told_once() -> None:
    """In the order of the first, agents in natural order."""
    lines = "failed in start: KeyError\n  File"
    told = [f"agent 10 {lines}", "agent 2 has ended", f"agent 9 {lines}", "agent 1: no light", "a link is lost"]
    assert told_once(told) == (f"agents 9, 10 {lines}", "agent 2 has ended", "agent 1: no light", "a link is lost")


def test_disagreement_is_that_of_the_tables(plan_of: Make) -> None:
    """Root mean square, by the difference of the agents' class, of those who live and know: 359°, 1° and 0°.

    What each has of its own says nothing of it.
    """
    plan = plan_of([("1", "2"), ("2", "3"), ("3", "4")], kind=Compass)
    collector = Collector()
    status = Status(plan)
    status.alive = {"1", "2", "3"}
    sink = WatchedSink(collector, status)
    for name in "123":
        sink(Batch(name, 0, [Estimate(0, "bias", 1, [float(name)])]))
    assert status.disagreement() is None
    for name, degrees in (("1", 359.0), ("2", 1.0), ("3", 0.0), ("4", 90.0)):
        sink(Batch(name, 0, [Estimate(0, "heading", 1, [np.deg2rad(degrees)])]))
    assert status.disagreement() == pytest.approx(np.deg2rad(np.sqrt(2 / 3)))
    status.alive.add("4")
    assert status.disagreement() == pytest.approx(samples(evaluated(collector.record(plan)), "heading").disagreement[0])
    status.alive = {"4"}
    assert status.disagreement() is None
    sink(Batch("1", 0, [Estimate(0, "heading", 2, [np.nan])]))
    status.alive = {"1", "2", "3"}
    assert status.disagreement() == pytest.approx(np.deg2rad(0.5))
