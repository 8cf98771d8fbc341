"""Moving horizon estimation with a process a sensor: loss, latency and failing sensors, equal to its twin."""

from __future__ import annotations

from collections.abc import Callable

from volery.agents.mhe.estimator import COUNTS
from volery.agents.plan import Plan
from volery.experiments.analysis.accounting import account
from volery.experiments.record.record import Collector
from volery.experiments.swarm.live_faults import Injector
from volery.experiments.swarm.supervisor import Swarm

from .conftest import MS, advanced, departures, run_swarm, until

PlanOf = Callable[..., Plan]
FAULTS = "faults=[{at: 300 ms, for: 200 ms, sensor: flow.flow, failed: true}]"


def test_moving_horizon_over_zenoh_equals_its_twin(plan_of: PlanOf) -> None:
    """Eight processes in lockstep, a camera that fails by the timeline and a range sensor live: the same bits."""
    plan = plan_of("mhe-lossy", "duration=600 s", FAULTS)

    async def meddle(swarm: Swarm, injector: Injector, collected: Collector) -> None:
        await until(lambda: swarm.status.time_ns > 600 * MS)
        await injector.inject({"sensor": "left.range_left", "stuck": True, "for": "200 ms"})
        await advanced(swarm, collected, 300 * MS)
        await until(lambda: swarm.status.time_ns > 1500 * MS)
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", meddle)
    assert ending.problems == ()
    assert departures(record) == []
    assert all(link.closes for link in account(record).values())
    assert len(record.faults) == 2
    in_time, late, *_ = record.estimates(COUNTS)["hub"].value[-1]
    assert in_time > 100
    assert late > 100
