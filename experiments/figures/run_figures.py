"""Figures of a run, sized for papers: estimates against truth and oracle, disagreement through the faults, links.

Colours are those of Okabe and Ito, which are told apart with every kind of colour vision.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...quantities import Component, Floats
from ...topologies import natural_key
from ...transport.links import NANOSECONDS
from ..analysis.accounting import account
from ..analysis.ages import age_courses, age_metrics
from ..analysis.metrics import courses
from ..record.record import Record
from ..record.samples import Samples, samples
from ..scenario.fault_labels import fault_label
from ..whole_files import whole_file

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

FIGURES = ("estimates", "disagreement", "links", "age", "overview", "errors")
_SCREEN_DPI = 120
_OF_LINKS = ("links", "age")
COLUMN_IN, PAGE_IN = 3.5, 7.16
_PANEL_IN, _OVERVIEW_IN, _PAD_IN = 1.35, 4.4, 0.07
_PANELS, _OVERVIEW_PANELS = 12, 6
_LEAST_SHARE = 1e-4
"""Of the largest error: the smallest that is shown where errors do not contract to nothing."""
_LONG = 5.0
"""A line is interrupted for so many times the step between reports that nine of ten are not above."""
_COLUMNS, _OVERVIEW_COLUMNS = 6, 3
"""Agents that have columns of their own, where each estimates something else."""
SKY, BLUE, VERMILION, GREEN, PURPLE, BLACK = "#56B4E9", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000"
GREY, DARK_GREY = "#D9D9D9", "#444444"
STYLE: dict[str, Any] = {
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "font.size": 8,
    "axes.titlesize": 8,
    "legend.fontsize": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 0.9,
    "legend.frameon": False,
    "savefig.dpi": 200,
}
_NAMED_AGENTS = 24
_AGE_SPANS = 300
_LEVELS, _LEVEL_PT, _LETTER_IN, _PANEL_SHARE = 4, 7, 0.043, 0.75
"""Names of faults: levels above each other, their distance, width of a letter of 6 pt, and a panel's of its figure."""


def draw(
    record: Record,
    which: Iterable[str],
    out: Path,
    formats: Sequence[str] = ("png", "pdf"),
    quantity: str | None = None,
) -> list[Path]:
    """Draw figures of a record into a folder; the paths of the files.

    Without a name in `which`, every figure for which the run has anything to show.

    Raises:
        BadInput: no such figure, format or quantity.
    """
    check_formats(formats)
    return write(figures(record, which, quantity), out, formats)


def figures(record: Record, which: Iterable[str] = (), quantity: str | None = None) -> dict[str, Figure]:
    """Name → figure of a record, in the style of all.

    Without a name in `which`, every figure for which the run has anything to show.

    Raises:
        BadInput: no such figure or quantity.
    """
    names = list(which) or _all_of(record, quantity)
    _check("figure", names, FIGURES)
    return {name: _styled(partial(_draw, name, record, quantity)) for name in names}


def _all_of(record: Record, quantity: str | None) -> list[str]:
    """The figures for which a run has anything to show; errors by agent where each has its own."""
    if record.evaluation is None or not record.evaluation.compared():
        return list(_OF_LINKS)
    is_shared = record.evaluation.quantity(quantity or record.evaluation.compared()[0]).is_shared
    return [name for name in FIGURES if name != "errors" or not is_shared]


def save(draw_into: Callable[[Figure], None], name: str, out: Path, formats: Sequence[str]) -> list[Path]:
    """Draw a figure in the style of all and leave it in a folder, in each format; the paths of the files."""
    return write({name: _styled(draw_into)}, out, formats)


def _styled(draw_into: Callable[[Figure], None]) -> Figure:
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE):
        figure = Figure(layout="constrained")
        draw_into(figure)
    return figure


def write(figures: Mapping[str, Figure], out: Path, formats: Sequence[str]) -> list[Path]:
    """Leave figures in a folder, by their names, in each format; the paths of the files.

    Raises:
        BadInput: no such format.
    """
    from matplotlib import style

    check_formats(formats)
    out.mkdir(parents=True, exist_ok=True)
    paths = {out / f"{name}.{format_}": figure for name, figure in figures.items() for format_ in formats}
    with style.context(STYLE):
        for path, figure in paths.items():
            with whole_file(path) as unfinished:
                figure.savefig(unfinished)
    return list(paths)


def as_html(figure: Figure) -> str:
    """A figure as an image inside of HTML."""
    data = BytesIO()
    figure.savefig(data, format="png", dpi=_SCREEN_DPI)
    return f'<img src="data:image/png;base64,{b64encode(data.getvalue()).decode()}">'


