"""A run in the background, started in a session of its own."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from ..execution import Options
from ..record.run_files import CONTROL_FILE
from .folders import run_of
from .output import print_error, print_plain

OUTPUT_FILE = "output.txt"
_LOOK_EVERY_S = 0.05


def detached(words: Sequence[str], options: Options) -> int:
    """Start `volery` with these arguments and wait until its swarm runs or it has ended; the exit code.

    Its output goes to output.txt in the run's folder.
    """
    options.runs.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile("w+", dir=options.runs, prefix=".output-", delete=False) as out:
        path = Path(out.name)
        command = [sys.executable, "-m", __package__.partition(".")[0], *words]
        process = subprocess.Popen(  # noqa: S603 - our own command line, parsed and checked
            command, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT, start_new_session=True
        )
        code, folder = _wait(process, options.runs)
        if folder is None:
            path.unlink()
        else:
            path.rename(folder / OUTPUT_FILE)
        return _report(code, folder, out)


def _wait(process: subprocess.Popen[bytes], runs: Path) -> tuple[int | None, Path | None]:
    """The exit code, None if the process is running, and the folder of its run, None if there is none."""
    while True:
        code = process.poll()
        folder = run_of(process.pid, runs)
        if code is not None or (folder is not None and (folder / CONTROL_FILE).exists()):
            return code, folder
        time.sleep(_LOOK_EVERY_S)


def _report(code: int | None, folder: Path | None, out: IO[str]) -> int:
    if code:
        out.seek(0)
        print_error(out.read().strip().removeprefix("error:").strip())
    if folder is not None:
        print_plain(str(folder))
    return code or 0
