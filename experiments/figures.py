"""Figures of a run, sized for papers: estimates against truth and oracle, disagreement through the faults, links.

Colours are those of Okabe and Ito, which are told apart with every kind of colour vision.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from ..topologies import natural_key
from ..transport.links import NANOSECONDS
from .accounting import account
from .fault_labels import fault_label
from .metrics import component_labels, courses
from .record import Record, load
from .samples import Samples, samples

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from matplotlib.lines import Line2D

FIGURES = ("estimates", "disagreement", "links", "overview")
_COLUMN_IN, _PAGE_IN = 3.5, 7.16
_PANEL_IN, _OVERVIEW_IN = 1.35, 4.4
_BLUE, _ORANGE, _VERMILION, _GREEN, _BLACK, _GREY = "#0072B2", "#E69F00", "#D55E00", "#009E73", "#000000", "#BBBBBB"
_STYLE: dict[str, Any] = {
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "font.size": 8,
    "axes.titlesize": 8,
    "legend.fontsize": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "legend.frameon": False,
    "savefig.dpi": 200,
}
_NAMED_AGENTS = 24
_LEVELS = 2


def plot(
    folder: Path,
    which: Iterable[str] = FIGURES,
    out: Path | None = None,
    formats: Sequence[str] = ("png", "pdf"),
    quantity: str | None = None,
) -> list[Path]:
    """Draw figures of the run in a folder; the paths of the files, in `out` or else the run's `figures`.

    Raises:
        BadInput: no such figure, format or quantity, or no run.
    """
    return draw(load(folder), which, out or folder / "figures", formats, quantity)


def draw(
    record: Record, which: Iterable[str], out: Path, formats: Sequence[str] = ("png",), quantity: str | None = None
) -> list[Path]:
    """Draw figures of a record into a folder; the paths of the files.

    Raises:
        BadInput: no such figure, format or quantity.
    """
    from matplotlib import style
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    known = FigureCanvasAgg.get_supported_filetypes()
    for format_ in formats:
        if format_ not in known:
            raise BadInput(f"figure format {format_!r} is not known: one of {', '.join(sorted(known))}")
    paths = []
    out.mkdir(parents=True, exist_ok=True)
    with style.context(_STYLE):
        for name in which:
            figure = Figure(layout="constrained")
            _draw(record, name, figure, quantity)
            for format_ in formats:
                paths.append(out / f"{name}.{format_}")
                figure.savefig(paths[-1])
    return paths


def _draw(record: Record, name: str, figure: Figure, quantity: str | None) -> None:
    if name not in FIGURES:
        raise BadInput(f"figure {name!r} is not known: one of {', '.join(FIGURES)}")
    if name == "links":
        figure.set_size_inches(_COLUMN_IN, 0.85 * _COLUMN_IN)
        draw_links(record, figure)
        return
    shown = quantity or _first_quantity(record)
    seen = samples(record, shown)
    if name == "estimates":
        figure.set_size_inches(_COLUMN_IN, 0.5 + _PANEL_IN * seen.estimate.shape[2])
        draw_estimates(record, shown, seen, figure)
    elif name == "disagreement":
        figure.set_size_inches(_COLUMN_IN, 0.7 * _COLUMN_IN)
        draw_disagreement(record, seen, figure)
    else:
        _draw_overview(record, shown, seen, figure)


def _draw_overview(record: Record, quantity: str, seen: Samples, figure: Figure) -> None:
    figure.set_size_inches(_PAGE_IN, _OVERVIEW_IN)
    left, right = figure.subfigures(1, 2, width_ratios=(1.1, 1.0), squeeze=False)[0]
    upper, lower = right.subfigures(2, 1, height_ratios=(1.0, 1.15), squeeze=False)[:, 0]
    draw_estimates(record, quantity, seen, left)
    draw_disagreement(record, seen, upper)
    draw_links(record, lower)


def _first_quantity(record: Record) -> str:
    if not record.quantities():
        raise BadInput("no agent reported an estimate: there is nothing to draw but links")
    return record.quantities()[0]


def draw_estimates(record: Record, quantity: str, seen: Samples, figure: Figure | SubFigure) -> None:
    """Every agent's estimate, the truth and the oracle over time, one panel for each component."""
    labels = component_labels(record, quantity, seen.estimate.shape[2])
    panels = figure.subplots(len(labels), 1, sharex=True, squeeze=False)[:, 0]
    time_s = seen.time_ns / NANOSECONDS
    truth, oracle = _any_agent(seen.truth), _any_agent(seen.oracle)
    for number, ((name, unit, factor), axes) in enumerate(zip(labels, panels, strict=True)):
        agents = axes.plot(time_s, factor * seen.estimate[:, :, number], color=_BLUE, alpha=0.35, linewidth=0.6)
        lines = {f"agents ({len(seen.agents)})": agents[0]}
        if not np.isnan(oracle[:, number]).all():
            (lines["oracle"],) = axes.plot(time_s, factor * oracle[:, number], color=_ORANGE, linewidth=0.9)
        if not np.isnan(truth[:, number]).all():
            (lines["truth"],) = axes.plot(time_s, factor * truth[:, number], color=_BLACK, linestyle="--")
        axes.set_ylabel(f"{name} ({unit})" if unit else name)
        _shade(record, axes, named=number == 0)
    _legend(figure, lines)
    panels[-1].set_xlabel("time (s)")
    panels[-1].set_xlim(0, record.last_ns / NANOSECONDS)


