"""The six figures of the contest."""

# ruff: noqa: TID251 - it is a user of the package
from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from contest import CONDITIONS, FILTERS, GRAPHS
from matplotlib.colors import LogNorm, TwoSlopeNorm
from matplotlib.figure import Figure

from volery.experiments.figures.run_figures import (
    BLACK,
    BLUE,
    DARK_GREY,
    GREEN,
    GREY,
    PAGE_IN,
    PURPLE,
    SKY,
    VERMILION,
    save,
)

if TYPE_CHECKING:
    from contest_report import Results

LOSSES = {"no loss": 0.0, "loss 0.3": 0.3, "loss 0.6": 0.6}
LINES = {
    "kalman": ("Kalman consensus 2009", GREY, "-"),
    "diffusion": ("diffusion", SKY, "-"),
    "measurements": ("on measurements", VERMILION, "-"),
    "sums": ("on measurements, running sums", VERMILION, "--"),
    "information": ("on information", BLUE, "-"),
    "hybrid": ("hybrid, ω = N", GREEN, "--"),
    "contributions": ("hybrid by contributions", GREEN, "-"),
    "intersection": ("covariance intersection", PURPLE, "-"),
}
WHITE = "#FFFFFF"
CAP = 10.0
"""Errors beyond so many times the centralised one are drawn there."""
SETTINGS = [(graph, condition) for graph in GRAPHS for condition in CONDITIONS]


def draw(results: Results, out: Path) -> list[Path]:
    """All of them, as PNG."""
    figures = {
        "errors": errors,
        "anees": consistency,
        "loss": against_loss,
        "conditions": by_condition,
        "pareto": pareto,
        "ranks": ranks,
    }
    paths = []
    for name, into in figures.items():

        def drawn(figure: Figure, into: Any = into) -> None:
            into(figure, results)

        paths += save(drawn, f"contest-{name}", out, ["png"])
    return paths


def _map(figure: Figure, values: np.ndarray, text: list[list[str]], norm: Any, cmap: str, label: str) -> None:
    figure.set_size_inches(PAGE_IN, 4.0)
    axes = figure.subplots()
    image = axes.imshow(values, norm=norm, cmap=cmap, aspect="auto")
    axes.set_yticks(range(len(FILTERS)), list(FILTERS))
    axes.set_xticks(range(len(SETTINGS)), [condition for _, condition in SETTINGS], rotation=90)
    axes.tick_params(length=0)
    for place, graph in enumerate(GRAPHS):
        axes.text((place + 0.5) * len(CONDITIONS) - 0.5, -0.8, graph, ha="center", va="bottom")
        if place:
            axes.axvline(place * len(CONDITIONS) - 0.5, color="white", linewidth=2)
    for row, column in np.ndindex(*values.shape):
        colour = WHITE if norm(values[row, column]) > 0.85 else BLACK
        axes.text(column, row, text[row][column], ha="center", va="center", fontsize=4.2, color=colour)
    ticks = [1, 2, 3, 5, 10] if norm.vmax == CAP else [0, 0.5, 1, 2, 3, 4]
    bar = figure.colorbar(image, ax=axes, label=label, pad=0.01)
    bar.set_ticks(ticks, labels=[str(tick) for tick in ticks])
    bar.minorticks_off()


def errors(figure: Figure, results: Results) -> None:
    """Error over the centralised one, of each filter in each setting."""
    table = [[results.ratio(who, condition, graph) for graph, condition in SETTINGS] for who in FILTERS]
    text = [["∞" if math.isinf(value) else f"{value:.3g}" for value in row] for row in table]
    values = np.clip(np.array(table), 1.0, CAP)
    _map(figure, values, text, LogNorm(1.0, CAP), "YlOrRd", "error of the position over that of the centralised filter")


def consistency(figure: Figure, results: Results) -> None:
    """ANEES of each filter in each setting: below one cautious, above one overconfident."""
    table = [[results.anees(who, condition, graph) for graph, condition in SETTINGS] for who in FILTERS]
    text = [["∞" if math.isinf(value) else f"{value:.2g}" for value in row] for row in table]
    values = np.clip(np.array(table), 0.0, 4.0)
    _map(figure, values, text, TwoSlopeNorm(1.0, 0.0, 4.0), "RdBu_r", "ANEES")