def check_formats(formats: Sequence[str]) -> None:
    """Refuse what figures cannot be saved as.

    Raises:
        BadInput: such a format; the message lists those that there are.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    _check("figure format", formats, sorted(FigureCanvasAgg.get_supported_filetypes()))


def _check(what: str, names: Iterable[str], known: Sequence[str]) -> None:
    for name in names:
        if name not in known:
            raise BadInput(f"{what} {name!r} is not known: one of {', '.join(known)}")


def _draw(name: str, record: Record, quantity: str | None, figure: Figure) -> None:
    """Draw one of FIGURES, in its size."""
    if name in _OF_LINKS:
        draw_of_links, height = (draw_links, 0.85) if name == "links" else (draw_ages, 0.7)
        figure.set_size_inches(COLUMN_IN, height * COLUMN_IN)
        draw_of_links(record, figure)
        return
    seen = samples(record, quantity)
    if name in _OF_COMPONENTS:
        own = name == "errors" or not seen.is_shared
        components = seen.difference_components if name == "errors" else seen.components
        figure.set_size_inches(PAGE_IN if own else COLUMN_IN, 0.5 + _PANEL_IN * min(_PANELS, len(components)))
        if own:  # the last number below an axis reaches beyond it
            figure.set_layout_engine("constrained", w_pad=_PAD_IN)
        _OF_COMPONENTS[name](record, seen, figure)
    elif name == "disagreement":
        figure.set_size_inches(COLUMN_IN, 0.7 * COLUMN_IN)
        draw_disagreement(record, seen, figure)
    else:
        figure.set_size_inches(PAGE_IN, _OVERVIEW_IN)
        left, right = figure.subfigures(1, 2, width_ratios=(1.1, 1.0), squeeze=False)[0]
        upper, lower = right.subfigures(2, 1, height_ratios=(1.0, 1.15), squeeze=False)[:, 0]
        draw_left = draw_estimates if seen.is_shared or np.isnan(seen.truth_error).all() else draw_errors
        draw_left(record, seen, left, _OVERVIEW_PANELS, _OVERVIEW_COLUMNS)
        draw_disagreement(record, seen, upper)
        draw_links(record, lower)


def draw_estimates(
    record: Record, seen: Samples, figure: Figure | SubFigure, most: int = _PANELS, most_agents: int = _COLUMNS
) -> None:
    """Estimates, truth and oracle over time, one panel for each of the first components.

    Agents that have their own have their own columns, with two standard deviations about what they believe.
    """
    if seen.is_shared:
        panels = _panels(record, figure, seen.components[:most], [""])
        lines = [_draw_all(axes, seen, number) for (number, _), axes in np.ndenumerate(panels)]
    else:
        panels = _panels(record, figure, seen.components[:most], seen.agents[:most_agents])
        lines = [_draw_own(axes, seen, agent, number) for (number, agent), axes in np.ndenumerate(panels)]
    _legend(figure, {label: line for each in lines for label, line in each.items()})
    columns = () if seen.is_shared else seen.agents
    panels[-1, 0].set_xlabel(f"time (s){_left_out(seen.components, most, columns, most_agents)}")


def draw_errors(
    record: Record, seen: Samples, figure: Figure | SubFigure, most: int = _PANELS, most_agents: int = _COLUMNS
) -> None:
    """Each agent's error to the truth over time, a panel a component, in two of the deviations that it stated."""
    panels = _panels(record, figure, seen.difference_components[:most], seen.agents[:most_agents])
    lines: dict[str, Artist] = {}
    for (number, agent), axes in np.ndenumerate(panels):
        course = _Course(seen, agent)
        factor = seen.difference_components[number].factor
        half = 2.0 * factor * course.of(seen.deviation[:, agent, number])
        if not np.isnan(half).all():
            lines["± 2 σ"] = axes.fill_between(course.time_s, -half, half, color=SKY, alpha=0.35, linewidth=0)
        error = factor * course.of(seen.truth_difference[:, agent, number])
        (lines["error to truth"],) = axes.plot(course.time_s, error, color=BLUE, linewidth=0.7)
        axes.axhline(0.0, color=BLACK, linewidth=0.5)
    _legend(figure, lines)
    panels[-1, 0].set_xlabel(f"time (s){_left_out(seen.difference_components, most, seen.agents, most_agents)}")


def _left_out(components: Sequence[Component], most: int, agents: Sequence[str], most_agents: int) -> str:
    """A note below a figure about what does not fit into it."""
    parts = ((most, len(components), "components"), (most_agents, len(agents), "agents"))
    return "".join(f"; {shown} of {count} {what}" for shown, count, what in parts if count > shown)


