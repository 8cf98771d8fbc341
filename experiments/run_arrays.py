"""A run as arrays, for Python: what `volery.run` and `volery.load` give."""

from __future__ import annotations

import asyncio
import threading
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from .analysis.export import frame_columns
from .analysis.metrics import Metrics, compute_metrics
from .execution import Options, execute
from .figures import run_figures as figures
from .record.record import Record, load
from .record.run_files import FIGURES_FOLDER
from .record.samples import Samples, samples
from .scenario.load import Source, load_scenario, resolved_yaml
from .scenario.validate import validate_plan


@dataclass(frozen=True)
class Run:
    """A run that is over: its folder and its record, and from these the arrays."""

    folder: Path
    record: Record

    @property
    def problems(self) -> tuple[str, ...]:
        """What went wrong, in the run or in its evaluation; empty for a run that is fine."""
        return self.record.problems

    @property
    def quantities(self) -> tuple[str, ...]:
        """What the agents reported, in alphabetical order."""
        return self.record.quantities()

    def samples(self, quantity: str = "estimate") -> Samples:
        """What all agents reported of a quantity side by side, with oracle and truth.

        time_ns (T,); estimate, oracle, truth (T, N, k) in the agents' units, NaN where there is none.

        Raises:
            BadInput: nobody reported it.
        """
        return samples(self.record, quantity)

    @cached_property
    def frames(self) -> dict[str, NDArray[Any]]:
        """Field of a frame → its value for each frame, (m,); "" or −1 where it is not known.

        Fields: source, target, sequence, size [B], start_ns, airtime_ns, due_ns, handed_ns, fate and others, see
        `FrameFate`.
        """
        return frame_columns(self.record)

    @cached_property
    def metrics(self) -> Metrics:
        """All metrics."""
        return compute_metrics(self.record)

    def plot(self, *which: str, out: Path | None = None, formats: Sequence[str] = ("png", "pdf")) -> list[Path]:
        """Draw figures, by default all, into `out` or else the run's `figures`; the paths of the files.

        Raises:
            BadInput: no such figure or format.
        """
        return figures.draw(self.record, which, out or self.folder / FIGURES_FOLDER, formats)


def run_scenario(
    scenario: Source, overrides: Sequence[str], given: Mapping[str, Any], options: Options, stop: threading.Event
) -> Run:
    """Run a scenario to the end, or until `stop` is set, without a display; `given` as for `load_scenario`.

    Raises:
        BadInput: the scenario or an option does not fit.
        RunFailed: the swarm could not be started.
    """
    read = load_scenario(scenario, overrides, given)
    for note in read.notes:
        warnings.warn(note, stacklevel=4)
    validate_plan(read.plan, read.scenario.overload)
    outcome = execute(read.plan, resolved_yaml(read.scenario), options, files=read.files, stop=stop)
    return Run(outcome.folder, outcome.record)


async def run_scenario_async(
    scenario: Source, overrides: Sequence[str], given: Mapping[str, Any], options: Options
) -> Run:
    """The same in another thread; where the task is cancelled, the run is ended first, and kept.

    Raises:
        BadInput: the scenario or an option does not fit.
        RunFailed: the swarm could not be started.
    """
    stop = threading.Event()
    running = asyncio.create_task(asyncio.to_thread(run_scenario, scenario, overrides, given, options, stop))
    try:
        return await asyncio.shield(running)
    except asyncio.CancelledError:
        stop.set()
        await asyncio.wait([running])
        raise


def load_run(folder: str | Path) -> Run:
    """The run in a folder.

    Raises:
        BadInput: no run there, or a damaged record.
    """
    return Run(Path(folder), load(Path(folder)))
