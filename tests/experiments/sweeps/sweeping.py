"""Sweeps whose runs are carried out in this process."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from pathlib import Path
from typing import Any

from volery.experiments.sweeps.pools import Done, Pool
from volery.experiments.sweeps.sweep import SweepOptions, run_sweep
from volery.experiments.sweeps.sweep_plan import Job, SweepPlan, plan_sweep
from volery.experiments.sweeps.sweep_results import Sweep
from volery.experiments.sweeps.sweep_runs import run_job

OVER = ("links.loss.bernoulli=0,0.5", "agents.estimator=running-sum,metropolis-least-squares")
SHORT = ("duration=0.4 s",)


def in_process(jobs: Iterable[Job]) -> Generator[Done, None, None]:
    """Carry out runs one after the other."""
    for job in jobs:
        yield Done(job, run_job(job))


class Counting:
    """A pool in this process that counts runs, takes them from the last to the first, and may be interrupted."""

    def __init__(self, interrupted_after: int | None = None) -> None:
        self.carried_out = 0
        self._most = interrupted_after

    def __call__(self, jobs: Iterable[Job]) -> Generator[Done, None, None]:
        """Carry out runs."""
        for job in reversed(list(jobs)):
            if self.carried_out == self._most:
                raise KeyboardInterrupt
            self.carried_out += 1
            yield Done(job, run_job(job))


def planned(*over: str, **others: Any) -> SweepPlan:
    """A sweep of short runs of the four modules."""
    return plan_sweep("dfa4", (*SHORT, *others.pop("overrides", ())), over or OVER, **others)


def swept(folder: Path, plan: SweepPlan, pool: Pool = in_process, repeat: int = 2, **options: Any) -> Sweep:
    """Carry a sweep out in a folder."""
    return run_sweep(plan, SweepOptions(repeat, runs=folder.parent, name=folder.name, **options), pool)
