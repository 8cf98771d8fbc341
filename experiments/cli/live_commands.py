"""Commands for running swarms: status, watch, stop."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.table import Table

from ...errors import BadInput, VoleryError
from ..swarm.running_swarm import RunningSwarm, running
from .common_options import RUNS, RunsFolder, SwarmName
from .folders import all_runs, find_run, is_running
from .output import output, print_plain
from .progress_display import Progress

AnySwarmName = Annotated[str | None, Parameter(help="A run: its folder, its name in --runs, or last; by default all.")]
_ASK_EVERY_S = 0.5
_COLUMNS = ("run", "time", "alive", "frames", "lost", "discarded", "late", "disagreement", "in force")


def running_swarms(runs: Path) -> list[RunningSwarm]:
    """All running swarms, in the order in which they were started."""
    reachable = running(runs)
    return [RunningSwarm(folder) for folder in all_runs(runs) if folder in reachable and is_running(folder)]


def running_swarm(run: str | None, runs: Path) -> RunningSwarm:
    """A running swarm, by default the newest.

    Raises:
        BadInput: it is not running, or none is.
    """
    if run is not None:
        folder = find_run(run, runs)
        if not is_running(folder):
            raise BadInput(f"{folder} is not running: `volery status` lists what is")
        return RunningSwarm(folder)
    present = running_swarms(runs)
    if not present:
        raise BadInput(f"no swarm is running in {runs}: `volery run SCENARIO --detach` starts one")
    return present[-1]


def status(run: AnySwarmName = None, *, runs: RunsFolder = RUNS) -> None:
    """Show the state of the running swarms."""
    swarms = running_swarms(runs) if run is None else [running_swarm(run, runs)]
    if not swarms:
        print_plain(f"no swarm is running in {runs}")
        return
    table = Table()
    for number, column in enumerate(_COLUMNS):
        table.add_column(column, justify="left" if number in (0, len(_COLUMNS) - 1) else "right", overflow="fold")
    for swarm in swarms:
        table.add_row(swarm.folder.name, *_cells(swarm.status()))
    output().print(table)


def _cells(state: Mapping[str, Any]) -> tuple[str, ...]:
    disagreement = state["disagreement"]
    return (
        f"{state['time_s']:.1f} of {state['duration_s']:g} s",
        f"{len(state['alive'])} of {state['agents']}",
        *(f"{count:,}" for count in (state["frames"], state["lost"], sum(state["discarded"].values()), state["late"])),
        "–" if disagreement is None else f"{disagreement:.3g}",
        "\n".join(f"{name}: {label}" for name, label in state["faults"].items()),
    )


def watch(run: SwarmName = None, *, runs: RunsFolder = RUNS) -> None:
    """Watch a running swarm until it ends; Ctrl-C leaves it running."""
    swarm = running_swarm(run, runs)
    folder = swarm.folder
    with Progress(output(), folder.name) as progress:
        while folder in running(folder.parent) and is_running(folder):
            try:
                progress.show(swarm.status())
            except VoleryError:
                if folder in running(folder.parent):
                    raise
            time.sleep(_ASK_EVERY_S)
    print_plain(f"{folder} has ended")


def stop(run: SwarmName = None, *, runs: RunsFolder = RUNS) -> None:
    """End a running swarm early; its record is kept and evaluated."""
    swarm = running_swarm(run, runs)
    print_plain(f"{swarm.folder}: {swarm.stop()}")
