"""volery: an asynchronous networked agent emulator over Eclipse Zenoh.

`run` runs a scenario, `load` reads a run from its folder; both give a `volery.experiments.results.Run`.
`connect` finds a swarm that is running, to inject faults.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from .experiments.remote import RunningSwarm
    from .experiments.results import Run

__all__ = ["connect", "load", "run"]


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
    from .experiments.results import run_scenario
    from .experiments.running import Options

    options = Options(engine, pace, speed, Path(runs), name, figures=figures)
    return run_scenario(scenario, overrides, options)


def load(folder: str | Path) -> Run:
    """The run in a folder, as `run` gave it.

    Raises:
        BadInput: no run there, or a damaged record.
    """
    from .experiments.results import load_run

    return load_run(folder)


def connect(folder: str | Path) -> RunningSwarm:
    """The swarm that runs in a folder, to inject faults, ask how it is, and end it.

    `connect("runs/demo").inject({"cut": "3-7", "for": "2 s"})` cuts a link of the swarm that
    `volery run SCENARIO --detach --name demo` has started.

    Raises:
        BadInput: no swarm runs there.
    """
    from .experiments import remote

    return remote.connect(folder)
