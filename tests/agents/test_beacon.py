"""Beacons: when they send, what, to whom, and what they count."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

import pytest

from volery.agents.beacon import Beacon, BeaconParameters
from volery.agents.journal import Sent
from volery.agents.plan import AgentPlan, Plan
from volery.errors import BadInput
from volery.experiments.analysis.accounting import account
from volery.experiments.record.record import Record
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded
from volery.transport.faults import Fault, Kill, Pause
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings
from volery.transport.loss_settings import Bernoulli
from volery.transport.media_settings import HalfDuplex

S = 1_000_000_000
MS = 1_000_000
LINK = LinkSettings(latency=Constant(5 * MS), mtu=2000)


def star(parameters: BeaconParameters, seconds: int = 10, faults: Sequence[Fault] = (), seed: int = 1) -> Plan:
    """A hub 1 with leaves 2 and 3."""
    near = {"1": ("2", "3"), "2": ("1",), "3": ("1",)}
    degrees = {name: len(others) for name, others in near.items()}
    agents = tuple(AgentPlan(name, "beacon", parameters, others, degrees) for name, others in near.items())
    links = {(name, other): LINK for name, others in near.items() for other in others}
    return Plan("star", seed, seconds * S, agents, links, faults=tuple(faults))


def run(plan: Plan) -> Record:
    """The record of a run in the twin."""
    return recorded(plan)


def starts(record: Record, agent: str, target: str, incarnation: int = 0) -> list[int]:
    """When an agent's frames to a target started, less the compute time."""
    sent: list[Sent] = record.batches[agent, incarnation].sent
    return [frame.start_ns - MS for frame in sent if frame.target == target]


def test_even_intervals_keep_to_their_phase() -> None:
    """20 Hz for 10 s are 200 frames to each neighbour, 50 ms apart; phases are drawn, or 0 for all."""
    drawn, aligned = (run(star(BeaconParameters(rate=20.0, phase=phase))) for phase in ("drawn", "aligned"))
    for agent, target in (("1", "2"), ("1", "3"), ("2", "1")):
        times = starts(drawn, agent, target)
        assert len(times) == 200
        assert {after - before for before, after in pairwise(times)} == {50 * MS}
        assert starts(aligned, agent, target) == [50 * MS * number for number in range(200)]
    phases = {starts(drawn, agent, target)[0] for agent, target in (("1", "2"), ("2", "1"), ("3", "1"))}
    assert len(phases) == 3
    assert all(0 <= phase < 50 * MS for phase in phases)


def test_poisson_beacons_have_exponential_intervals() -> None:
    """The mean of n intervals is 1/rate and P(interval > 1/rate) = 1/e, each within four standard errors."""
    record = run(star(BeaconParameters(rate=100.0, pattern="poisson"), seconds=40))
    times = starts(record, "2", "1")
    intervals = [after - before for before, after in pairwise(times)]
    count, share = len(intervals), math.exp(-1)
    assert count > 3000
    assert sum(intervals) / count == pytest.approx(10 * MS, rel=4 / math.sqrt(count))
    longer = sum(interval > 10 * MS for interval in intervals) / count
    assert longer == pytest.approx(share, abs=4 * math.sqrt(share * (1 - share) / count))
    assert times != starts(record, "3", "1")


@pytest.mark.parametrize(
    ("talkers", "who"),
    [("all", {"1", "2", "3"}), ("leaves", {"2", "3"}), (("1", 3), {"1", "3"}), (("2",), {"2"})],
)
def test_only_talkers_send(talkers: tuple[str | int, ...], who: set[str]) -> None:
    """The others listen; names may be written as numbers."""
    record = run(star(BeaconParameters(talkers=talkers)))
    assert {name for (name, _), batch in record.batches.items() if batch.sent} == who


def test_every_agent_reports_how_many_it_has_received() -> None:
    """Once a second, and the numbers agree with the accounts of the links."""
    plan = star(BeaconParameters(rate=30.0, size=7, pattern="poisson", report=2.0))
    lossy = {link: LinkSettings(latency=Constant(5 * MS), loss=(Bernoulli(0.3),)) for link in plan.links}
    record = run(Plan("star", 1, 10 * S, plan.agents, lossy))
    series = record.estimates("received")
    assert series["1"].time_ns.tolist() == [500 * MS * number for number in range(20)]
    heard = [frame for frame in record.batches["1", 0].heard if frame.due_ns < 9500 * MS]
    assert series["1"].value[-1] == sum(frame.fate == "delivered" for frame in heard) < len(heard)
    assert all(frame.size == 7 for frame in record.batches["2", 0].sent)
    assert sum(link.delivered for link in account(record).values()) > series["1"].value[-1]


