"""Distributed filters over real Zenoh equal their twin, faults included."""

from __future__ import annotations

from collections.abc import Callable

from volery.agents.plan import Plan
from volery.experiments.analysis.accounting import account

from .conftest import departures, run_swarm

PlanOf = Callable[..., Plan]
FAULTS = 'faults=[{at: 2 s, until: 4 s, cut: 1-2}, {at: 3 s, until: 5 s, kill: "3"}]'


def test_trackers_over_zenoh_equal_their_twin(plan_of: PlanOf) -> None:
    """Ten processes in lockstep, late messages, a cut, and a tracker that dies and returns: the same bits."""
    plan = plan_of("tracker", "duration=8 s", "links.latency={uniform: {low: 10 ms, high: 900 ms}}", FAULTS)
    record, ending = run_swarm(plan, "lockstep")
    assert ending.problems == ()
    assert departures(record) == []
    assert all(link.closes for link in account(record).values())
    assert record.estimates("estimate")["3"].sample[-1] == 14
