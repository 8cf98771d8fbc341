"""Runs a sweep: what is not finished yet, on a pool of workers, into a folder that tells how far it has come."""

from __future__ import annotations

import contextlib
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product, starmap
from pathlib import Path

from ...agents.plan_codec import named_by_value
from ...errors import BadInput
from ...names import LONGEST_RUN, check_length
from ..execution import Engine
from .pools import Pool, cores, dask_pool, local_pool
from .sweep_plan import SweepPlan
from .sweep_results import KEPT, Journal, Row, Sweep, is_sweep, write_table


@dataclass(frozen=True)
class SweepOptions:
    """How to carry out a sweep.

    `repeat`: runs of each cell, with seeds of their own. `runs`: folder of runs. `name`: of the sweep's folder, instead
    of one that follows from what is swept. `workers`: processes, by default one a core. `scheduler`: address of a Dask
    scheduler instead. `keep`: keep each run's folder. `fresh`: drop results that are there.
    """

    repeat: int = 1
    engine: Engine = "twin"
    runs: Path = Path("runs")
    name: str | None = None
    workers: int | None = None
    scheduler: str | None = None
    keep: bool = False
    fresh: bool = False

    def __post_init__(self) -> None:
        """Check the bounds."""
        if self.name is not None:
            check_length(Path(self.name).name, LONGEST_RUN, "the sweep's name")
        if self.repeat < 1:
            raise BadInput(f"--repeat {self.repeat}: each cell is run at least once")
        if self.scheduler is not None and self.workers is not None:
            raise BadInput("--workers is for processes on this machine, a Dask cluster has its own: leave out one")

        if self.scheduler is not None and self.keep:
            raise BadInput("--keep is for runs on this machine: those of a Dask cluster would stay with its workers")

    def folder(self, plan: SweepPlan) -> Path:
        """Where the sweep is: what is swept gives the name, so that the same command finds it again."""
        return self.runs / (self.name or f"{plan.name}-{plan.digest[:8]}")

    def pool(self) -> Pool:
        """Who does the work; runs over Zenoh are processes by themselves, and go one after the other."""
        if self.scheduler is not None:
            return dask_pool(self.scheduler)
        most = 1 if self.engine == "zenoh" else cores()
        return local_pool(most if self.workers is None else self.workers)


@dataclass(frozen=True)
class Advance:
    """How far a sweep has come: runs that are finished, those of this session among them, and the seconds it took."""

    finished: int
    total: int
    fresh: int
    seconds: float

    @property
    def left_s(self) -> float | None:
        """How long the rest will take, as the runs of this session have; None before the first."""
        return (self.total - self.finished) * self.seconds / self.fresh if self.fresh else None


Watch = Callable[[Advance], None]


def run_sweep(
    plan: SweepPlan, options: SweepOptions, pool: Pool | None = None, watch: Watch = lambda _advance: None
) -> Sweep:
    """Carry out what is not finished of a sweep, and write its table.

    Args:
        plan: what is swept.
        options: how.
        pool: who does the work, instead of the pool of the options.
        watch: called with the progress after each run.
    Raises:
        BadInput: an option does not fit, or the folder has the results of another sweep.
        RunFailed: a run could not be carried through; what is finished is kept.
    """
    if options.scheduler is not None:
        _check_importable(plan)
    folder = options.folder(plan)
    work = pool or options.pool()
    if options.fresh:
        _drop(folder)
    with Journal(folder, plan, options.repeat) as journal:
        runs = list(product(range(len(plan.cells)), range(options.repeat)))
        total, finished, began = len(runs), sum(starmap(journal.has, runs)), time.monotonic()
        jobs = plan.jobs(options.repeat, sys.path, folder / KEPT if options.keep else None, journal.has)
        watch(Advance(finished, total, 0, 0.0))
        with contextlib.closing(work(jobs)) as results:
            for fresh, done in enumerate(results, start=1):
                journal.add(Row(done.job.cell, done.job.repeat, done.job.seed, done.values))
                watch(Advance(finished + fresh, total, fresh, time.monotonic() - began))
        sweep = journal.results()
    write_table(sweep)
    return sweep


def _check_importable(plan: SweepPlan) -> None:
    """Refuse code by value, which workers on other machines are not trusted to load alike."""
    for name in sorted({name for one in plan.loaded for name in named_by_value(one.plan)}):
        text = f"--scheduler: {name} is of this program alone, and a Dask cluster imports what it runs"
        raise BadInput(f"{text}: put it into a module, or leave the scheduler out")


def _drop(folder: Path) -> None:
    """Remove the sweep that is in a folder; a folder that is none is left alone.

    Raises:
        BadInput: it holds something else.
    """
    if not folder.exists():
        return
    if not is_sweep(folder):
        raise BadInput(f"{folder} holds no sweep, so it is not dropped: choose another --name")
    shutil.rmtree(folder)