def test_a_broadcast_is_one_transmission_for_all() -> None:
    """Over the radio of the hub both leaves hear one frame; otherwise each has its own, one after the other."""
    radio = LinkSettings(HalfDuplex("node"), rate=8e3, latency=Constant(5 * MS))
    counts = {}
    for broadcast in (True, False):
        plan = star(BeaconParameters(size=25, phase="aligned", broadcast=broadcast, talkers=("1",)))
        record = run(Plan("star", 1, 10 * S, plan.agents, dict.fromkeys(plan.links, radio)))
        counts[broadcast] = len({frame.start_ns for frame in record.batches["1", 0].sent})
        assert record.estimates("received")["2"].value[-1] == 90
    assert counts == {True: 100, False: 200}


@pytest.mark.parametrize("size", [1, 8, 1500])
def test_payloads_have_the_size_that_is_asked_for(size: int) -> None:
    """Of any length from 1 B."""
    parameters = BeaconParameters(size=size)
    sent = run(star(parameters, seconds=1)).batches["2", 0].sent
    assert {frame.size for frame in sent} == {size} == {Beacon.largest_payload(parameters)}


@pytest.mark.parametrize("pattern", ["periodic", "poisson"])
def test_a_restarted_beacon_goes_on_from_then(pattern: Literal["periodic", "poisson"]) -> None:
    """It sends nothing for the time before its restart, and counts anew."""
    faults = [Kill("k", 3 * S, 6 * S, "2")]
    record = run(star(BeaconParameters(rate=50.0, pattern=pattern), faults=faults))
    assert max(starts(record, "2", "1")) <= 3 * S
    again = starts(record, "2", "1", 1)
    assert min(again) >= 6 * S
    assert len(again) == pytest.approx(200, abs=4 * math.sqrt(200))
    assert [estimate.value for estimate in record.batches["2", 1].estimates[:1]] == [[0.0]]


@pytest.mark.parametrize("keep", [True, False])
def test_a_restart_with_state_counts_on(keep: bool) -> None:
    """The hub has received 20 · 2 · 3 by its death at 3 s; it goes on from there, or from 0."""
    faults = [Kill("k", 3 * S + 500 * MS, 6 * S, "1", keep_state=keep)]
    record = run(star(BeaconParameters(rate=20.0, phase="aligned", talkers="leaves"), faults=faults))
    assert record.batches["1", 0].estimates[-1].value == [120.0]
    received = sum(frame.fate == "delivered" for frame in record.batches["1", 0].heard)
    first = record.batches["1", 1].estimates[0]
    assert (first.time_ns, first.value) == (6 * S, [float(received if keep else 0)])


def test_a_paused_beacon_sends_what_it_missed() -> None:
    """The timers of the pause ring after it, so that the number of frames is the same."""
    paused, steady = (run(star(BeaconParameters(), faults=faults)) for faults in ([Pause("p", 2 * S, 4 * S, "2")], []))
    assert len(starts(paused, "2", "1")) == len(starts(steady, "2", "1"))


def test_what_cannot_be_is_refused() -> None:
    """Rates, sizes, and talkers that are nobody."""
    for wrong, message in (
        ({"rate": 0.0}, "rate is 0 Hz"),
        ({"report": math.inf}, "report is inf Hz"),
        ({"size": 0}, "size is 0 B"),
        ({"talkers": ()}, "talkers is empty"),
        (
            {"pattern": "poisson", "phase": "aligned"},
            "phase is aligned, and pattern is poisson, which has no phase: leav",
        ),
    ):
        with pytest.raises(BadInput, match=message):
            BeaconParameters(**wrong)
    with pytest.raises(BadInput, match=re.escape("talkers names 99, and there is no such agent")):
        load_scenario("beacons", ["agents.talkers=[1, 99]"])
    with pytest.raises(BadInput, match="every agent has more than one neighbour"):
        load_scenario("beacons", ["topology={ring: 4}", "agents.talkers=leaves"])


def test_what_is_known_beforehand() -> None:
    """The rate of all agents where all talk; where only some do it depends on the agent."""
    assert Beacon.sends_per_second(BeaconParameters(rate=3.0)) == 3.0
    assert Beacon.sends_per_second(BeaconParameters(talkers="leaves")) is None
    assert [Beacon.broadcasts(BeaconParameters(broadcast=once)) for once in (True, False)] == [True, False]
