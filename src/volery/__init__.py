"""volery: an asynchronous networked agent emulator over Eclipse Zenoh.

`run` runs a scenario, `load` reads a run from its folder; both give a `volery.experiments.run_arrays.Run`.
`sweep` runs a scenario over ranges of its fields and gives a `volery.experiments.sweeps.sweep_results.Sweep`.
`connect` finds a swarm that is running, to inject faults.
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
    """Run a scenario to the end and give its arrays.

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
        overrides: such as "links.loss.bernoulli=0.3"; the later wins.
        engine: one process an agent over Zenoh, or all of them in this one.
        pace: by the wall clock, or as fast as the promises of the neighbours allow.
        speed: seconds of the run in a second of the clock, in realtime pace.
        runs: folder of runs.
        name: of the run's folder, instead of time and scenario.
        figures: whether to draw the figures.
    Returns:
        The run; what went wrong in it is in its `problems`.
    Raises:
        BadInput: the scenario or an option does not fit.
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
    """Run a scenario over ranges of its fields, many times each, and give the table of all runs.

    What was finished before an interruption is not run again. In a script call it under `if __name__ == "__main__":`,
    as processes of their own do the work.

    Args:
        scenario: name of a built-in scenario, path of a YAML file, or the fields themselves.
        over: field → a range such as "0:0.8:0.1", values, or named points with what each sets, as in
            {"filter": {"plain": ["agents.rounds=3"], "fast": ["agents.rounds=9", "links.rate=1 Mbit/s"]}}.
        repeat: runs of each combination, with the scenario's seed and those that follow it.
        random: so many random combinations instead of all.
        overrides: what is set in all runs.
        engine: all agents in one process, or one process an agent over Zenoh in lockstep pace.
        runs: folder of runs.
        name: of the sweep's folder, instead of one that follows from what is swept.
        workers: processes at once, by default one a core.
        scheduler: address of a Dask scheduler whose workers do the work instead.
        keep: whether to keep the folder of each run.
        fresh: whether to drop results that are there.
        progress: whether to show on the standard error how far it is, and the time left.
    Returns:
        The sweep; `table` has its columns as arrays, one entry a run, `folder` is where table.parquet is.
    Raises:
        BadInput: a field that does not exist, an empty range, an option that does not fit, results of another sweep.
        RunFailed: a run could not be carried through; what is finished is kept.
    """
    from rich.console import Console

    from .experiments.sweeps.sweep import SweepOptions, run_sweep
    from .experiments.sweeps.sweep_plan import plan_sweep
    from .experiments.sweeps.sweep_progress import run_shown

    options = SweepOptions(repeat, engine, Path(runs), name, workers, scheduler, keep, fresh)
    plan = plan_sweep(scenario, overrides, over, random, options.engine)
    for note in plan.notes:
        warnings.warn(note, stacklevel=2)
    return run_shown(plan, options, Console(stderr=True)) if progress else run_sweep(plan, options)


def load(folder: str | Path) -> Run:
    """The run in a folder, as `run` gave it.

    Raises:
        BadInput: no run there, or a damaged record.
    """
    from .experiments.run_arrays import load_run

    return load_run(folder)


def connect(folder: str | Path) -> RunningSwarm:
    """The swarm that runs in a folder, to inject faults, ask how it is, and end it.

    `connect("runs/demo").inject({"cut": "3-7", "for": "2 s"})` cuts a link of the swarm that
    `volery run SCENARIO --detach --name demo` has started.

    Raises:
        BadInput: no swarm runs there.
    """
    from .experiments.swarm.running_swarm import connect as connect_to

    return connect_to(folder)
