"""The options of `volery plot` for the figures of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..analysis.statistics import CONFIDENCE
from ..sweeps.significance import check_measure, defined, main_measure
from ..sweeps.sweep_figures import chart_of, plot_sweep
from ..sweeps.sweep_results import load_sweep

Measure = Annotated[str | None, Parameter(help="Of a sweep: what to draw; by default the error at the end.")]
Across = Annotated[str | None, Parameter(help="Of a sweep: the key that runs from left to right.")]
By = Annotated[str | None, Parameter(help="Of a sweep: the key that is told apart by colour.")]
Confidence = Annotated[float, Parameter(help="Of the bands and bars of a sweep.")]


@Parameter(name="*")
@dataclass(frozen=True)
class ChartOptions:
    """What the figures of a sweep show."""

    measure: Measure = None
    across: Across = None
    by: By = None
    confidence: Confidence = CONFIDENCE

    def draw(self, folder: Path, which: Sequence[str], out: Path | None, formats: Sequence[str]) -> list[Path]:
        """Draw them; the paths of the files.

        Raises:
            BadInput: no such figure, measure or key.
        """
        sweep = load_sweep(folder)
        known = defined(sweep)
        measure = main_measure(known) if self.measure is None else check_measure(self.measure, known)
        chart = chart_of(sweep, measure, self.across, self.by, self.confidence)
        return plot_sweep(chart, which, out or folder / "figures", formats)


NO_CHART = ChartOptions()
