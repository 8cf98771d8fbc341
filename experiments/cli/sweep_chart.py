"""Options of `volery plot` for the figures of a sweep."""

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

Measure = Annotated[str | None, Parameter(help="Of a sweep: metric to draw; by default the error at the end.")]
Across = Annotated[str | None, Parameter(help="Of a sweep: key on the horizontal axis.")]
By = Annotated[str | None, Parameter(help="Of a sweep: key shown by colour.")]
Confidence = Annotated[float, Parameter(help="Of a sweep: confidence level of bands and bars, 0 to 1.")]


@Parameter(name="*")
@dataclass(frozen=True)
class ChartOptions:
    """Metric and keys of the figures of a sweep."""

    measure: Measure = None
    across: Across = None
    by: By = None
    confidence: Confidence = CONFIDENCE

    def draw(self, folder: Path, which: Sequence[str], out: Path | None, formats: Sequence[str]) -> list[Path]:
        """Draw the figures; the paths of the files.

        Raises:
            BadInput: no such figure, metric or key.
        """
        sweep = load_sweep(folder)
        known = defined(sweep)
        measure = main_measure(known) if self.measure is None else check_measure(self.measure, known)
        chart = chart_of(sweep, measure, self.across, self.by, self.confidence)
        return plot_sweep(chart, which, out or folder / "figures", formats)


NO_CHART = ChartOptions()
