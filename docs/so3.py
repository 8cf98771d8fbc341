"""Draws the figure of so3.md, consensus on inertial frames beside its linear theory, and prints what the page quotes.

Usage: python docs/so3.py bounds|noise|anchor|all [--out docs/images]
"""

# ruff: noqa: T201, TID251 - it prints what it found, and is a user of the package
from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import networkx as nx
import numpy as np
from matplotlib import style
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from volery.estimators.frames.so3_consensus import consensus_step, disagreement, seen_attitude, step_bound
from volery.experiments.figures.run_figures import BLUE, GREEN, PAGE_IN, STYLE, VERMILION
from volery.rotations import conjugate, exp_quaternion, log_quaternion, mean_quaternion, normalised, quaternion_product
from volery.topologies import complete, laplacian, line, neighbours

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

GRAPHS = {"3, all hear all": complete(3), "3 in a row": line(3), "5 in a row": line(5)}
LOOKS = dict(zip(GRAPHS, ((BLUE, "o"), (VERMILION, "s"), (GREEN, "^")), strict=True))
ONE = np.array([1.0, 0.0, 0.0, 0.0])
NOISE = math.radians(1.0)
RATE = 5
MINUTE = 60 * RATE
RUNS = 24
ANCHOR = 0.02
FRAME_ERROR = math.radians(5.0)


@dataclass
class Swarm:
    """Bodies in any attitude, each with a frame of its own; `anchor` is κ, and `noise` on ξ about each axis [rad]."""

    graph: nx.Graph
    step: float
    noise: float
    seed: int
    spread: float
    anchor: float = 0.0

    def __post_init__(self) -> None:
        """Draw the attitudes of the bodies and the frames."""
        self.random = np.random.default_rng(self.seed)
        self.bodies = {agent: normalised(self.random.normal(size=4)) for agent in self.graph}
        self.own = {agent: exp_quaternion(self.spread * self.random.normal(size=3)) for agent in self.graph}
        self.frames = dict(self.own)
        self.heard_from = {agent: neighbours(self.graph, agent) for agent in self.graph}
        self.weights = {
            agent: {**dict.fromkeys(others, 1.0), agent: self.anchor / self.step}
            for agent, others in self.heard_from.items()
        }

    def round(self) -> None:
        """Everybody tells its neighbours their attitudes; then everybody takes a step."""
        attitudes = {agent: quaternion_product(self.frames[agent], body) for agent, body in self.bodies.items()}
        for agent, others in self.heard_from.items():
            said = {other: seen_attitude(attitudes[other], self._seen(other, agent)) for other in others}
            said[agent] = quaternion_product(self.own[agent], self.bodies[agent])
            new = consensus_step(attitudes[agent], said, self.weights[agent], self.step)
            self.frames[agent] = quaternion_product(new, conjugate(self.bodies[agent]))

    def _seen(self, sees: str, seen: str) -> Floats:
        relative = quaternion_product(conjugate(self.bodies[sees]), self.bodies[seen])
        return quaternion_product(relative, exp_quaternion(self.noise * self.random.normal(size=3)))

    def disagreement(self) -> float:
        """Root mean square angle of the frames to their mean [rad]."""
        return disagreement(np.array(list(self.frames.values())))

    def common(self) -> Floats:
        """Where the mean of the frames lies from that of the own frames, a rotation vector [rad]."""
        now, before = (mean_quaternion(np.array(list(each.values()))) for each in (self.frames, self.own))
        return log_quaternion(quaternion_product(now, conjugate(before)))


def bound_of(graph: nx.Graph) -> float:
    """2 / λ_max, every neighbour counting 1."""
    return step_bound({agent: dict.fromkeys(neighbours(graph, agent), 1.0) for agent in graph})


def bounds(axes: Axes) -> Iterator[str]:
    """Disagreement of noiseless frames, a tenth of a degree apart at first, 5 % below and above the bound."""
    rounds = 40
    for name, graph in GRAPHS.items():
        colour, _ = LOOKS[name]
        yield f"{name}: bound on the step {bound_of(graph):.4f}"
        for part, dash in ((0.95, "-"), (1.05, "--")):
            step = part * bound_of(graph)
            swarm, seen = Swarm(graph, step, 0.0, 2, NOISE / 10), []
            for _ in range(rounds):
                seen.append(swarm.disagreement())
                swarm.round()
            axes.semilogy(np.degrees(seen), dash, color=colour, label=name if part < 1 else None)
            modes = np.linalg.eigvalsh(laplacian(graph))[1:]
            found, expected = (seen[-1] / seen[-11]) ** 0.1, np.abs(1 - step * modes).max()
            yield f"  {part:.0%} of it: disagreement times {found:.3f} a step, expected {expected:.3f}"
    axes.set(xlabel="step", ylabel="disagreement (deg)", title="5 % below (—) and above (- -) the bound")