def _panels(
    record: Record, figure: Figure | SubFigure, components: Sequence[Component], agents: Sequence[str]
) -> NDArray[Any]:
    """Panels over time, a row a component and a column an agent, with the spans of the faults."""
    panels: NDArray[Any] = figure.subplots(len(components), len(agents), sharex=True, squeeze=False)
    panels[-1, 0].set_xlim(0, record.last_ns / NANOSECONDS)
    for (row, column), axes in np.ndenumerate(panels):
        name, unit, _ = components[row]
        if column == 0:
            axes.set_ylabel(f"{name} ({unit})" if unit else name)
        if row == 0 and agents[column]:
            axes.set_title(f"agent {agents[column]}")
        if row == len(components) - 1:
            axes.set_xlabel("time (s)")
        _shade(record, axes, named=row == 0 and not agents[column])
    figure.align_ylabels(panels[:, 0])
    return panels


def _draw_all(axes: Axes, seen: Samples, number: int) -> dict[str, Artist]:
    """One component of what all agents estimate; what there is for a legend."""
    time_s, factor = seen.time_ns / NANOSECONDS, seen.components[number].factor
    agents = axes.plot(time_s, factor * seen.estimate[:, :, number], color=SKY, alpha=0.5, linewidth=0.5)
    lines: dict[str, Artist] = {f"agents ({len(seen.agents)})": agents[0]}
    oracle, truth = (factor * _any_agent(of)[:, number] for of in (seen.oracle, seen.truth))
    return lines | _draw_references(axes, time_s, oracle, truth)


class _Course:
    """The reports of one agent over time, interrupted where it did not report for long."""

    def __init__(self, seen: Samples, agent: int) -> None:
        self._known = np.flatnonzero(~np.isnan(seen.estimate[:, agent]).any(axis=1))
        steps = np.diff(seen.time_ns[self._known])
        long = steps > _LONG * np.quantile(steps, 0.9) if len(steps) else steps > 0
        self._breaks = np.flatnonzero(long) + 1
        self.time_s = self.of(seen.time_ns) / NANOSECONDS

    def of(self, values: NDArray[Any]) -> Floats:
        """Values of the agent, (T,), at its reports, NaN where the line is interrupted."""
        return np.insert(values[self._known].astype(np.float64), self._breaks, np.nan)


def _draw_own(axes: Axes, seen: Samples, agent: int, number: int) -> dict[str, Artist]:
    """One component of what an agent estimates of its own; what there is for a legend."""
    course, factor = _Course(seen, agent), seen.components[number].factor
    estimate = factor * course.of(seen.estimate[:, agent, number])
    lines: dict[str, Artist] = {}
    if seen.states_deviations:
        half = 2.0 * factor * course.of(seen.deviation[:, agent, number])
        low, high = estimate - half, estimate + half
        lines["± 2 σ"] = axes.fill_between(course.time_s, low, high, color=SKY, alpha=0.35, linewidth=0)
    (lines["agent"],) = axes.plot(course.time_s, estimate, color=BLUE, linewidth=0.7)
    oracle, truth = (factor * course.of(of[:, agent, number]) for of in (seen.oracle, seen.truth))
    return lines | _draw_references(axes, course.time_s, oracle, truth)


def _draw_references(axes: Axes, time_s: Floats, oracle: Floats, truth: Floats) -> dict[str, Artist]:
    """Oracle and truth, where they are known."""
    lines: dict[str, Artist] = {}
    if not np.isnan(oracle).all():
        (lines["oracle"],) = axes.plot(time_s, oracle, color=VERMILION)
    if not np.isnan(truth).all():
        (lines["truth"],) = axes.plot(time_s, truth, color=BLACK, linestyle="--")
    return lines


def draw_disagreement(record: Record, seen: Samples, figure: Figure | SubFigure) -> None:
    """Disagreement, error to oracle and error to truth over time, logarithmic, with the spans of the faults.

    Where agents have their own, the errors of most agents, from the 10 to the 90 % quantile, are a band.
    """
    axes = figure.subplots()
    lines = {}
    errors = {"error to oracle": seen.oracle_error, "error to truth": seen.truth_error}
    looks = ((BLUE, ":", 3), (VERMILION, "-", 2), (GREEN, "-", 1))
    for (name, course), (colour, dashes, order) in zip(courses(seen).items(), looks, strict=True):
        shown = np.where(course.rms > 0, course.rms, np.nan)
        if not np.isnan(shown).all():
            times = course.time_ns / NANOSECONDS
            (lines[name],) = axes.plot(times, shown, color=colour, linestyle=dashes, zorder=order)
            if not seen.is_shared and len(seen.agents) > 1:
                known = ~np.isnan(errors[name]).all(axis=1)
                low, high = np.nanquantile(errors[name][known], (0.1, 0.9), axis=1)
                axes.fill_between(times[known], low, high, color=colour, alpha=0.2, linewidth=0, zorder=0.5)
    if lines:
        axes.set_yscale("log")
    if not seen.is_shared:  # the rounding of a first report that equals the oracle's is of no interest
        axes.set_ylim(bottom=max(axes.get_ylim()[0], _LEAST_SHARE * axes.get_ylim()[1]))
    _shade(record, axes, named=True)
    _legend(figure, lines)
    axes.set_xlabel("time (s)" if seen.is_shared else "time (s); bands: 10 to 90 % of agents")
    axes.set_ylabel("rms error (SI units)")
    axes.set_xlim(0, record.last_ns / NANOSECONDS)


