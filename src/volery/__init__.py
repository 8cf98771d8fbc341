"""volery: an asynchronous networked agent emulator over Eclipse Zenoh.

`run` runs a scenario, `load` reads a run from its folder; both return a `volery.experiments.run_arrays.Run`.
`sweep` runs a scenario over ranges of its fields and returns a `volery.experiments.sweeps.sweep_results.Sweep`.
`connect` connects to a running swarm, to inject faults.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from .experiments.run_arrays import Run
    from .experiments.swarm.running_swarm import RunningSwarm
    from .experiments.sweeps.sweep_results import Sweep

__all__ = ["connect", "load", "run", "sweep"]


def run(
    scenario: str | Path | Mapping[str, Any],
    *,
    overrides: Sequence[str] = (),
    engine: Literal["zenoh", "twin"] = "zenoh",
    pace: Literal["realtime", "lockstep"] = "realtime",
    speed: float = 1.0,
    runs: str | Path = "runs",
    name: str | None = None,
    figures: bool = False,
) -> Run:
    """Run a scenario to the end and return its arrays.

    >>> import volery
    >>> run = volery.run("dfa4", engine="twin", overrides=["duration=2 s"])
    >>> seen = run.samples("estimate")
    >>> seen.agents
    ('1', '2', '3', '4')
    >>> seen.estimate.shape  # samples, agents, components
    (39, 4, 3)
    >>> bool((abs(seen.estimate - seen.truth)[..., 0] < 0.05).all())  # altitude in metres
    True
    >>> sorted(set(run.frames["fate"].tolist()))
    ['delivered']
    >>> volery.load(run.folder).metrics.fidelity.late
    0

    Args:
        scenario: name of a built-in scenario, path of a YAML file, or the fields themselves.
        overrides: fields to set, such as "links.loss.bernoulli=0.3"; the last one of a field counts.
        engine: one process per agent over Zenoh, or all agents in this process.
        pace: by the wall clock, or as fast as the promises of the neighbours allow.
        speed: seconds of the run per second of the wall clock, in realtime pace.
        runs: folder of runs.
        name: name of the run's folder; by default time and scenario.
        figures: whether to draw the figures.
    Returns:
        The run; its `problems` tell what went wrong.
    Raises:
        BadInput: the scenario or an option is invalid.
        RunFailed: the swarm could not be started.
    """
    from .experiments.execution import Options
    from .experiments.run_arrays import run_scenario

    options = Options(engine, pace, speed, Path(runs), name, figures=figures)
    return run_scenario(scenario, overrides, options)


def sweep(  # noqa: PLR0913 - all but two by name
    scenario: str | Path | Mapping[str, Any],
    over: Mapping[str, str | Sequence[Any] | Mapping[str, Sequence[str]]] | Sequence[str],
    *,
    repeat: int = 1,
    random: int | None = None,
    overrides: Sequence[str] = (),
    engine: Literal["zenoh", "twin"] = "twin",
    runs: str | Path = "runs",
    name: str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    keep: bool = False,
    fresh: bool = False,
    progress: bool = False,
) -> Sweep:
    """Run a scenario over ranges of its fields, several times each, and return the table of all runs.

    Runs that were finished before an interruption are not repeated. In a script call it under
    `if __name__ == "__main__":`, as it starts worker processes.

    Args:
        scenario: name of a built-in scenario, path of a YAML file, or the fields themselves.
        over: field → a range such as "0:0.8:0.1", values, or named points with the fields that each sets, as in
            {"filter": {"plain": ["agents.rounds=3"], "fast": ["agents.rounds=9", "links.rate=1 Mbit/s"]}}.
        repeat: runs of each combination, with the scenario's seed and the seeds that follow it.
        random: number of random combinations to run instead of all.
        overrides: fields to set in all runs.
        engine: all agents in one process, or one process per agent over Zenoh in lockstep pace.
        runs: folder of runs.
        name: name of the sweep's folder; by default made from the swept fields.
        workers: number of parallel processes, by default one per core.
        scheduler: address of a Dask scheduler whose workers are used instead.
        keep: whether to keep the folder of each run.
        fresh: whether to discard existing results.
        progress: whether to show progress and the remaining time on standard error.
    Returns:
        The sweep; `table` has its columns as arrays with one entry per run, `folder` contains table.parquet.
    Raises:
        BadInput: a field that does not exist, an empty range, an invalid option, or results of another sweep.
        RunFailed: a run failed; finished runs are kept.
    """
    from rich.console import Console

    from .experiments.cli.progress_display import run_shown
    from .experiments.sweeps.sweep import SweepOptions, run_sweep
    from .experiments.sweeps.sweep_plan import plan_sweep

    options = SweepOptions(repeat, engine, Path(runs), name, workers, scheduler, keep, fresh)
    plan = plan_sweep(scenario, overrides, over, random, options.engine)
    for note in plan.notes:
        warnings.warn(note, stacklevel=2)
    return run_shown(plan, options, Console(stderr=True)) if progress else run_sweep(plan, options)


def load(folder: str | Path) -> Run:
    """Load the run in a folder, as `run` returned it.

    Raises:
        BadInput: no run in the folder, or a damaged record.
    """
    from .experiments.run_arrays import load_run

    return load_run(folder)


def connect(folder: str | Path) -> RunningSwarm:
    """Connect to the swarm that runs in a folder, to inject faults, query its status, and stop it.

    `connect("runs/demo").inject({"cut": "3-7", "for": "2 s"})` cuts a link of the swarm started by
    `volery run SCENARIO --detach --name demo`.

    Raises:
        BadInput: no swarm runs in the folder.
    """
    from .experiments.swarm.running_swarm import connect as connect_to

    return connect_to(folder)
