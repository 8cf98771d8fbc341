"""Sensors and an estimator of one vehicle as processes: loss, latency and sensor faults, from the timeline and live."""

from __future__ import annotations

from collections.abc import Callable

from volery.agents.plan import Plan
from volery.experiments.analysis.accounting import account, total
from volery.experiments.record.record import Collector
from volery.experiments.swarm.live_faults import Injector
from volery.experiments.swarm.supervisor import Swarm

from .conftest import MS, SECOND, advanced, departures, run_swarm, until

PlanOf = Callable[..., Plan]
TIMELINE = "faults=[{at: 1 s, for: 1 s, sensor: laser1.range, failed: true}, {at: 1.5 s, for: 500 ms, cut: hub-laser2}]"


def test_a_lossy_star_of_sensors_equals_its_twin(plan_of: PlanOf) -> None:
    """Six processes in lockstep: estimates, counts and fates are the twin's, a live sensor fault included."""
    plan = plan_of("altitude-lossy", "duration=600 s", TIMELINE)
    injected: list[str] = []

    async def meddle(swarm: Swarm, injector: Injector, collected: Collector) -> None:
        await until(lambda: swarm.status.time_ns > 2 * SECOND)
        injected.append(await injector.inject({"sensor": "baro1.barometer", "bias": 0.5}))
        await advanced(swarm, collected, 300 * MS)
        await swarm.stop()

    record, ending = run_swarm(plan, "lockstep", meddle)
    assert ending.problems == ()
    assert len(injected) == 1
    counts = record.estimates("measurements")["hub"].value[-1]
    assert counts[1] > 20, "late measurements were put where they belong"
    lost = total(account(record).values())
    assert lost["lost (loss)"] > 50
    assert lost["lost (cut)"] > 0
    assert departures(record) == []