def draw_links(record: Record, figure: Figure | SubFigure) -> None:
    """Which fraction of the frames that were put on the air came through, source by target; grey: no link."""
    names = [agent.name for agent in record.plan.agents]
    place = {name: number for number, name in enumerate(sorted(names, key=natural_key))}
    matrix = np.full((len(names), len(names)), np.nan)
    for (source, target), one in account(record).items():
        matrix[place[source], place[target]] = one.delivered_fraction
    axes = figure.subplots()
    axes.set_facecolor(GREY)
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


def draw_ages(record: Record, figure: Figure | SubFigure) -> None:
    """Age of information over time, the largest in each of many short spans: median and range of the links."""
    axes, ages_of = figure.subplots(), age_courses(record)
    edges = np.linspace(0, record.last_ns, _AGE_SPANS + 1).astype(np.int64)
    peaks = {link: course.peaks(edges) / 1e6 for link, course in ages_of.items() if len(course.time_ns)}
    lines: dict[str, Artist] = {}
    if peaks:
        times = (edges[1:] + edges[:-1]) / 2 / NANOSECONDS
        every = np.stack(list(peaks.values()))
        known = ~np.isnan(every).all(axis=0)
        seen, at = every[:, known], times[known]
        middle, low, high = np.nanmedian(seen, axis=0), np.nanmin(seen, axis=0), np.nanmax(seen, axis=0)
        lines["all links"] = axes.fill_between(at, low, high, color=SKY, alpha=0.35, linewidth=0)
        (lines["median"],) = axes.plot(at, middle, color=BLUE)
        oldest = max(peaks, key=lambda link: age_metrics(ages_of[link]).mean_ns)
        label = f"oldest: {'→'.join(oldest)}"
        (lines[label],) = axes.plot(times, peaks[oldest], color=VERMILION, linewidth=0.7)
        axes.set_yscale("log")
    _shade(record, axes, named=True)
    _legend(figure, lines)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("age of information (ms)")
    axes.set_xlim(0, max(record.last_ns, 1) / NANOSECONDS)


_OF_COMPONENTS: dict[str, Callable[[Record, Samples, Figure], None]] = {
    "estimates": draw_estimates,
    "errors": draw_errors,
}


def _any_agent(reference: NDArray[np.float64]) -> NDArray[np.float64]:
    """What a reference says at each sample, (T, k): the mean over the agents for which it says anything."""
    known = ~np.isnan(reference)
    count = known.sum(axis=1)
    return np.where(count > 0, np.where(known, reference, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)


def _shade(record: Record, axes: Axes, *, named: bool) -> None:
    """The spans of the faults in grey, their names above the panel on as many levels as keep them apart.

    Where there is no room on the highest level either, a name is left out; the tables have them all.
    """
    last_s = record.last_ns / NANOSECONDS
    letter_s = _LETTER_IN / (_PANEL_SHARE * axes.figure.bbox.width / axes.figure.dpi) * last_s
    free_from_s = [-last_s] * _LEVELS
    for fault in record.faults_in_effect:
        from_s = fault.at_ns / NANOSECONDS
        until_s = last_s if fault.until_ns is None else fault.until_ns / NANOSECONDS
        axes.axvspan(from_s, min(until_s, last_s), color=GREY, alpha=0.6, linewidth=0, zorder=0)
        label = fault_label(fault, len(record.plan.links))
        left_s = max(0.0, min(from_s, last_s - letter_s * len(label)))
        level = next((level for level, free_s in enumerate(free_from_s) if free_s <= left_s), None)
        if named and level is not None:
            free_from_s[level] = left_s + letter_s * (len(label) + 1)
            place, above = ("data", "axes fraction"), (0, 2 + _LEVEL_PT * level)
            axes.annotate(label, (left_s, 1.0), above, place, "offset points", fontsize=6, color=DARK_GREY)


def _legend(figure: Figure | SubFigure, lines: Mapping[str, Artist]) -> None:
    if lines:
        legend = figure.legend(list(lines.values()), list(lines), loc="outside upper center", ncols=len(lines))
        for line in legend.get_lines():
            line.set(alpha=1.0, linewidth=1.2)
