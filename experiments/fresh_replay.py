"""Verification in a new interpreter, with the kept sources of the run first on its path."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from pathlib import Path

from ..errors import BadInput, RunFailed, VoleryError
from .record.kept_sources import changed_sources
from .record.run_files import SOURCES_FOLDER
from .verify import Verdict, verify

_PACKAGE = Path(__file__).parents[1]


def verify_afresh(folder: Path) -> Verdict:
    """Replay the run in a folder in a new interpreter, with its kept sources, and compare.

    Raises:
        BadInput: no run there, or a damaged record.
        RunFailed: an error in the code of an agent.
    """
    paths = [str(_PACKAGE.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-P", "-m", __spec__.name, str(folder.absolute())]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=False)  # noqa: S603
    try:
        answer = json.loads(done.stdout)
    except ValueError as error:
        raise RunFailed(f"the replay of {folder} ended with exit code {done.returncode} and no verdict") from error
    if "error" in answer:
        raise BadInput(answer["error"]) if answer["exit_code"] == BadInput.exit_code else RunFailed(answer["error"])
    return Verdict(answer["certified"], (*answer["lines"], *changed_sources(folder)))


def _main(folder: Path) -> None:
    """Print the verdict as JSON; all other output goes to standard error."""
    sys.path.insert(0, str(folder / SOURCES_FOLDER))
    with contextlib.redirect_stdout(sys.stderr):
        try:
            verdict = verify(folder)
            answer = {"certified": verdict.certified, "lines": verdict.lines}
        except VoleryError as error:
            answer = {"error": str(error), "exit_code": error.exit_code}
    sys.stdout.write(json.dumps(answer))


if __name__ == "__main__":
    _main(Path(sys.argv[1]))