def expected_spread(graph: nx.Graph, step: float) -> float:
    """Root mean square angle to the mean [rad] that NOISE leaves, of x⁺ = (1 − ε L) x + ε n with Var n_i = d_i σ²."""
    L, centre = laplacian(graph), np.eye(len(graph)) - 1 / len(graph)
    drive = centre @ (step**2 * NOISE**2 * np.diag(np.diag(L))) @ centre
    return math.sqrt(3 * np.trace(solve_discrete_lyapunov(centre - step * L, drive)) / len(graph))


def noise(axes: Axes) -> Iterator[str]:
    """The steady disagreement under noise of 1° about each axis, against the step."""
    parts = np.linspace(0.05, 0.9, 40)
    for name, graph in GRAPHS.items():
        colour, marker = LOOKS[name]
        axes.plot(parts, [math.degrees(expected_spread(graph, part * bound_of(graph))) for part in parts], color=colour)
        for part in (0.25, 0.5, 0.75):
            step = part * bound_of(graph)
            swarm, squares = Swarm(graph, step, NOISE, 8, NOISE), []
            for number in range(800):
                swarm.round()
                if number >= 100:
                    squares.append(swarm.disagreement() ** 2)
            found, expected = math.degrees(math.sqrt(np.mean(squares))), math.degrees(expected_spread(graph, step))
            axes.plot(part, found, marker, color=colour, markersize=4)
            yield f"{name}, step {step:.3f}: spread {found:.2f} deg, expected {expected:.2f} deg"
    axes.set(xlabel="step / bound", ylabel="steady disagreement (deg)", ylim=(0, None), title="1° about each axis on ξ")


def wander(anchor: float, rounds: int) -> Floats:
    """How far noise takes the common frame of three, rms of the angle [rad] as expected, after 1 to `rounds` steps.

    A step moves the mean by ε/N Σ_i n_i, 2E noises, and the anchor takes back a part κ.
    """
    graph, step = GRAPHS["3, all hear all"], 1 / 3
    kick = 3 * (step * NOISE / len(graph)) ** 2 * 2 * graph.number_of_edges()
    kept = (1 - anchor) ** (2 * np.arange(rounds))
    return np.sqrt(kick * np.cumsum(kept))


def anchor(axes: Axes) -> Iterator[str]:
    """How far the common frame wanders in a minute at 5 Hz, and what an anchor leaves of it, and of agreement."""
    graph, step = GRAPHS["3, all hear all"], 1 / 3
    times = np.arange(1, MINUTE + 1) / RATE
    for kappa, colour in ((0.0, VERMILION), (ANCHOR, BLUE)):
        away = np.zeros(MINUTE)
        for seed in range(RUNS):
            swarm = Swarm(graph, step, NOISE, seed, 0.0, kappa)
            for number in range(MINUTE):
                swarm.round()
                away[number] += float(swarm.common() @ swarm.common()) / RUNS
        found, expected = np.degrees(np.sqrt(away)), np.degrees(wander(kappa, MINUTE))
        axes.plot(times, found, ".", markersize=2, color=colour)
        axes.plot(times, expected, color=colour, label=f"anchor {kappa:g}")
        late = [math.sqrt(np.mean(np.square(each[MINUTE // 2 :]))) for each in (found, expected)]
        yield f"anchor {kappa:g}: common frame off by {late[0]:.1f} deg from 30 s to 60 s, expected {late[1]:.1f} deg"
    for kappa in (0.0, ANCHOR):
        swarm = Swarm(graph, step, 0.0, 3, FRAME_ERROR, kappa)
        before = swarm.disagreement()
        for _ in range(MINUTE):
            swarm.round()
        left, expected_left = swarm.disagreement() / before, kappa / (kappa + step * 3)
        of = f"of {math.degrees(before):.1f} deg between the frames"
        yield f"anchor {kappa:g}: {of} {left:.1%} remain, expected {expected_left:.1%}"
    axes.legend(loc="upper left")
    axes.set(xlabel="time (s)", ylabel="common frame off (deg)", title="3, all hear all, 5 Hz")


DRAWN = {draw.__name__: draw for draw in (bounds, noise, anchor)}


def main() -> None:
    """Print the numbers of what is asked for; draw the figure if all is."""
    parser = argparse.ArgumentParser(description="Consensus on inertial frames, after Nägeli 2014, Algorithm 2.")
    parser.add_argument("which", choices=[*DRAWN, "all"])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "images", help="folder of the picture")
    asked = parser.parse_args()
    with style.context(STYLE):
        figure = Figure(layout="constrained", figsize=(PAGE_IN, 2.7))
        for (name, draw), axes in zip(DRAWN.items(), figure.subplots(1, 3), strict=True):
            if asked.which in (name, "all"):
                print(*draw(axes), sep="\n")
        if asked.which == "all":
            handles, labels = figure.axes[0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside upper center", ncols=3)
            asked.out.mkdir(parents=True, exist_ok=True)
            figure.savefig(asked.out / "so3-consensus.png", dpi=150)


if __name__ == "__main__":
    main()
