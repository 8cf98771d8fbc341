"""Commands for runs that have ended: metrics, plot, export, verify, recover."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ...errors import BadInput
from ..analysis.export import FORMATS, write
from ..analysis.metrics import write_metrics
from ..figures.run_figures import FIGURES, draw
from ..fresh_replay import verify_afresh
from ..record.mcap_file import recover
from ..record.record import load
from ..record.run_files import FIGURES_FOLDER
from ..sweeps.sweep_figures import SWEEP_FIGURES
from .common_options import RUNS, RunName, RunsFolder
from .diagram import NO_DIAGRAM, Diagram
from .folders import find_sweep, finished_run
from .metric_tables import metrics_tables
from .output import output, print_plain
from .sweep_chart import NO_CHART, ChartOptions

_THRESHOLD = "Error below which a run has converged, in the unit of the estimate; by default twice its steady state."
More = Annotated[str, Parameter(help="Further runs.")]
AsJson = Annotated[bool, Parameter("--json", help="Print one JSON object: name of the run's folder → metrics.")]
Threshold = Annotated[float | None, Parameter(help=_THRESHOLD)]
_WHICH = f"Figures to draw, of a run {', '.join(FIGURES)}, of a sweep {', '.join(SWEEP_FIGURES)}; all by default."
Which = Annotated[str, Parameter(help=_WHICH)]
Formats = Annotated[tuple[str, ...], Parameter("--format", help="File format, such as png, pdf or svg; repeatable.")]
Quantity = Annotated[str | None, Parameter(help="Quantity to draw; by default the first reported one.")]
FiguresFolder = Annotated[Path | None, Parameter(help="Folder for the figures; by default figures in the run's.")]
Csv = Annotated[bool, Parameter(help="Write estimates.csv and frames.csv, with text in quotes.")]
Parquet = Annotated[bool, Parameter(help="Write estimates.parquet and frames.parquet.")]
Npz = Annotated[bool, Parameter(help="Write run.npz, for numpy.")]
ExportFolder = Annotated[Path | None, Parameter(help="Folder for the files; by default export in the run's.")]


def metrics(
    run: RunName,
    /,
    *more: More,
    json_: AsJson = False,
    threshold: Threshold = None,
    runs: RunsFolder = RUNS,
) -> None:
    """Compute and print the metrics of runs, and write them to metrics.json."""
    folders = [finished_run(name, runs) for name in (run, *more)]
    found = {folder.resolve().name: write_metrics(load(folder), folder, threshold) for folder in folders}
    if json_:
        print_plain(json.dumps({name: json.loads(one.to_json()) for name, one in found.items()}, indent=1))
        return
    console = output()
    for name, one in found.items():
        console.rule(name)
        for table in metrics_tables(one):
            console.print(table)


def plot_run(
    run: RunName,
    /,
    *which: Which,
    format_: Formats = ("png", "pdf"),
    quantity: Quantity = None,
    out: FiguresFolder = None,
    diagram: Diagram = NO_DIAGRAM,
    chart: ChartOptions = NO_CHART,
    runs: RunsFolder = RUNS,
) -> None:
    """Draw the figures of a run or a sweep and print their paths.

    With --space-time the diagram of a window instead: who sent what to whom, and where it went. With --animate a film
    in plan view: where everybody is and is believed to be, and which links carry frames.
    """
    if sweep := find_sweep(run, runs):
        if quantity is not None or diagram != NO_DIAGRAM:
            raise BadInput("--quantity and --space-time are of runs: of a sweep choose a --measure")
        for path in chart.draw(sweep, which, out, format_):
            print_plain(str(path))
        return
    if chart != NO_CHART:
        raise BadInput("--measure, --across and --by are of the figures of a sweep, and this is a run")
    folder = finished_run(run, runs)
    record, into = load(folder), out or folder / FIGURES_FOLDER
    paths = diagram.draw(record, into, format_)
    if which or not paths:
        paths += draw(record, which, into, format_, quantity)
    for path in paths:
        print_plain(str(path))


def export_run(
    run: RunName,
    /,
    *,
    csv: Csv = False,
    parquet: Parquet = False,
    npz: Npz = False,
    out: ExportFolder = None,
    runs: RunsFolder = RUNS,
) -> None:
    """Write a run as tables of estimates and frames, or as arrays, and print the paths."""
    wanted = {"csv": csv, "parquet": parquet, "npz": npz}
    if not any(wanted.values()):
        raise BadInput("export as what? Add --csv, --parquet or --npz")
    folder = finished_run(run, runs)
    record, into = load(folder), out or folder / "export"
    for format_ in FORMATS:
        if wanted[format_]:
            for path in write(record, format_, into):
                print_plain(str(path))


def verify_run(run: RunName, /, *, runs: RunsFolder = RUNS) -> int:
    """Replay a run in the twin, live faults included, and compare every estimate and every frame's fate bit for bit.

    The exit code is 3 if the run is not certified.
    """
    verdict = verify_afresh(finished_run(run, runs))
    for line in verdict.lines:
        print_plain(line)
    return verdict.exit_code


def recover_run(run: RunName, /, *, runs: RunsFolder = RUNS) -> None:
    """Repair a record that was cut off, as by kill -9 of the supervisor; the damaged file is kept."""
    print_plain(str(recover(finished_run(run, runs))))
