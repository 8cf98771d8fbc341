"""Draws the figure of csma.md, throughput of carrier sense beside its models, and prints the numbers that it quotes.

Usage: python docs/csma.py throughput|all [--out docs/images]
"""

# ruff: noqa: T201, TID251 - it prints what it found, and is a user of the package
from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure
from numpy.typing import NDArray

from volery.experiments.figures import BLACK, BLUE, COLUMN_IN, GREEN, SKY, STYLE, VERMILION
from volery.experiments.record import Collector
from volery.experiments.scenario import compile_plan, load_scenario
from volery.experiments.twin import Twin
from volery.transport.csma import Csma

Floats = NDArray[np.float64]

RADIOS = 24
SECONDS = 10
PAYLOAD_B, OVERHEAD_B, RATE = 108, 17, 250_000
AIRTIME_NS = (PAYLOAD_B + OVERHEAD_B) * 8 * 10**9 // RATE
LOADS = (0.1, 0.3, 1.0, 3.0, 6.0)
STANDARD = "csma"
ONE_ATTEMPT = "{csma: {min_be: 0, max_be: 0, max_backoffs: 0}}"
CASES = (
    ("one attempt", ONE_ATTEMPT, f"{{complete: {RADIOS + 1}}}", "o", BLUE),
    ("standard", STANDARD, f"{{complete: {RADIOS + 1}}}", "s", GREEN),
    ("one attempt, hidden", ONE_ATTEMPT, f"{{star: {RADIOS + 1}}}", "v", VERMILION),
    ("standard, hidden", STANDARD, f"{{star: {RADIOS + 1}}}", "^", SKY),
)


# -- models -------------------------------------------------------------------------------------------------------


def non_persistent(load: Floats, turnaround: float, assessment: float) -> Floats:
    """Throughput of non-persistent CSMA, all in reach of all, in airtimes T per T.

    S = e^(−aG) / (1 + 2a + c − (1 − e^(−aG))/G + 1/G)      Kleinrock and Tobagi 1975, (9), and c for the listening

    G: attempts per T. a: `turnaround` / T, for which nobody hears a radio that has decided. c: `assessment` / T, the
    length of the listening, by which every busy period looks longer. With c = 0 this is the paper's
    G·e^(−aG) / (G(1 + 2a) + e^(−aG)).
    """
    clear = np.exp(-turnaround * load)
    cycle = 1 + 2 * turnaround + assessment - (1 - clear) / load + 1 / load
    return np.asarray(clear / cycle)


def pure_aloha(load: Floats) -> Floats:
    """Throughput of radios that do not hear each other: S = G·e^(−2G), Abramson 1970."""
    return np.asarray(load * np.exp(-2 * load))


def modelled(hidden: bool, load: Floats) -> Floats:
    """What the model of a case says about one attempt a frame."""
    access = Csma()
    a, c = access.turnaround / AIRTIME_NS, access.cca / AIRTIME_NS
    return pure_aloha(load) if hidden else non_persistent(load, a, c)


# -- runs ---------------------------------------------------------------------------------------------------------


def measured(access: str, topology: str, load: float) -> tuple[float, float, float]:
    """Frames per airtime that were tried and that came through to the silent listener, and share of those given up."""
    talkers = ", ".join(str(name) for name in range(2, RADIOS + 2))
    rate = load / RADIOS / AIRTIME_NS * 1e9
    beacons = f"kind: beacon, rate: {rate!r} Hz, size: {PAYLOAD_B} B, pattern: poisson, broadcast: true"
    medium = f"medium: {{kind: half-duplex, per: node, access: {access}}}"
    fields = (
        f"topology={topology}",
        f"duration={SECONDS} s",
        "overload=true",
        f"agents={{{beacons}, talkers: [{talkers}]}}",
        f"links={{{medium}, rate: {RATE} bit/s, overhead: {OVERHEAD_B} B, queue: {{limit: 1}}, latency: 1 ms}}",
    )
    plan = compile_plan(load_scenario("beacons", fields))
    collector = Collector()
    Twin(plan, collector).run()
    airtimes = SECONDS * 1e9 / AIRTIME_NS
    batches = collector.batches.values()
    sent = sum(len({entry.start_ns for entry in batch.sent}) for batch in batches)
    given_up = sum(len({entry.time_ns for entry in batch.dropped if entry.cause == "access"}) for batch in batches)
    through = sum(entry.fate == "delivered" for entry in collector.batches["1", 0].heard)
    tried = sent + given_up
    return tried / airtimes, through / airtimes, given_up / tried


def throughput(figure: Figure) -> Iterator[str]:
    """Throughput against load: one attempt a frame and the standard's five, in reach and hidden."""
    figure.set_size_inches(1.6 * COLUMN_IN, 2.8)
    axes = figure.subplots()
    line = np.geomspace(0.05, 10, 200)
    for hidden, label, dash in (
        (False, "non-persistent CSMA, Kleinrock and Tobagi 1975", "-"),
        (True, "pure ALOHA, Abramson 1970", "--"),
    ):
        axes.plot(line, modelled(hidden, line), dash, color=BLACK, label=label)
    for name, access, topology, marker, colour in CASES:
        points = [measured(access, topology, load) for load in LOADS]
        tried, through, given_up = np.array(points).T
        axes.plot(tried, through, marker, color=colour, markersize=4, label=name)
        for each, heard, share in zip(tried, through, given_up, strict=True):
            model = float(modelled("hidden" in name, np.array([each]))[0])
            beside = f", model {model:.3f}" if access == ONE_ATTEMPT else ""
            yield f"{name}: G {each:.2f}: S {heard:.3f}{beside}; given up {share:.1%}"
    axes.set(xscale="log", xlim=(0.05, 10), ylim=(0, 1), xlabel="G, frames tried per airtime", ylabel="S")
    figure.legend(loc="outside lower center", ncols=2)


DRAWN = {draw.__name__: draw for draw in (throughput,)}


def main() -> None:
    """Draw what is asked for and print its numbers."""
    parser = argparse.ArgumentParser(description="Figure of csma.md, drawn from volery's twin.")
    parser.add_argument("which", choices=[*DRAWN, "all"])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "images", help="folder")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    for name, draw in DRAWN.items():
        if asked.which in (name, "all"):
            with style.context(STYLE):
                figure = Figure(layout="constrained")
                print(*draw(figure), sep="\n")
                figure.savefig(asked.out / f"csma-{name}.png", dpi=120)


if __name__ == "__main__":
    main()
