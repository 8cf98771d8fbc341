"""Draws the figures of sweeps.md, and prints the numbers that it quotes.

Usage: python docs/sweeps.py laws|paired [--out docs/images]
"""

# ruff: noqa: T201, TID251 - it prints what it found, and is a user of the package
from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Generator, Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import volery
from volery.experiments.cli.sweep_tables import half_width
from volery.experiments.figures.run_figures import BLACK, BLUE, COLUMN_IN, VERMILION, save
from volery.experiments.sweeps.pools import Done
from volery.experiments.sweeps.significance import contests, entries
from volery.experiments.sweeps.sweep import SweepOptions, run_sweep
from volery.experiments.sweeps.sweep_figures import chart_of, plot_sweep
from volery.experiments.sweeps.sweep_plan import Job, plan_sweep
from volery.experiments.sweeps.sweep_results import Sweep
from volery.experiments.sweeps.sweep_runs import run_job

ERROR = "estimate.oracle_error.steady_rms"
DELIVERED = "links.delivered_fraction"
ARRAY = ("duration=4 s", "agents.report_rounds=false", "links.medium=full-duplex", "links.paired=20 ms")
LAWS = ("running-sum", "flow-updating", "metropolis-least-squares")
SEEDS = 12
BURSTS = "links.loss={gilbert-elliott: {to_bad: 0.05, to_good: 0.1}}"
PAIRS = 12


def laws(out: Path) -> Iterator[str]:
    """Three laws of consensus over losses and rounds: who is better, curves, heat map, Pareto front."""
    over = {"links.loss.bernoulli": "0:0.6:0.2", "agents.rounds": [2, 4, 8], "agents.estimator": list(LAWS)}
    with tempfile.TemporaryDirectory() as runs:
        done = volery.sweep("dfa8-random", over, repeat=SEEDS, overrides=ARRAY, runs=runs)
        chart = chart_of(done, ERROR, by="agents.estimator")
        for path in plot_sweep(chart, ["curves", "pareto"], out, ["png"]):
            path.replace(out / path.name.replace("sweep-", "sweeps-"))
        heat = chart_of(done, ERROR, across="agents.rounds", by="links.loss.bernoulli")
        for path in plot_sweep(heat, ["heat"], out, ["png"]):
            path.replace(out / path.name.replace("sweep-", "sweeps-"))
    yield f"{len(done.rows)} runs, {SEEDS} seeds"
    for contest in contests(entries([done], ERROR), ("agents.estimator",)):
        where = contest.where
        best = contest.standings[0]
        beaten = [contest.standings[other].label for other in best.better_than]
        told = f"{best.label} {best.interval.mean:.2g} ± {half_width(best.interval)}"
        said = f"better than {' and '.join(beaten)}" if beaten else "better than none"
        yield f"loss {where['links.loss.bernoulli']}, {where['agents.rounds']} rounds: {told}, {said}"


def paired(out: Path) -> Iterator[str]:
    """Two and eight rounds over links that fail in bursts, with channels that are paired and that are not."""
    found = {name: _two_and_eight(slot) for name, slot in (("paired", "20 ms"), ("frame by frame", "null"))}
    save(partial(_draw_paired, found), "sweeps-paired", out, ["png"])
    for name, done in found.items():
        few, many = _columns(done, DELIVERED)
        correlation = np.corrcoef(few, many)[0, 1]
        yield f"{name}: delivered fractions of a seed correlated by {correlation:.2f}"
        apart = np.abs(np.subtract(few, many))
        yield f"{name}: they differ by {apart.mean():.3f} on average, {apart.max():.3f} at most"


def _two_and_eight(slot: str) -> Sweep:
    """In this process, which for so few runs is faster than to start others."""

    def carry_out(jobs: Iterable[Job]) -> Generator[Done, None, None]:
        for job in jobs:
            yield Done(job, run_job(job))

    changes = (*ARRAY, BURSTS, f"links.paired={slot}", "agents.estimator=running-sum", "duration=2 s")
    with tempfile.TemporaryDirectory() as runs:
        plan = plan_sweep("dfa8-random", changes, ["agents.rounds=2,8"])
        return run_sweep(plan, SweepOptions(PAIRS, runs=Path(runs)), carry_out)


def _columns(done: Sweep, measure: str) -> list[list[float]]:
    """The values of each cell, in the order of the seeds that both have."""
    cells = list(done.values(measure).values())
    seeds = sorted(set.intersection(*map(set, cells)))
    return [[cell[seed] for seed in seeds] for cell in cells]


def _draw_paired(found: dict[str, Sweep], figure: Figure) -> None:
    figure.set_size_inches(2 * COLUMN_IN, 0.85 * COLUMN_IN)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for panel, (name, done), colour in zip(panels, found.items(), (BLUE, VERMILION), strict=True):
        few, many = _columns(done, DELIVERED)
        panel.plot([0.5, 0.8], [0.5, 0.8], color=BLACK, linewidth=0.5)
        panel.plot(few, many, ".", color=colour)
        panel.set_title(name, loc="left")
        panel.set_xlabel("delivered with 2 rounds")
    panels[0].set_ylabel("delivered with 8 rounds")


PARTS: dict[str, Callable[[Path], Iterator[str]]] = {"laws": laws, "paired": paired}


def main() -> None:
    """Print one part."""
    parser = argparse.ArgumentParser()
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "images")
    words = parser.parse_args()
    words.out.mkdir(parents=True, exist_ok=True)
    for line in PARTS[words.part](words.out):
        print(f"{words.part}: {line}")


if __name__ == "__main__":
    main()
