"""Draws the figures of csma.md, carrier sense beside its models, and prints the numbers that the page quotes.

Usage: python docs/csma.py throughput|saturation|all [--out docs/images]
"""

# ruff: noqa: TID251 - it is a user of the package
from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from busy_radio import LISTENER
from matplotlib.figure import Figure
from numpy.typing import NDArray
from page_figures import draw_asked

from volery.experiments.figures.run_figures import BLACK, BLUE, COLUMN_IN, GREEN, SKY, VERMILION
from volery.experiments.record.record import Record
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded
from volery.transport.media_settings import Csma

Floats = NDArray[np.float64]

RADIOS = 24
SECONDS = 10
PAYLOAD_B, OVERHEAD_B, RATE = 108, 17, 250_000
AIRTIME_NS = (PAYLOAD_B + OVERHEAD_B) * 8 * 10**9 // RATE
AIRTIMES = SECONDS * 10**9 // AIRTIME_NS
COUNTS = (2, 3, 5, 10, 20, 40)
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


class Saturated(NamedTuple):
    """Radios that always have a frame: throughput, share of frames given up, and of those on the air that collided."""

    throughput: float
    given_up: float
    collided: float


def _of_failures(count: int, failing: float, access: Csma) -> tuple[float, Saturated]:
    """What follows if a share α, `failing`, of the assessments finds the channel busy: α anew, and the rest.

    A frame has A = Σ α^i assessments, i = 0 … max_backoffs, in a time of B = Σ α^i (w_i + c), w_i the mean of its i-th
    backoff: while they wait, radios assess at rate β = A / B each. The channel goes in cycles as in `non_persistent`,
    with nβ for the rate of the first assessment and (n − 1)β for that of the others, in time units, not airtimes.
    """
    turnaround, cca, attempts = access.turnaround, access.cca, range(access.max_backoffs + 1)
    waits = [access.period * (2 ** min(access.min_be + i, access.max_be) - 1) / 2 + cca for i in attempts]
    beta = sum(failing**i for i in attempts) / sum(failing**i * wait for i, wait in zip(attempts, waits, strict=True))
    clear, joins = math.exp(-(count - 1) * beta * turnaround), 1 - math.exp(-beta * turnaround)
    last = turnaround - (1 - clear) / ((count - 1) * beta)
    in_vain = (count - 1) * (1 - joins) * beta * (AIRTIME_NS + last + cca)
    on_air = 1 + (count - 1) * joins
    cycle = 1 / (count * beta) + turnaround + last + AIRTIME_NS + cca
    found = Saturated(AIRTIME_NS * clear / cycle, failing ** len(attempts), 1 - clear / on_air)
    return in_vain / (in_vain + on_air), found


def saturated_model(count: int, access: Csma) -> Saturated:
    """The fixed point, for at least 2 radios: the share of busy assessments that follows from itself, by bisection.

    After Singh, Kumar and Ameer 2008: what each radio does while it waits is independent of the others, and Poisson.
    """
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if _of_failures(count, middle, access)[0] > middle else (low, middle)
    return _of_failures(count, low, access)[1]


# -- runs ---------------------------------------------------------------------------------------------------------


def simulate(*fields: str) -> Record:
    """The record of beacons with other fields, run in the twin."""
    plan = load_scenario("beacons", (f"duration={SECONDS} s", "overload=true", *fields)).plan
    return recorded(plan)