def against_loss(figure: Figure, results: Results) -> None:
    """Error against loss, a panel for each graph, with 95 % intervals over the seeds."""
    from contest_report import interval

    figure.set_size_inches(PAGE_IN, 2.6)
    panels = figure.subplots(1, len(GRAPHS), sharey=True)
    for axes, graph in zip(panels, GRAPHS, strict=True):
        for who, colour, dash in LINES.values():
            middle = [results.ratio(who, condition, graph) for condition in LOSSES]
            spans = [interval(results.of(who, condition, graph)) for condition in LOSSES]
            axes.fill_between(LOSSES.values(), *zip(*spans, strict=True), color=colour, alpha=0.15, linewidth=0)
            axes.plot(LOSSES.values(), middle, dash, color=colour, marker="o", markersize=2, label=who)
        axes.set(title=graph, xlabel="loss", yscale="log", ylim=(0.9, 8), xticks=list(LOSSES.values()))
        axes.set_yticks([1, 1.5, 2, 3, 5], ["1", "1.5", "2", "3", "5"], minor=False)
        axes.set_yticks([], minor=True)
    panels[0].set_ylabel("error over the centralised one")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)


def by_condition(figure: Figure, results: Results) -> None:
    """What each condition does to each filter: its error over its own without loss."""
    figure.set_size_inches(PAGE_IN, 3.0)
    axes = figure.subplots()
    shown = [condition for condition in CONDITIONS if condition != "no loss"]
    colours = (SKY, BLUE, PURPLE, GREEN, VERMILION, DARK_GREY)
    width = 0.8 / len(shown)
    contenders = [who for who in FILTERS if who != "local only"]
    for number, (condition, colour) in enumerate(zip(shown, colours, strict=True)):
        worse = [_worse(results, who, condition) for who in contenders]
        axes.bar(np.arange(len(contenders)) + (number - 2.5) * width, worse, width, color=colour, label=condition)
    axes.axhline(1.0, color=BLACK, linewidth=0.5)
    axes.set(yscale="log", ylabel="error over that without loss")
    axes.set_yticks([1, 1.5, 2, 3, 5, 10], ["1", "1.5", "2", "3", "5", "10"])
    axes.set_yticks([], minor=True)
    axes.set_xticks(range(len(contenders)), contenders, rotation=30, ha="right")
    axes.legend(ncols=len(shown), loc="upper left")


def _worse(results: Results, who: str, condition: str) -> float:
    before, now = results.ratio(who, "no loss"), results.ratio(who, condition)
    return min(now / before, CAP) if math.isfinite(before) else math.nan


def pareto(figure: Figure, results: Results) -> None:
    """Error against payload, on good, lossy and crowded links; the front joins those that nothing beats in both."""
    figure.set_size_inches(PAGE_IN, 3.0)
    *panels, names_at = figure.subplots(1, 4, sharey=True, width_ratios=(1, 1, 1, 0.6))
    names_at.set_axis_off()
    for axes, condition in zip(panels, ("no loss", "loss 0.3", "radio"), strict=True):
        points = {
            who: (
                float(np.mean([one.bytes_per_s for one in results.of(who, condition)])),
                results.ratio(who, condition),
            )
            for who in FILTERS
            if who != "local only"
        }
        points = {who: point for who, point in points.items() if math.isfinite(point[1])}
        front = [
            who
            for who, (cost, error) in points.items()
            if not any(c <= cost and e <= error and (c, e) != (cost, error) for c, e in points.values())
        ]
        for who, (cost, error) in points.items():
            number = list(FILTERS).index(who)
            axes.plot(cost, error, "o", color=BLUE if who in front else GREY, markersize=8)
            axes.text(
                cost, error, str(number), ha="center", va="center", fontsize=6, color=WHITE if who in front else BLACK
            )
        line = sorted(points[who] for who in front)
        axes.step(*zip(*line, strict=True), where="post", color=BLUE, linewidth=0.6)
        axes.set(title=condition, xlabel="payload of an agent [B/s]", yscale="log", xlim=(0, 3000))
        axes.set_yticks([1, 1.5, 2, 3], ["1", "1.5", "2", "3"])
        axes.set_yticks([], minor=True)
    panels[0].set_ylabel("error over the centralised one")
    names = [f"{number}  {who}" for number, who in enumerate(FILTERS) if number]
    names_at.text(0.0, 0.5, "\n".join(names), transform=names_at.transAxes, fontsize=6.5, va="center", linespacing=1.6)


def ranks(figure: Figure, results: Results) -> None:
    """Ranks in two disjoint sets of seeds, a panel for each condition: on the diagonal they agree."""
    figure.set_size_inches(PAGE_IN, 1.75)
    panels = figure.subplots(1, len(CONDITIONS), sharey=True)
    for axes, condition in zip(panels, CONDITIONS, strict=True):
        first, second = (results.ranks(condition, seeds) for seeds in results.halves())
        axes.plot([0.5, 12.5], [0.5, 12.5], color=GREY, linewidth=0.6)
        for who, moved in results.moves(condition).items():
            axes.plot(first[who], second[who], "o", color=VERMILION if moved > 1 else BLUE, markersize=3)
        axes.set(title=condition, aspect="equal", xticks=[1, 6, 12], yticks=[1, 6, 12])
    panels[0].set_ylabel("rank, even seeds")
    panels[len(panels) // 2].set_xlabel("rank, odd seeds")
