"""Exact pace over Zenoh: by the wall clock while the machine keeps up, and the twin's result whether it does or not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from volery.agents.plan import Plan
from volery.experiments.record.record import Collector
from volery.experiments.scenario.load import load_scenario
from volery.experiments.swarm.live_faults import Injector
from volery.experiments.swarm.supervisor import Swarm

from .conftest import MS, advanced, departures, run_swarm, until

PlanOf = Callable[..., Plan]

SLOW = """
import time

from volery.agents.agent import Agent


class Pair(Agent):
    timers_only = True
    heard = 0

    def start(self):
        if self.context.name == "1":
            self.context.set_timer(0)

    def on_timer(self, timer):
        self.context.send("2", bytes(20))
        self.context.set_timer(timer.time_ns + 10_000_000)

    def on_frame(self, frame):
        time.sleep(0.0125)
        self.heard += 1
        self.context.report("heard", [float(self.heard)], self.heard)
"""
SLOW_SCENARIO = """
duration: 1400 ms
topology: {line: 2}
agents: {kind: "slow_pair:Pair"}
links: {latency: 2 ms}
"""


def test_an_estimator_that_is_too_slow_stretches_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It needs five times as long as there is, behind a node of 100 Hz at four times real time: nothing is late."""
    (tmp_path / "slow_pair.py").write_text(SLOW, "utf-8")
    (tmp_path / "slow.yaml").write_text(SLOW_SCENARIO, "utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    record, ending = run_swarm(load_scenario(str(tmp_path / "slow.yaml")).plan, "exact", speed=4.0)
    assert ending.problems == ()
    assert len(record.batches["2", 0].heard) == 140
    ended = {
        name: event for (name, _), batch in record.batches.items() for event in batch.events if "behind_ns" in event
    }
    assert all(event["overflowed"] == 0 for event in ended.values())
    assert departures(record) == []


@pytest.mark.usefixtures("busy_cores")
def test_a_busy_machine_changes_nothing_but_time(plan_of: PlanOf) -> None:
    """Sixteen modules by the wall clock, while both cores work on something else."""
    record, ending = run_swarm(
        plan_of("dfa16-lossy", "duration=600 ms", "faults=[{at: 300 ms, for: 100 ms, kill: 5}]"), "exact"
    )
    assert ending.problems == ()
    assert not any(batch.late for batch in record.batches.values())
    assert departures(record) == []


def test_carrier_sense_by_the_wall_clock(plan_of: PlanOf) -> None:
    """What began microseconds ago in another process is known, as no event is handled before it is."""
    record, ending = run_swarm(plan_of("radio-csma", "duration=600 ms", "agents.rate=60 Hz"), "exact")
    assert ending.problems == ()
    assert departures(record) == []


def test_live_faults_by_the_wall_clock(plan_of: PlanOf) -> None:
    """A cut, a kill, its end and a pause, each at one instant for all; nothing is late, and the twin agrees."""
    plan = plan_of("dfa4", "duration=600 s", "faults=[]")

    async def meddle(swarm: Swarm, injector: Injector, collected: Collector) -> None:
        await advanced(swarm, collected, 100 * MS)
        await injector.inject({"cut": "1-2", "for": "100 ms"})
        await injector.inject({"kill": 3})
        await until(lambda: "3" not in swarm.status.alive)
        await injector.inject({"pause": 4, "for": "50 ms"})
        assert await injector.restart("3") == "restarted 3"
        await advanced(swarm, collected, 100 * MS)
        await swarm.stop()

    record, ending = run_swarm(plan, "exact", meddle)
    assert ending.problems == ()
    assert [event["event"] for event in record.events if "fault" in event["event"]] == ["fault"] * 3
    assert departures(record) == []
