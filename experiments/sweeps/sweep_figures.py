"""Figures of a sweep: curves with bands, heat maps, and what error is bought with how many bytes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import BadInput
from ...names import did_you_mean
from ..analysis.statistics import CONFIDENCE, Interval, mean_interval
from ..figures.run_figures import (
    BLACK,
    BLUE,
    COLUMN_IN,
    GREEN,
    GREY,
    PAGE_IN,
    PURPLE,
    SKY,
    VERMILION,
    check_formats,
    save,
)
from .sweep_plan import SweptAxis
from .sweep_results import Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SWEEP_FIGURES = ("curves", "heat", "pareto")
BYTES = "links.bytes_per_agent_s"
_COLOURS = (BLUE, VERMILION, GREEN, PURPLE, SKY, BLACK)
_DASHES = ("-", "--", ":", "-.")
_MARKERS = "osD^v<>PX*"
_PANELS_A_ROW = 3
_DECADE = 10.0
_SETTINGS = {"links", "topology", "world", "faults", "groups", "duration"}
"""Fields of a scenario in which the axes of settings lie; what agents do is under `agents`, or a named point."""
Where = Mapping[str, str]


@dataclass(frozen=True)
class Chart:
    """What a figure of a sweep shows.

    `measure`; `across`: the axis from left to right; `by`: that whose values are told apart by colour, or in a heat map
    run upwards. What other axes there are have panels, one for each combination.
    """

    sweep: Sweep
    measure: str
    across: SweptAxis | None
    by: SweptAxis | None
    confidence: float = CONFIDENCE

    def place(self, cell: int) -> dict[str, str]:
        """Where a cell is on all axes."""
        plan = self.sweep.plan
        return dict(zip((axis.name for axis in plan.axes), plan.cells[cell].labels, strict=True))

    def panels(self, names: Sequence[str]) -> list[Where]:
        """The combinations of values of some axes that there are."""
        places = [tuple(self.place(index)[name] for name in names) for index in range(len(self.sweep.plan.cells))]
        return [dict(zip(names, place, strict=True)) for place in dict.fromkeys(places)]

    def intervals(self, measure: str, where: Where) -> list[tuple[Where, Interval]]:
        """Where each cell of a panel is, with mean and interval of a measure over the seeds."""
        found = [(self.place(cell), values) for cell, values in self.sweep.values(measure).items()]
        return [
            (place, mean_interval(list(values.values()), self.confidence))
            for place, values in found
            if where.items() <= place.items()
        ]

    def other_axes(self) -> list[str]:
        """Axes that are neither across nor by."""
        return [axis.name for axis in self.sweep.plan.axes if axis not in (self.across, self.by)]

    def settings(self) -> list[str]:
        """Axes that say what comes over a swarm, and not what its agents are made to do."""
        return [axis.name for axis in self.sweep.plan.axes if axis.name.partition(".")[0] in _SETTINGS]


def chart_of(
    sweep: Sweep, measure: str, across: str | None = None, by: str | None = None, confidence: float = CONFIDENCE
) -> Chart:
    """The chart of a measure; by default the first axis with numbers runs across, and the first other has colours.

    Raises:
        BadInput: no such axis, or one for both.
    """
    axes = {axis.name: axis for axis in sweep.plan.axes}
    for option, name in (("--across", across), ("--by", by)):
        if name is not None and name not in axes:
            raise BadInput(f"{option} {name}: no such axis{did_you_mean(name, axes)}")
    if across is not None and across == by:
        raise BadInput(f"--across and --by are both {by}: they are two axes")
    free = [axis for axis in axes.values() if axis.name not in (across, by)]
    numeric = [axis for axis in free if axis.numbers is not None]
    first = axes[across] if across else next(iter([*numeric, *free]), None)
    second = axes[by] if by else next((axis for axis in free if axis != first), None)
    return Chart(sweep, measure, first, second, confidence)


def plot_sweep(chart: Chart, which: Sequence[str], out: Path, formats: Sequence[str]) -> list[Path]:
    """Draw figures of a sweep into a folder, by default all for which it has anything; the paths of the files.

    Raises:
        BadInput: no such figure or format, or a sweep that has nothing for it.
    """
    check_formats(formats)
    wants = {"curves": chart.across is not None, "heat": chart.by is not None, "pareto": BYTES in chart.sweep.measures}
    for name in which:
        if name not in SWEEP_FIGURES:
            raise BadInput(f"figure {name!r} of a sweep is not known: one of {', '.join(SWEEP_FIGURES)}")
        if not wants[name]:
            raise BadInput(f"this sweep has too few axes for {name}: sweep --over one more key")
    drawn = {"curves": _curves, "heat": _heat, "pareto": _pareto}
    names = which or [name for name in SWEEP_FIGURES if wants[name]]
    return [path for name in names for path in save(partial(drawn[name], chart), f"sweep-{name}", out, formats)]


def _grid(panels: Sequence[Where], figure: Figure) -> list[tuple[Where, Axes]]:
    """Panels side by side, with their titles."""
    down = math.ceil(len(panels) / _PANELS_A_ROW)
    across = math.ceil(len(panels) / down)
    figure.set_size_inches(COLUMN_IN if across == 1 else PAGE_IN, 0.4 + 2.2 * down)
    axes = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False).ravel()
    for spare in axes[len(panels) :]:
        spare.set_visible(False)
    for where, panel in zip(panels, axes, strict=False):
        panel.tick_params(labelbottom=True)
        panel.set_title("\n".join(f"{name} = {label}" for name, label in where.items()), loc="left")
    return list(zip(panels, axes, strict=False))


def _looks(labels: Sequence[str]) -> dict[str, tuple[str, str, str]]:
    """Colour, dashes and marker of each, told apart without colour too."""
    return dict(zip(labels, zip(cycle(_COLOURS), cycle(_DASHES), cycle(_MARKERS), strict=False), strict=False))


def _label(axis: SweptAxis) -> str:
    return f"{axis.name} ({axis.unit})" if axis.unit else axis.name


def _logarithmic(values: Sequence[float]) -> bool:
    known = [value for value in values if math.isfinite(value)]
    return bool(known) and min(known) > 0 and max(known) > _DECADE * min(known)


def _curves(chart: Chart, figure: Figure) -> None:
    """The mean over the seeds against the axis across, with the band of its confidence interval."""
    axis, by = chart.across, chart.by
    assert axis is not None
    numbers = axis.numbers or tuple(float(place) for place in range(len(axis.labels)))
    position = dict(zip(axis.labels, numbers, strict=True))
    means: list[float] = []
    lines = {}
    for where, panel in _grid(chart.panels(chart.other_axes()), figure):
        found = chart.intervals(chart.measure, where)
        means += [one.mean for _, one in found]
        for label, (colour, dashes, marker) in _looks(by.labels if by else ("",)).items():
            intervals = sorted(
                (position[place[axis.name]], one) for place, one in found if by is None or place[by.name] == label
            )
            xs, ones = [x for x, _ in intervals], [one for _, one in intervals]
            (lines[label],) = panel.plot(
                xs, [one.mean for one in ones], color=colour, linestyle=dashes, marker=marker, markersize=3
            )
            lows, highs = [one.low for one in ones], [one.high for one in ones]
            panel.fill_between(xs, lows, highs, color=colour, alpha=0.2, linewidth=0)
        if axis.numbers is None:
            panel.set_xticks(numbers, axis.labels)
        elif _logarithmic(axis.numbers):
            panel.set_xscale("log")
        panel.set_xlabel(_label(axis))
    _finish(figure, chart.measure, means)
    if by:
        _legend(figure, lines, by.name)


def _finish(figure: Figure, measure: str, values: Sequence[float]) -> None:
    """Label the axes upwards, and make them logarithmic over more than a decade."""
    if _logarithmic(values):
        figure.axes[0].set_yscale("log")
    figure.supylabel(measure, fontsize="medium")


def _legend(figure: Figure, lines: Mapping[str, Any], title: str) -> None:
    figure.legend(list(lines.values()), list(lines), loc="outside upper center", ncols=min(3, len(lines)), title=title)


def _heat(chart: Chart, figure: Figure) -> None:
    """The mean over the seeds by colour, one axis across and one upwards; grey where there is none."""
    from matplotlib.colors import LogNorm, Normalize

    across, by = chart.across, chart.by
    assert across is not None
    assert by is not None
    panels = [
        (panel, chart.intervals(chart.measure, where))
        for where, panel in _grid(chart.panels(chart.other_axes()), figure)
    ]
    means = [one.mean for _, found in panels for _, one in found if math.isfinite(one.mean)]
    if not means:
        raise BadInput(f"{chart.measure} is finite nowhere, so that it has no heat map")
    norm = (LogNorm if _logarithmic(means) else Normalize)(min(means), max(means))
    for panel, found in panels:
        table = np.full((len(by.labels), len(across.labels)), np.nan)
        for place, one in found:
            row, column = by.labels.index(place[by.name]), across.labels.index(place[across.name])
            table[row, column] = one.mean if math.isfinite(one.mean) else np.nan
        panel.set_facecolor(GREY)
        image = panel.imshow(table, norm=norm, cmap="viridis", origin="lower", aspect="auto")
        panel.set_xticks(range(len(across.labels)), across.labels)
        panel.set_yticks(range(len(by.labels)), by.labels)
        panel.set_xlabel(across.name)
    figure.axes[0].set_ylabel(by.name)
    figure.colorbar(image, ax=figure.axes, label=chart.measure)


def _pareto(chart: Chart, figure: Figure) -> None:
    """Error against bytes of what agents can be made to do, a panel for each setting, and the front of each."""
    settings = chart.settings()
    choices = [axis for axis in (chart.by, chart.across, *chart.sweep.plan.axes) if axis and axis.name not in settings]
    coloured = choices[0] if choices else None
    looks = _looks(coloured.labels if coloured else ("",))
    seen: dict[str, Any] = {}
    errors: list[float] = []
    for where, panel in _grid(chart.panels(settings), figure):
        costs = [cost.mean for _, cost in chart.intervals(BYTES, where)]
        points = [
            (cost, place, one) for cost, (place, one) in zip(costs, chart.intervals(chart.measure, where), strict=True)
        ]
        points = [point for point in points if math.isfinite(point[2].mean)]
        errors += [one.mean for _, _, one in points]
        for label, (colour, _, marker) in looks.items():
            own = [(cost, one) for cost, place, one in points if coloured is None or place[coloured.name] == label]
            seen[label] = panel.errorbar(
                [cost for cost, _ in own],
                [one.mean for _, one in own],
                yerr=[
                    [one.mean - one.low for _, one in own],
                    [one.high - one.mean for _, one in own],
                ],
                color=colour,
                marker=marker,
                markersize=4,
                linestyle="none",
                elinewidth=0.6,
            )
        front = pareto_front([(cost, one.mean) for cost, _, one in points])
        panel.plot([x for x, _ in front], [y for _, y in front], color=BLACK, linewidth=0.6, drawstyle="steps-post")
        panel.set_xlabel("payload (B per agent and s)")
    _finish(figure, chart.measure, errors)
    if coloured:
        _legend(figure, seen, coloured.name)


def pareto_front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points that no other beats in one coordinate without losing in the other, smaller being better; ascending."""
    front: list[tuple[float, float]] = []
    for cost, error in sorted(points):
        if not front or error < front[-1][1]:
            front.append((cost, error))
    return front
