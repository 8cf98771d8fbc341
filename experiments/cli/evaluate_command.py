"""`volery evaluate`: repeats the evaluation of a run."""

from __future__ import annotations

import sys
from pathlib import Path

from ..analysis.metrics import write_metrics
from ..record.evaluation_pass import evaluate_run
from ..record.kept_sources import changed_sources
from ..record.plan_file import read_plan
from ..record.record import load
from ..record.run_files import EVALUATION_FILE, SOURCES_FOLDER
from .common_options import RUNS, RunName, RunsFolder
from .folders import finished_run
from .output import print_note, print_plain


def evaluate(run: RunName, /, *, runs: RunsFolder = RUNS) -> None:
    """Compute truth and central estimate of a run again, and write them with the metrics to its folder.

    This repeats an evaluation that was interrupted, or that failed in user code which has been corrected since. Modules
    that are not found any more are taken from the sources that the run has kept.
    """
    folder = finished_run(run, runs)
    sys.path.extend([str(Path.cwd()), str((folder / SOURCES_FOLDER).absolute())])
    record = load(folder, read_plan(folder), evaluated=False)
    write_metrics(evaluate_run(record, folder), folder)
    for sentence in changed_sources(folder):
        print_note(f"note: {sentence}")
    print_plain(str(folder / EVALUATION_FILE))
