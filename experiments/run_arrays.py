"""A run as arrays, for Python: what `volery.run` and `volery.load` give."""

from __future__ import annotations

import asyncio
import threading
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from ..transport.links import NANOSECONDS
from .analysis.export import frame_columns
from .analysis.metrics import Metrics, compute_metrics
from .execution import Options, execute
from .figures.run_figures import as_html, figures, write
from .fresh_replay import verify_afresh
from .record.record import Record, load
from .record.samples import Samples, samples
from .scenario.load import Source, load_scenario, resolved_yaml
from .scenario.validate import validate_plan
from .verify import Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

_WAKE_EVERY_S = 0.2


class Figures(dict[str, "Figure"]):
    """Name → figure of matplotlib; a notebook shows them."""

    def __repr__(self) -> str:
        return f"Figures: {', '.join(self)}"

    def _repr_html_(self) -> str:
        return "".join(map(as_html, self.values()))


@dataclass(frozen=True, repr=False)
class Run:
    """A run that is over: its folder and its record, and from these the arrays."""

    folder: Path
    record: Record

    def __repr__(self) -> str:
        info, plan = self.record.info, self.record.plan
        engine = " ".join(filter(None, (info.get("engine"), info.get("pace"))))
        title = f"Run {plan.name}: {info.get('status', 'without run.json')}, {engine}"
        lines = [f"{title}, {len(plan.agents)} agents, {self.record.last_ns / NANOSECONDS:g} s"]
        if self.record.evaluation is not None:
            lines += [repr(self.samples(name)) for name in self.record.evaluation.compared()]
        return "\n".join([*lines, *self.problems, f"folder {self.folder}"])

    def _repr_html_(self) -> str:
        head, *_ = repr(self).splitlines()
        rows = [("steady-state rms", "error to truth", "error to oracle")]
        for name, quantity in self.metrics.quantities.items():
            for one in quantity.components:
                label = f"{name}: {one.name} ({one.unit})" if one.unit else f"{name}: {one.name}"
                truth, oracle = ("–" if isnan(rms) else f"{rms:.3g}" for rms in (one.truth_rms, one.oracle_rms))
                rows.append((label, truth, oracle))
        table = "".join(f"<tr><td>{'</td><td>'.join(map(escape, row))}</td></tr>" for row in rows)
        notes = [self.metrics.fidelity.verdict, *self.problems, f"folder {self.folder}"]
        return f"<b>{escape(head)}</b><table>{table}</table>{'<br>'.join(map(escape, notes))}"

    @property
    def problems(self) -> tuple[str, ...]:
        """What went wrong, in the run or in its evaluation; empty for a run that is fine."""
        return self.record.problems

    @property
    def quantities(self) -> tuple[str, ...]:
        """What the agents reported, in alphabetical order."""
        return self.record.quantities()

    def samples(self, quantity: str | None = None) -> Samples:
        """What all agents reported of a quantity, or of the first, side by side, with oracle and truth.

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

    def to_xarray(self, quantity: str | None = None) -> Dataset:
        """What all agents reported of a quantity, or of the first, see `Samples.to_xarray`."""
        return self.samples(quantity).to_xarray()

    def plot(
        self,
        *which: str,
        quantity: str | None = None,
        out: str | Path | None = None,
        formats: Sequence[str] = ("png", "pdf"),
    ) -> Figures:
        """Draw figures, by default all; a notebook shows what is returned.

        Args:
            which: some of estimates, disagreement, links, age and overview.
            quantity: what estimates and disagreement are of; by default the first that was reported.
            out: a folder to save them in, too.
            formats: to save them as.
        Raises:
            BadInput: no such figure, quantity or format.
        """
        found = figures(self.record, which, quantity)
        if out is not None:
            write(found, Path(out), formats)
        return Figures(found)

    def verify(self) -> Verdict:
        """Replay the run in the twin, in a new interpreter, and compare bit for bit, as `volery verify` does.

        Raises:
            RunFailed: an error in the code of an agent.
        """
        return verify_afresh(self.folder)


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
        while not running.done():  # a notebook's kernel learns of Ctrl-C when its loop wakes up
            await asyncio.wait([running], timeout=_WAKE_EVERY_S)
        return running.result()
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