def measured(access: str, topology: str, load: float) -> tuple[float, float, float]:
    """Frames per airtime that were tried and that came through to the silent listener, and share of those given up."""
    talkers = ", ".join(str(name) for name in range(2, RADIOS + 2))
    rate = load / RADIOS / AIRTIME_NS * 1e9
    beacons = f"kind: beacon, rate: {rate!r} Hz, size: {PAYLOAD_B} B, pattern: poisson, broadcast: true"
    medium = f"medium: {{kind: half-duplex, per: node, access: {access}}}"
    record = simulate(
        f"topology={topology}",
        f"agents={{{beacons}, talkers: [{talkers}]}}",
        f"links={{{medium}, rate: {RATE} bit/s, overhead: {OVERHEAD_B} B, queue: {{limit: 1}}, latency: 1 ms}}",
    )
    batches = record.batches.values()
    sent = sum(len({entry.start_ns for entry in batch.sent}) for batch in batches)
    given_up = sum(len({entry.time_ns for entry in batch.dropped if entry.cause == "access"}) for batch in batches)
    through = sum(entry.fate == "delivered" for entry in record.batches[LISTENER, 0].heard)
    tried = sent + given_up
    return tried / AIRTIMES, through / AIRTIMES, given_up / tried


def measured_saturated(count: int) -> Saturated:
    """The same of radios that always have a frame for the listener, with the standard's parameters."""
    record = simulate(
        f"topology={{complete: {count + 1}}}",
        "agents={kind: busy_radio:Busy}",
        f"links={{medium: {{kind: half-duplex, per: node, access: {STANDARD}}}, rate: {RATE} bit/s, "
        f"overhead: {OVERHEAD_B} B, queue: {{limit: 4}}, latency: 1 ms}}",
    )
    batches = record.batches.values()
    sent = sum(len(batch.sent) for batch in batches)
    given_up = sum(entry.cause == "access" for batch in batches for entry in batch.dropped)
    through = sum(entry.fate == "delivered" for entry in record.batches[LISTENER, 0].heard)
    return Saturated(through / AIRTIMES, given_up / (sent + given_up), 1 - through / sent)


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
    axes.plot(line, line * np.exp(-line), ":", color=BLACK, label="slotted ALOHA, Roberts 1975")
    for name, access, topology, marker, colour in CASES:
        points = [measured(access, topology, load) for load in LOADS]
        tried, through, given_up = np.array(points).T
        axes.plot(tried, through, marker, color=colour, markersize=4, label=name)
        for each, heard, share in zip(tried, through, given_up, strict=True):
            model = float(modelled("hidden" in name, np.array([each]))[0])
            beside = f", model {model:.3f}" if access == ONE_ATTEMPT else ""
            yield f"{name}: G {each:.2f}: S {heard:.3f}{beside}; given up {share:.1%}"
    axes.set(xscale="log", xlim=(0.05, 10), ylim=(0, 0.8), xlabel="G, frames tried per airtime", ylabel="S")
    figure.legend(loc="outside lower center", ncols=2)


def saturation(figure: Figure) -> Iterator[str]:
    """Throughput, frames given up and frames collided against the number of radios that always have one."""
    figure.set_size_inches(1.6 * COLUMN_IN, 2.4)
    axes = figure.subplots()
    line = range(COUNTS[0], COUNTS[-1] + 1)
    curves = np.array([saturated_model(count, Csma()) for count in line]).T
    points = np.array([measured_saturated(count) for count in COUNTS]).T
    looks = (("throughput S", "o", BLUE), ("given up", "s", GREEN), ("collided, of those sent", "v", VERMILION))
    for (label, marker, colour), curve, found in zip(looks, curves, points, strict=True):
        axes.plot(line, curve, color=colour)
        axes.plot(COUNTS, found, marker, color=colour, markersize=4, label=label)
    for count, (heard, given_up, collided) in zip(COUNTS, points.T, strict=True):
        model = saturated_model(count, Csma())
        yield (
            f"{count} radios: S {heard:.3f}, model {model.throughput:.3f}; given up {given_up:.3f}, "
            f"model {model.given_up:.3f}; collided {collided:.3f}, model {model.collided:.3f}"
        )
    axes.set(xlim=(0, COUNTS[-1] + 1), ylim=(0, 1), xlabel="radios that always have a frame")
    figure.legend(loc="outside lower center", ncols=3)


if __name__ == "__main__":
    drawn = {"throughput": throughput, "saturation": saturation}
    draw_asked("csma", "Figures of csma.md, drawn from volery's twin.", drawn, dpi=120)
