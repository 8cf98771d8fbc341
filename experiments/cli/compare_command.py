"""`volery compare`: runs or sweeps side by side, with confidence intervals and tests."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ...errors import BadInput
from ..analysis.statistics import CONFIDENCE
from ..sweeps.significance import (
    RUN,
    Entry,
    check_measure,
    contests,
    cost_of,
    default_by,
    defined,
    entries,
    entries_of_runs,
    main_measure,
    measured_runs,
)
from ..sweeps.sweep_results import load_sweep
from .common_options import RUNS, RunsFolder
from .folders import find_sweep, finished_run
from .output import output, print_note, print_plain
from .sweep_tables import contest_table, notes, to_plain, too_few_seeds

_MEASURE = "Metric to compare, e.g. links.bytes_per_agent_s; repeatable; by default the error at the end."
_BY = "Axes whose values are compared; by default the sweeps, or the first axis that is not numeric."
OF_RUNS = ("links.delivered_fraction", "links.bytes_per_agent_s")
Names = Annotated[str, Parameter(help="Run or sweep: its folder, or its name in --runs.")]
Measures = Annotated[tuple[str, ...], Parameter("--measure", help=_MEASURE)]
By = Annotated[tuple[str, ...], Parameter("--by", help=_BY)]
Confidence = Annotated[float, Parameter(help="Confidence level of the intervals, 0 to 1.")]
AsJson = Annotated[bool, Parameter("--json", help="Print one JSON object: metric → comparisons.")]


def compare(
    name: Names,
    /,
    *more: Names,
    measure: Measures = (),
    by: By = (),
    confidence: Confidence = CONFIDENCE,
    json_: AsJson = False,
    runs: RunsFolder = RUNS,
) -> None:
    """Compare runs or sweeps: means with intervals, and paired tests over common seeds."""
    names = (name, *more)
    folders = [find_sweep(each, runs) for each in names]
    if all(folders):
        measures, found, axes, remarks = _of_sweeps([folder for folder in folders if folder], measure)
    elif not any(folders):
        measures, found, axes, remarks = _of_runs([finished_run(each, runs) for each in names], measure)
    else:
        raise BadInput("compare runs with runs or sweeps with sweeps: these are of both kinds")
    held = {one: contests(found(one), by or axes, confidence, cost_of(one)) for one in measures}
    if json_:
        print_plain(json.dumps({one: to_plain(those) for one, those in held.items()}, indent=1, ensure_ascii=False))
        return
    for one, those in held.items():
        output().print(contest_table(one, those, confidence))
    for note in dict.fromkeys((*remarks, *(note for those in held.values() for note in too_few_seeds(those)))):
        print_note(note)


_Found = tuple[Sequence[str], Callable[[str], list[Entry]], tuple[str, ...], Sequence[str]]


def _of_sweeps(folders: Sequence[Path], measures: Sequence[str]) -> _Found:
    """Metrics, a function from a metric to its entries, axes that are compared by default, and notes."""
    sweeps = [load_sweep(folder) for folder in folders]
    known = [one for one in defined(sweeps[0]) if all(one in sweep.measures for sweep in sweeps)]
    chosen = [check_measure(one, known) for one in measures] or [main_measure(known)]
    return chosen, lambda one: entries(sweeps, one), default_by(sweeps), list(notes(sweeps))


def _of_runs(folders: Sequence[Path], measures: Sequence[str]) -> _Found:
    found: dict[str, Any] = measured_runs(folders)
    known = sorted({one for _, _, values in found.values() for one, value in values.items() if value is not None})
    chosen = [check_measure(one, known) for one in measures] or [main_measure(known), *OF_RUNS]
    return chosen, lambda one: entries_of_runs(found, one), (RUN,), []
