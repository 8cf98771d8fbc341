"""`volery sweep`: a scenario over ranges of its fields, several times each, on all cores or a Dask cluster."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from ...errors import BadInput
from ..analysis.statistics import CONFIDENCE
from ..execution import Engine
from ..sweeps.significance import contests, cost_of, default_by, defined, entries, main_measure
from ..sweeps.sweep import SweepOptions
from ..sweeps.sweep_plan import plan_sweep
from ..sweeps.sweep_results import TABLE_FILE, Sweep, is_sweep, load_sweep
from .common_options import RUNS, Overrides, RunsFolder, ScenarioSource
from .output import output, print_note, print_plain
from .progress_display import run_shown
from .sweep_tables import contest_table, notes, too_few_seeds

INTERRUPTED = 130
_OVER = (
    "KEY=RANGE, e.g. links.loss.bernoulli=0:0.8:0.1, agents.rounds=1,3,5, 'links.latency=log(1 ms, 100 ms, 5)'; may be "
    "given several times, all combinations are run."
)
_RANDOM = "Number of random combinations instead of all; ranges then need no step: 0:0.8, log(1 ms, 100 ms)."
_REPEAT = "Runs of each combination, with the scenario's seed and the following ones."
_ENGINE = "twin: all agents in one process; zenoh: one process an agent."
_PACE = "Of engine zenoh: sweeps run in lockstep pace, as fast as the machine can, and exact."
_NAME = "Name of the sweep's folder; by default the scenario and a hash of what is swept."
_WORKERS = "Number of parallel processes; by default one a core, and one with engine zenoh."
_SCHEDULER = "Address of a Dask scheduler whose workers run the sweep, e.g. tcp://10.0.0.1:8786."
Over = Annotated[tuple[str, ...], Parameter("--over", help=_OVER)]
Random = Annotated[int | None, Parameter(help=_RANDOM)]
Pace = Annotated[Literal["lockstep"] | None, Parameter(help=_PACE)]


@Parameter(name="*")
@dataclass(frozen=True)
class SweepCommandOptions(SweepOptions):
    """The options of a sweep, as the command line shows them."""

    repeat: Annotated[int, Parameter(help=_REPEAT)] = SweepOptions.repeat
    engine: Annotated[Engine, Parameter(help=_ENGINE)] = SweepOptions.engine
    runs: RunsFolder = RUNS
    name: Annotated[str | None, Parameter(help=_NAME)] = None
    workers: Annotated[int | None, Parameter(help=_WORKERS)] = None
    scheduler: Annotated[str | None, Parameter(help=_SCHEDULER)] = None
    keep: Annotated[bool, Parameter(help="Keep the folder of each run, in runs in the folder of the sweep.")] = False
    fresh: Annotated[bool, Parameter(help="Discard existing results and start again.")] = False


DEFAULT_OPTIONS = SweepCommandOptions()


def sweep(
    scenario: ScenarioSource,
    /,
    *,
    over: Over = (),
    set_: Overrides = (),
    random: Random = None,
    pace: Pace = None,
    options: SweepCommandOptions = DEFAULT_OPTIONS,
) -> int:
    """Run a scenario over ranges of its fields, and print the comparison.

    The same command continues an interrupted sweep, and adds repetitions to a finished one.
    """
    if pace is not None and options.engine == "twin":
        raise BadInput("--pace is for swarms over Zenoh: add --engine zenoh, or leave it out")
    plan = plan_sweep(scenario, set_, over, random, options.engine)
    for note in plan.notes:
        print_note(f"note: {note}")
    try:
        done = run_shown(plan, options, output())
    except KeyboardInterrupt:
        if not is_sweep(options.folder(plan)):
            raise
        left = load_sweep(options.folder(plan))
        print_note(
            f"interrupted after {len(left.rows)} of {len(left.rows) + left.missing} runs: the same command goes on"
        )
        return INTERRUPTED
    _print(done)
    return 0


def _print(sweep: Sweep) -> None:
    measure = main_measure(defined(sweep))
    held = contests(entries([sweep], measure), default_by([sweep]), CONFIDENCE, cost_of(measure))
    output().print(contest_table(measure, held, CONFIDENCE))
    for note in (*notes([sweep]), *too_few_seeds(held)):
        print_note(note)
    print_plain(f"sweep    {sweep.folder}")
    print_plain(f"table    {sweep.folder / Path(TABLE_FILE)}")
