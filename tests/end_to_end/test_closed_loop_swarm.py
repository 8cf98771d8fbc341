"""A closed loop over Zenoh: vehicles and their world, a process each, equal to their twin to the last bit."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from typing import Any

from volery.agents.plan import WORLD, Plan
from volery.experiments.analysis.accounting import account
from volery.experiments.record.record import Collector
from volery.experiments.swarm.live_faults import Injector
from volery.experiments.swarm.supervisor import Swarm

from .conftest import MS, departures, run_swarm, until


def test_a_formation_in_lockstep_equals_its_twin(plan_of: Callable[..., Plan]) -> None:
    """Three vehicles and the world that they fly in, with lost packets, a camera that fails and a vehicle that dies."""
    faults = "[{at: 1 s, for: 0.5 s, sensor: 1.camera, failed: true}, {at: 1.5 s, kill: 3}]"
    record, ending = run_swarm(plan_of("mav3", "duration=2.5 s", "links.loss.bernoulli=0.3", f"faults={faults}"))
    assert ending.problems == ()
    assert {name for name, _ in record.batches} == {"1", "2", "3", WORLD}
    assert len(record.world_reports["positions"].time_ns) == 75
    assert len(record.estimates("formation")["1"].time_ns) > 70
    assert departures(record) == []
    assert all(link.closes for link in account(record).values())


def test_a_run_whose_world_was_killed_has_failed(plan_of: Callable[..., Plan]) -> None:
    """Nobody senses anything from then on: the run ends, and is none that went well.

    While it lives the world is none of the agents that are counted.
    """
    told: list[dict[str, Any]] = []

    async def kill(swarm: Swarm, _injector: Injector, _collected: Collector) -> None:
        await until(lambda: swarm.status.time_ns > 100 * MS)
        told.append(swarm.status.to_dict())
        os.kill(swarm.pids()[WORLD], signal.SIGKILL)

    record, ending = run_swarm(plan_of("mav3", "duration=40 s"), meanwhile=kill)
    assert ending.problems == ("agent world was killed from outside",)
    assert [(status["agents"], status["alive"]) for status in told] == [(3, ["1", "2", "3"])]
    assert record.end_ns == 40_000_000_000