def draw_disagreement(record: Record, seen: Samples, figure: Figure | SubFigure) -> None:
    """Disagreement, error to oracle and error to truth over time, logarithmic, with the spans of the faults."""
    axes = figure.subplots()
    lines = {}
    for (name, course), colour in zip(courses(seen).items(), (_BLUE, _VERMILION, _GREEN), strict=True):
        shown = np.where(course.rms > 0, course.rms, np.nan)
        if not np.isnan(shown).all():
            (lines[name],) = axes.plot(course.time_ns / NANOSECONDS, shown, color=colour)
    if lines:
        axes.set_yscale("log")
    _shade(record, axes, named=True)
    _legend(figure, lines)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("rms two-norm (SI units)")
    axes.set_xlim(0, record.last_ns / NANOSECONDS)


def draw_links(record: Record, figure: Figure | SubFigure) -> None:
    """Which fraction of the frames that were put on the air came through, source by target; grey: no link."""
    names = [agent.name for agent in record.plan.agents]
    place = {name: number for number, name in enumerate(sorted(names, key=natural_key))}
    matrix = np.full((len(names), len(names)), np.nan)
    for (source, target), one in account(record).items():
        matrix[place[source], place[target]] = one.delivered_fraction
    axes = figure.subplots()
    axes.set_facecolor(_GREY)
    lowest = np.nanmin(matrix) if not np.isnan(matrix).all() else 0.0
    image = axes.imshow(100 * matrix, cmap="viridis", vmin=min(90.0, 100 * lowest), vmax=100, interpolation="nearest")
    bar = figure.colorbar(image, ax=axes, label="delivered (%)")
    bar.outline.set_visible(False)
    step = 1 + (len(names) - 1) // _NAMED_AGENTS
    ticks, labels = list(range(len(names)))[::step], list(place)[::step]
    axes.set_xticks(ticks, labels, fontsize=6)
    axes.set_yticks(ticks, labels, fontsize=6)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    axes.set_xlabel("to agent")
    axes.set_ylabel("from agent")


def _any_agent(reference: NDArray[np.float64]) -> NDArray[np.float64]:
    """What a reference says at each sample, (T, k): the mean over the agents for which it says anything."""
    known = ~np.isnan(reference)
    count = known.sum(axis=1)
    return np.where(count > 0, np.where(known, reference, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)


def _shade(record: Record, axes: Axes, *, named: bool) -> None:
    """The spans of the faults in grey, with their names at the top, on two levels where they stand close."""
    last_s = record.last_ns / NANOSECONDS
    for number, fault in enumerate(record.faults):
        from_s = fault.at_ns / NANOSECONDS
        until_s = last_s if fault.until_ns is None else fault.until_ns / NANOSECONDS
        axes.axvspan(from_s, min(until_s, last_s), color=_GREY, alpha=0.35, linewidth=0, zorder=0)
        if named:
            label = fault_label(fault, len(record.plan.links))
            height = 0.98 - 0.11 * (number % _LEVELS)
            axes.text(
                from_s, height, f" {label}", transform=axes.get_xaxis_transform(), va="top", fontsize=6, color="#444444"
            )


def _legend(figure: Figure | SubFigure, lines: dict[str, Line2D]) -> None:
    if lines:
        figure.legend(list(lines.values()), list(lines), loc="outside upper center", ncols=len(lines))
