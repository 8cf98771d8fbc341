"""`volery evaluate`: the comparison of a run with truth and central estimate, made again."""

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
    """Compare all reports of a run with truth and central estimate, and leave what was found in its folder.

    `run` does this at its end. Do it again where it was broken off, or failed in code of your own that is mended now.
    Of modules that are not found any more, those that the run has kept are used.
    """
    folder = finished_run(run, runs)
    sys.path.extend([str(Path.cwd()), str((folder / SOURCES_FOLDER).absolute())])
    record = load(folder, read_plan(folder), evaluated=False)
    write_metrics(evaluate_run(record, folder), folder)
    for sentence in changed_sources(folder):
        print_note(f"note: {sentence}")
    print_plain(str(folder / EVALUATION_FILE))
