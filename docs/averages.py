"""Draws the figure of averages.md, ways to average with and without loss, and prints what the page quotes.

Usage: python docs/averages.py contraction|one-way|all [--out docs/images]
"""

# ruff: noqa: TID251 - it is a user of the package
from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import networkx as nx
import numpy as np
from matplotlib.figure import Figure
from page_figures import draw_asked

from volery import topologies
from volery.estimators.averages.average_consensus import AVERAGINGS, average_consensus, predicted_contraction
from volery.estimators.averages.synchronous import Lost, nothing_lost, synchronous_rounds
from volery.estimators.error_measures import contraction
from volery.experiments.figures.run_figures import BLACK, BLUE, DARK_GREY, GREEN, GREY, PAGE_IN, PURPLE, SKY, VERMILION
from volery.randomness import stream

GRAPHS = {
    "geometric": topologies.geometric(10, 0.5, 3),
    "ring": topologies.ring(10),
    "star": topologies.star(10),
}
WEIGHTED = ("metropolis", "constant-edge", "maximum-degree", "fastest-mixing")
LOOKS = {
    "metropolis": (BLUE, "-"),
    "constant-edge": (BLUE, ":"),
    "maximum-degree": (BLUE, "-."),
    "fastest-mixing": (SKY, "-"),
    "chebyshev": (GREEN, "-"),
    "gossip": (GREY, "-"),
    "push-sum": (DARK_GREY, "--"),
    "running-sum": (VERMILION, "-"),
    "flow-updating": (PURPLE, "-"),
}
ROUNDS = 300
NUMBERS = 20
SMALL = 1e-6
ROUNDING = 1e-12
LOSS = 0.6


def one_way(source: str, target: str, number: int) -> bool:
    """Loss from the lower to the higher name, and none back."""
    forward = topologies.natural_key(source) < topologies.natural_key(target)
    return forward and stream(1, "averages.md", source, target).uniform(number) < LOSS


def left(name: str, graph: nx.Graph, lost: Lost = nothing_lost) -> list[float]:
    """How far all are from the averages of some numbers after each round, as a part of how far they were at first."""
    names, draws = topologies.agents(graph), stream(1, "averages.md", "values")
    values = np.array(
        [[draws.normal(NUMBERS * row + column) for column in range(NUMBERS)] for row in range(len(names))]
    )
    average = values.mean(axis=0)
    first = np.linalg.norm(values - average)
    parts = average_consensus(name, graph, seed=1)
    held = islice(synchronous_rounds(parts, graph, dict(zip(names, values, strict=True)), lost), ROUNDS)
    return [float(np.linalg.norm(np.array([now[who] for who in names]) - average) / first) for now in held]


def rounds_until(course: list[float], small: float) -> int:
    """Rounds until the part that is left stays below."""
    above = np.flatnonzero(np.array(course) >= small)
    return 1 if len(above) == 0 else int(above[-1]) + 2


def contractions() -> Iterator[str]:
    """Of plain weights, against what their spectrum predicts; of the other ways how many rounds they take."""
    for where, graph in GRAPHS.items():
        for name in AVERAGINGS:
            course = left(name, graph)
            took = rounds_until(course, SMALL)
            if name in WEIGHTED:
                rho = predicted_contraction(average_consensus(name, graph), graph)
                found = contraction(course[took // 2 : took])
                yield (
                    f"{where}, {name}: {found:.3f} a round, predicted {rho:.3f}; to a millionth in {took} rounds, "
                    f"predicted {topologies.rounds_to(rho, SMALL)}"
                )
            else:
                yield f"{where}, {name}: to a millionth in {took} rounds"


def figure(drawing: Figure) -> Iterator[str]:
    """What is left on the geometric graph, without loss and with loss in one direction."""
    drawing.set_size_inches(PAGE_IN, 2.9)
    panels = drawing.subplots(1, 2, sharey=True)
    graph = GRAPHS["geometric"]
    for axes, (title, lost) in zip(
        panels, {"no loss": nothing_lost, f"{LOSS:g} lost one way": one_way}.items(), strict=True
    ):
        for name, (colour, dash) in LOOKS.items():
            course = left(name, graph, lost)
            axes.plot(range(1, 201), course[:200], dash, color=colour, label=name)
            if lost is one_way:
                rest = f"{course[-1]:.0%} is left" if course[-1] > ROUNDING else "nothing is left but rounding"
                yield f"{name}: {rest} after {ROUNDS} rounds"
        axes.axhline(1.0, color=BLACK, linewidth=0.3)
        axes.set(title=title, xlabel="round", yscale="log", ylim=(1e-13, 3), xlim=(0, 200))
    panels[0].set_ylabel("distance to the average")
    handles, labels = panels[0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside lower center", ncols=5)


if __name__ == "__main__":
    draw_asked("averages", str(__doc__), {"one-way": figure}, {"contraction": contractions})
