"""`volery evaluate`: the comparison of a run with truth and central estimate, made again."""

from __future__ import annotations

from ..analysis.metrics import write_metrics
from ..record.evaluation_pass import evaluate_run
from ..record.record import load
from ..record.run_files import EVALUATION_FILE
from .common_options import RUNS, RunName, RunsFolder
from .folders import finished_run
from .output import print_plain


def evaluate(run: RunName, /, *, runs: RunsFolder = RUNS) -> None:
    """Compare all reports of a run with truth and central estimate, and leave what was found in its folder.

    `run` does this at its end. Do it again where it was broken off, or failed in code of your own that is mended now.
    """
    folder = finished_run(run, runs)
    write_metrics(evaluate_run(load(folder, evaluated=False), folder), folder)
    print_plain(str(folder / EVALUATION_FILE))
