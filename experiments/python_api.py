"""volery from Python: the functions that `import volery` gives."""

from __future__ import annotations

import inspect
import re
import reprlib
import threading
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from pathlib import Path
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import TypeAdapter, ValidationError

from ..agents.process import Pace
from ..errors import BadInput, VoleryError
from ..names import did_you_mean
from .execution import Options
from .run_arrays import Run, load_run, run_scenario, run_scenario_async
from .swarm.running_swarm import RunningSwarm
from .swarm.running_swarm import connect as connect_to
from .sweeps.sweep import SweepOptions, run_sweep
from .sweeps.sweep_plan import plan_sweep
from .sweeps.sweep_results import Sweep

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def checked(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Check the arguments of a function by its annotations, at the call.

    Raises:
        TypeError: an argument that it does not have, with the nearest name.
        BadInput: a value of another type, or one that is not allowed; the message names the argument.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def call(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        name = function.__name__
        for word in kwargs:
            if word not in signature.parameters:
                raise TypeError(f"{name}() has no argument {word!r}{did_you_mean(word, signature.parameters)}")
        for word, value in signature.bind(*args, **kwargs).arguments.items():
            adapter, text = _adapters(function)[word]
            try:
                adapter.validate_python(value, strict=True)
            except ValidationError:
                raise BadInput(f"{name}(): {word} is {reprlib.repr(value)}, it must be {text}") from None
        try:
            return function(*args, **kwargs)
        except VoleryError as error:
            raise error.with_traceback(None) from _users_error(error)

    return call


def _users_error(error: BaseException) -> BaseException | None:
    """The error in a user's code that one comes from, if any: of how volery finds errors the message says enough."""
    cause = error.__cause__
    return _users_error(cause) if isinstance(cause, VoleryError | ValidationError) else cause


@cache
def _adapters(function: Callable[..., Any]) -> dict[str, tuple[TypeAdapter[Any], str]]:
    """Argument → what checks it, and its type in words."""
    hints = get_type_hints(function)
    return {name: (TypeAdapter(hints[name]), _in_words(hints[name])) for name in inspect.signature(function).parameters}


def _in_words(hint: Any) -> str:
    if get_origin(hint) is Literal:
        return " or ".join(map(repr, get_args(hint)))
    if get_origin(hint) is Union and any(get_origin(one) is Literal for one in get_args(hint)):
        return " or ".join(map(_in_words, get_args(hint)))
    return re.sub(r"\b[a-z_.]+\.", "", inspect.formatannotation(hint))


def _given(**fields: Any) -> dict[str, Any]:
    return {name: value for name, value in fields.items() if value is not None}


@checked
def run(  # noqa: PLR0913 - all but one by name
    scenario: str | Path | Mapping[str, Any],
    *,
    topology: Any = None,
    agents: str | type | Mapping[str, Any] | None = None,
    world: str | type | Mapping[str, Any] | None = None,
    overrides: Sequence[str] = (),
    engine: Literal["zenoh", "twin"] = "zenoh",
    pace: Pace = "exact",
    speed: float | Literal["max"] = 1.0,
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

    In a notebook it waits too; Ctrl-C, or the button that interrupts, ends the run early and keeps what was recorded.

    Args:
        scenario: name of a built-in scenario, path of a YAML file, or the fields themselves; wherever they name code,
            a class or function may stand itself, also one that is defined in the script or notebook.
        topology: instead of the scenario's: a networkx graph, or a mapping as in a scenario.
        agents: instead of the scenario's: a kind or class, or a mapping as in a scenario.
        world: instead of the scenario's, likewise.
        overrides: fields to set, such as "links.loss.bernoulli=0.3"; the last one of a field counts.
        engine: one process per agent over Zenoh, or all agents in this process.
        pace: "exact", by the wall clock where the machine keeps up, else time stretches and the result stays the same;
            "lockstep", likewise but as fast as the machine can; "realtime", by the wall clock come what may.
        speed: seconds of the run per second of the wall clock, or "max", as fast as the machine can.
        runs: folder of runs.
        name: name of the run's folder; by default time and scenario.
        figures: whether to draw the figures.
    Returns:
        The run; its `problems` tell what went wrong.
    Raises:
        BadInput: the scenario or an option is invalid; no folder is left behind.
        RunFailed: the swarm could not be started.
    """
    options = Options(engine, pace, speed, Path(runs), name, figures=figures)
    return run_scenario(
        scenario, overrides, _given(topology=topology, agents=agents, world=world), options, threading.Event()
    )


@checked
async def run_async(  # noqa: PLR0913 - all but one by name
    scenario: str | Path | Mapping[str, Any],
    *,
    topology: Any = None,
    agents: str | type | Mapping[str, Any] | None = None,
    world: str | type | Mapping[str, Any] | None = None,
    overrides: Sequence[str] = (),
    engine: Literal["zenoh", "twin"] = "zenoh",
    pace: Pace = "exact",
    speed: float | Literal["max"] = 1.0,
    runs: str | Path = "runs",
    name: str | None = None,
    figures: bool = False,
) -> Run:
    """Run a scenario as `run` does, while the event loop goes on; a task that is cancelled ends its run early."""
    options = Options(engine, pace, speed, Path(runs), name, figures=figures)
    return await run_scenario_async(scenario, overrides, _given(topology=topology, agents=agents, world=world), options)


@checked
def sweep(  # noqa: PLR0913 - all but two by name
    scenario: str | Path | Mapping[str, Any],
    over: Mapping[str, str | Sequence[Any] | Mapping[str, Sequence[str]]] | Sequence[str],
    *,
    repeat: int = 1,
    random: int | None = None,
    topology: Any = None,
    agents: str | type | Mapping[str, Any] | None = None,
    world: str | type | Mapping[str, Any] | None = None,
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

    Runs that were finished before an interruption are not repeated.

    Args:
        scenario: name of a built-in scenario, path of a YAML file, or the fields themselves.
        over: field → a range such as "0:0.8:0.1", values, or named points with the fields that each sets, as in
            {"filter": {"plain": ["agents.rounds=3"], "fast": ["agents.rounds=9", "links.rate=1 Mbit/s"]}}.
        repeat: runs of each combination, with the scenario's seed and the seeds that follow it.
        random: number of random combinations to run instead of all.
        topology: as for `run`.
        agents: as for `run`.
        world: as for `run`.
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

    from .cli.progress_display import run_shown

    options = SweepOptions(repeat, engine, Path(runs), name, workers, scheduler, keep, fresh)
    plan = plan_sweep(
        scenario, overrides, over, random, options.engine, _given(topology=topology, agents=agents, world=world)
    )
    for note in plan.notes:
        warnings.warn(note, stacklevel=3)
    return run_shown(plan, options, Console(stderr=True)) if progress else run_sweep(plan, options)


@checked
def load(folder: str | Path) -> Run:
    """Load the run in a folder, as `run` returned it.

    Raises:
        BadInput: no run in the folder, or a damaged record.
    """
    return load_run(folder)


@checked
def connect(folder: str | Path) -> RunningSwarm:
    """Connect to the swarm that runs in a folder, to inject faults, query its status, and stop it.

    `connect("runs/demo").inject({"cut": "3-7", "for": "2 s"})` cuts a link of the swarm started by
    `volery run SCENARIO --detach --name demo`.

    Raises:
        BadInput: no swarm runs in the folder.
    """
    return connect_to(folder)
