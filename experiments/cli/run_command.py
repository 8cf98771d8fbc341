"""`volery run`: runs a scenario with a live display, or in the background, and prints its metrics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from ...agents.process import Pace
from ...errors import BadInput
from ..analysis.metrics import Metrics
from ..execution import Engine, Options, Outcome, execute
from ..scenario.load import LoadedScenario, resolved_yaml
from ..scenario.validate import validate_plan
from .common_options import RUNS, Overrides, RunsFolder, ScenarioSource
from .detach import detached
from .metric_tables import metrics_tables
from .output import output, print_error, print_plain
from .progress_display import Progress
from .reading import read_scenario

_STRICT = "Exit with code 3 if the machine could not keep up, or a link behaved otherwise than configured."
Strict = Annotated[bool, Parameter(help=_STRICT)]
Detach = Annotated[bool, Parameter(help="Run in the background; the command returns as soon as the swarm runs.")]
FAILED, NOT_CERTIFIED = 1, 3
_ENGINE = "zenoh: one process an agent, over Zenoh; twin: all agents in this process, as fast as it can."
_PACE = (
    "exact: by the wall clock where the machine keeps up, else time stretches, and the result is the same; lockstep: "
    "likewise, as fast as the machine can; realtime: by the wall clock come what may, late frames are counted."
)
_SPEED = "Nominal seconds per second of the wall clock; max: as fast as the machine can."
_NAME = "Name of the run's folder; by default date, time and scenario."
_LISTEN = "Endpoint of the Zenoh router; port 0 takes a free one."


@Parameter(name="*")
@dataclass(frozen=True)
class RunOptions(Options):
    """The options of a run, as the command line shows them."""

    engine: Annotated[Engine, Parameter(help=_ENGINE)] = Options.engine
    pace: Annotated[Pace, Parameter(help=_PACE)] = Options.pace
    speed: Annotated[float | Literal["max"], Parameter(help=_SPEED)] = Options.speed
    runs: RunsFolder = RUNS
    name: Annotated[str | None, Parameter(help=_NAME)] = Options.name
    listen: Annotated[str, Parameter(help=_LISTEN)] = Options.listen
    figures: Annotated[bool, Parameter(negative="--no-figures", help="Draw figures after the run.")] = Options.figures


DEFAULT_OPTIONS = RunOptions()


def run(
    scenario: ScenarioSource,
    /,
    *,
    set_: Overrides = (),
    options: RunOptions = DEFAULT_OPTIONS,
    strict: Strict = False,
    detach: Detach = False,
) -> int:
    """Run a scenario to its metrics and figures; Ctrl-C ends the run and keeps what was recorded."""
    read = read_scenario(scenario, set_)
    validate_plan(read.plan, read.scenario.overload)
    if detach:
        return detached(_words(scenario, set_, options, strict=strict), options)
    outcome = _watched(read, options)
    _print_metrics(outcome.metrics)
    for problem in outcome.record.problems:
        print_error(problem)
    _print_folder(outcome.folder)
    if outcome.record.problems:
        return FAILED
    return NOT_CERTIFIED if strict and not outcome.metrics.fidelity.as_asked else 0


def _watched(read: LoadedScenario, options: Options) -> Outcome:
    text = resolved_yaml(read.scenario)
    with Progress(output(), read.plan.name) as progress:
        return execute(read.plan, text, options, lambda status: progress.show(status.to_dict()), read.files)


def _print_metrics(metrics: Metrics) -> None:
    console = output()
    for table in metrics_tables(metrics):
        console.print(table)


def _print_folder(folder: Path) -> None:
    print_plain(f"run      {folder}")
    for figure in sorted(folder.glob("figures/*")):
        print_plain(f"figure   {figure}")


def _words(scenario: str, overrides: Sequence[str], options: Options, *, strict: bool) -> list[str]:
    """The same command line for the process in the background."""
    if options.engine == "twin":
        raise BadInput("--detach is for swarms over Zenoh: the twin cannot be spoken to while it runs")
    words = ["run", scenario, "--engine", options.engine, "--pace", options.pace, "--speed", str(options.speed)]
    words += ["--runs", str(options.runs), "--listen", options.listen]
    words += [word for override in overrides for word in ("--set", override)]
    words += [] if options.name is None else ["--name", options.name]
    words += [] if options.figures else ["--no-figures"]
    return [*words, "--strict"] if strict else words
