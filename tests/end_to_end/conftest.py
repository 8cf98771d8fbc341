"""Swarms of real processes over real Zenoh, in lockstep pace wherever a busy machine could make a difference."""

from __future__ import annotations

import asyncio
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

LIMIT_S = 90
BURN_S = 60
Meanwhile = Callable[[Swarm, Injector], Awaitable[None]]


async def _nothing(_swarm: Swarm, _injector: Injector) -> None:
    return


def run_swarm(plan: Plan, pace: Pace = "lockstep", meanwhile: Meanwhile = _nothing) -> tuple[Record, Ending]:
    """Run a plan in processes of its own; `meanwhile` is awaited once it has begun, beside it."""
    collector = Collector()

    async def run() -> Ending:
        swarm = Swarm(plan, collector, "test", pace)
        injector = Injector(swarm, collector)

        async def beside() -> None:
            await swarm.ready.wait()
            await meanwhile(swarm, injector)

        async with asyncio.timeout(LIMIT_S), asyncio.TaskGroup() as group:
            running = group.create_task(swarm.run())
            group.create_task(beside())
        return running.result()

    ending = asyncio.run(run())
    return collector.record(plan), ending


async def until(holds: Callable[[], bool]) -> None:
    """Wait for something that must come to hold; the run's own time limit ends a vain wait."""
    while not holds():  # noqa: ASYNC110 - what is waited for has no event of its own
        await asyncio.sleep(0.02)


@pytest.fixture
def plan_of() -> Callable[..., Plan]:
    """The plan of a built-in scenario with overrides."""

    def plan(name: str, *overrides: str) -> Plan:
        return load_scenario(name, overrides).plan

    return plan


@pytest.fixture
def busy_cores() -> Iterator[None]:
    """Both cores at work on something else."""
    burn = f"import time\nend = time.monotonic() + {BURN_S}\nwhile time.monotonic() < end: pass"
    burners = [subprocess.Popen([sys.executable, "-c", burn]) for _ in range(2)]
    yield
    for burner in burners:
        burner.kill()
        burner.wait()
