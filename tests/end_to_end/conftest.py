"""Swarms of real processes over real Zenoh, in lockstep pace wherever a busy machine could make a difference."""

from __future__ import annotations

import asyncio
import math
import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterator

import pytest

from volery.agents.plan import Plan
from volery.agents.process import Pace
from volery.experiments.record.record import Collector, Record
from volery.experiments.scenario.load import load_scenario
from volery.experiments.swarm.live_faults import Injector
from volery.experiments.swarm.supervisor import Ending, Swarm
from volery.experiments.verify import compare, replay

LIMIT_S = 400
"""A hang is ended, a machine that is busy with other work is not."""
MS = 1_000_000
SECOND = 1000 * MS
Meanwhile = Callable[[Swarm, Injector, Collector], Awaitable[None]]
"""Awaited while a swarm runs; the collector has the journals that have come so far."""


async def _nothing(_swarm: Swarm, _injector: Injector, _collected: Collector) -> None:
    return


def run_swarm(
    plan: Plan, pace: Pace = "lockstep", meanwhile: Meanwhile = _nothing, speed: float = 1.0
) -> tuple[Record, Ending]:
    """Run a plan in processes of its own; `meanwhile` is awaited once the run has begun, concurrently with it."""
    collector = Collector()

    async def run() -> Ending:
        swarm = Swarm(plan, collector, "test", pace, speed)
        injector = Injector(swarm)

        async def once_ready() -> None:
            await swarm.ready.wait()
            await meanwhile(swarm, injector, collector)

        async with asyncio.timeout(LIMIT_S), asyncio.TaskGroup() as group:
            running = group.create_task(swarm.run())
            group.create_task(once_ready())
        return running.result()

    ending = asyncio.run(run())
    return collector.record(plan), ending


async def until(holds: Callable[[], bool]) -> None:
    """Wait until a condition holds; the time limit of the run ends a wait in vain."""
    while not holds():  # noqa: ASYNC110 - what is waited for has no event of its own
        await asyncio.sleep(0.02)


async def advanced(swarm: Swarm, collected: Collector, time_ns: int) -> None:
    """Wait until the run is so much further than now, and than the latest fault or clearing that was injected.

    Agents report every 200 ms by the clock, in which a run in lockstep pace may advance by seconds: an instant that was
    injected can lie ahead of what is known of the run.
    """
    injected = [event["time_ns"] for event in collected.events if event["event"] in ("fault", "cleared")]
    reached = max([swarm.status.time_ns, *injected])
    await until(lambda: swarm.status.time_ns > reached + time_ns)


async def estimates_of(collected: Collector, *lives: tuple[str, int]) -> None:
    """Wait until each of these incarnations has reported an estimate."""
    await until(lambda: all(life in collected.batches and collected.batches[life].estimates for life in lives))


def departures(record: Record, before_ns: float = math.inf) -> list[str]:
    """Where a record and its replay in the twin differ, bit for bit, before an instant."""
    return [departure.what for departure in compare(record, replay(record), 0.0) if departure.time_ns < before_ns]


def first_late_ns(record: Record) -> float:
    """When the first late frame was due, in nanoseconds; infinity where none was late."""
    return min((late.due_ns for batch in record.batches.values() for late in batch.late), default=math.inf)


@pytest.fixture
def plan_of() -> Callable[..., Plan]:
    """The plan of a built-in scenario with overrides."""

    def plan(name: str, *overrides: str) -> Plan:
        return load_scenario(name, overrides).plan

    return plan


@pytest.fixture
def busy_cores() -> Iterator[None]:
    """Both cores at work on something else."""
    burn = f"import time\nend = time.monotonic() + {LIMIT_S}\nwhile time.monotonic() < end: pass"
    burners = [subprocess.Popen([sys.executable, "-c", burn]) for _ in range(2)]
    yield
    for burner in burners:
        burner.kill()
        burner.wait()
