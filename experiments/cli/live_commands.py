"""Commands for running swarms: status, watch, stop."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.table import Table

from ...errors import BadInput, VoleryError
from ..swarm.control_client import call, running
from .common_options import RUNS, RunsFolder, SwarmName
from .folders import all_runs, find_run, is_running
from .output import output, print_plain
from .progress_display import Progress

AnySwarmName = Annotated[str | None, Parameter(help="A folder, its name in --runs, or last; without it, all that run.")]
_ASK_EVERY_S = 0.5
_COLUMNS = ("run", "time", "alive", "frames", "lost", "discarded", "late", "disagreement", "in force")


def running_swarms(runs: Path) -> list[Path]:
    """Folders of the swarms that run, in the order in which they began."""
    reachable = running(runs)
    return [folder for folder in all_runs(runs) if folder in reachable and is_running(folder)]


def running_swarm(run: str | None, runs: Path) -> Path:
    """The folder of a swarm that runs, by default the newest.

    Raises:
        BadInput: it does not run, or none does.
    """
    if run is not None:
        folder = find_run(run, runs)
        if not is_running(folder):
            raise BadInput(f"{folder} is not running: `volery status` lists what is")
        return folder
    present = running_swarms(runs)
    if not present:
        raise BadInput(f"no swarm is running in {runs}: `volery run SCENARIO --detach` starts one")
    return present[-1]


def status(run: AnySwarmName = None, *, runs: RunsFolder = RUNS) -> None:
    """Say how the swarms are that run now."""
    folders = running_swarms(runs) if run is None else [running_swarm(run, runs)]
    if not folders:
        print_plain(f"no swarm is running in {runs}")
        return
    table = Table()
    for number, column in enumerate(_COLUMNS):
        table.add_column(column, justify="left" if number in (0, len(_COLUMNS) - 1) else "right", overflow="fold")
    for folder in folders:
        table.add_row(folder.name, *_cells(call(folder, {"do": "status"})))
    output().print(table)


def _cells(said: Mapping[str, Any]) -> tuple[str, ...]:
    disagreement = said["disagreement"]
    return (
        f"{said['time_s']:.1f} of {said['duration_s']:g} s",
        f"{len(said['alive'])} of {said['agents']}",
        *(f"{count:,}" for count in (said["frames"], said["lost"], sum(said["discarded"].values()), said["late"])),
        "–" if disagreement is None else f"{disagreement:.3g}",
        "\n".join(f"{name}: {label}" for name, label in said["faults"].items()),
    )


def watch(run: SwarmName = None, *, runs: RunsFolder = RUNS) -> None:
    """Watch a running swarm until it ends; Ctrl-C leaves it running."""
    folder = running_swarm(run, runs)
    with Progress(output(), folder.name) as progress:
        while folder in running(folder.parent) and is_running(folder):
            try:
                progress.show(call(folder, {"do": "status"}))
            except VoleryError:
                if folder in running(folder.parent):
                    raise
            time.sleep(_ASK_EVERY_S)
    print_plain(f"{folder} has ended")


def stop(run: SwarmName = None, *, runs: RunsFolder = RUNS) -> None:
    """End a running swarm early; what was recorded is kept and measured."""
    folder = running_swarm(run, runs)
    print_plain(f"{folder}: {call(folder, {'do': 'stop'})}")
