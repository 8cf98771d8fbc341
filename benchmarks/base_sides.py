"""One side of the comparison with an earlier commit: it runs with the package of either, so it uses what both have."""

from __future__ import annotations

import asyncio
import resource
import time
from typing import Any

from volery.experiments.scenario import compile as compiling
from volery.experiments.scenario.load import load_scenario
from volery.experiments.swarm.supervisor import Swarm
from volery.experiments.twin import Twin


class Ends:
    """A sink that keeps the last event of each process, and counts frames."""

    def __init__(self) -> None:
        self.done: list[dict[str, Any]] = []
        self.heard = 0

    def __call__(self, batch: Any) -> None:
        """Add the entries of one agent."""
        self.heard += len(batch.heard)
        self.done += [event for event in batch.events if event["event"] == "done"]

    def event(self, event: dict[str, Any]) -> None:
        """Ignore events of the run."""


def _plan(scenario: str) -> Any:
    loaded: Any = load_scenario(scenario)
    return loaded.plan if hasattr(loaded, "plan") else compiling.compile_plan(loaded)


def _cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def swarm(scenario: str, pace: Any) -> dict[str, float]:
    """A run over Zenoh: processor seconds of all processes, wall seconds, and seconds behind the clock at the end."""
    plan, ends = _plan(scenario), Ends()

    async def life() -> tuple[float, tuple[str, ...]]:
        running = Swarm(plan, ends, "base", pace)
        began_s = time.monotonic()
        ending = await running.run()
        return time.monotonic() - began_s, ending.problems

    before_s = _cpu_s()
    wall_s, problems = asyncio.run(life())
    if problems:
        raise RuntimeError("; ".join(problems))
    behind_s = max(event.get("end_behind_ns", 0) for event in ends.done) / 1e9
    cpu_s = sum(event["cpu_s"] for event in ends.done) + _cpu_s() - before_s
    return {"cpu_s": cpu_s, "wall_s": wall_s, "behind_s": behind_s, "promises": sum(e["promises"] for e in ends.done)}


def twin(scenario: str) -> dict[str, float]:
    """A run in the twin: processor seconds, and µs per frame."""
    plan, ends = _plan(scenario), Ends()
    before_s = time.process_time()
    Twin(plan, ends).run()
    cpu_s = time.process_time() - before_s
    return {"cpu_s": cpu_s, "frame_us": cpu_s / max(ends.heard, 1) * 1e6}
