"""Folders of runs and sweeps, by path, by name in the folder of runs, or `last`."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from ...errors import BadInput
from ...names import did_you_mean
from ..record.run_files import INFO_FILE, RECORD_FILE, SCENARIO_FILE, SWEEP_FILE

LAST = "last"


def all_runs(runs: Path) -> list[Path]:
    """The folders of runs, in the order of their start."""
    return sorted((mark.parent for mark in runs.glob(f"*/{SCENARIO_FILE}")), key=_began)


def _began(folder: Path) -> tuple[int, str]:
    return (folder / SCENARIO_FILE).stat().st_mtime_ns, folder.name


def find_run(run: str, runs: Path) -> Path:
    """The folder of a run.

    Raises:
        BadInput: no such run.
    """
    present = all_runs(runs)
    if run == LAST and present:
        return present[-1]
    for folder in (runs / run, Path(run)):
        if (folder / SCENARIO_FILE).is_file() or (folder / RECORD_FILE).is_file():
            return folder
    if sweep := find_sweep(run, runs):
        raise BadInput(f"{sweep} is a sweep and no run: `volery compare` and `volery plot` show it")
    sweeps = [mark.parent.name for mark in runs.glob(f"*/{SWEEP_FILE}")]
    if not present and not sweeps:
        raise BadInput(f"there is no run {run!r}, and {runs} has none: `volery run SCENARIO` makes one")
    near = did_you_mean(run, [*(folder.name for folder in present), *sweeps]) if run not in (LAST, ".") else ""
    raise BadInput(f"there is no run {run!r} in {runs}{near}; RUN is a folder, its name in --runs, or {LAST}")


def find_sweep(name: str, runs: Path) -> Path | None:
    """The folder of a sweep by name or path; None if there is no such sweep."""
    return next((folder for folder in (runs / name, Path(name)) if (folder / SWEEP_FILE).is_file()), None)


def finished_run(run: str, runs: Path) -> Path:
    """The folder of a run that has ended.

    Raises:
        BadInput: no such run, or it is running.
    """
    folder = find_run(run, runs)
    if is_running(folder):
        raise BadInput(f"{folder} still runs: `volery watch` shows it, `volery stop` ends it")
    return folder


def is_running(folder: Path) -> bool:
    """Whether the process of a run is alive."""
    info = _info(folder)
    return info.get("status") == "running" and _is_alive(info["pid"])


def run_of(pid: int, runs: Path) -> Path | None:
    """The folder of the newest run of a process, or None."""
    return next((folder for folder in reversed(all_runs(runs)) if _info(folder).get("pid") == pid), None)


def _info(folder: Path) -> dict[str, Any]:
    """The content of run.json; empty if it is missing or damaged."""
    try:
        info: dict[str, Any] = json.loads((folder / INFO_FILE).read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return info


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
