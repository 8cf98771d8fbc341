"""Draws Figs. 6 and 7 of Nägeli 2014 and what goes beyond them, and prints the numbers that naegeli.md quotes.

Usage: python docs/naegeli.py algebra|fig6|fig7|burst|delay|loss|nees|death|all [--out docs/images]
"""

# ruff: noqa: TID251 - a user of the package
from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from kriegleder import planned, simulate
from matplotlib.figure import Figure
from numpy.typing import NDArray
from page_figures import draw_asked

from volery.agents.mav.mav_settings import MavParameters
from volery.estimators.formation.assignment import observability
from volery.estimators.formation.control import control, regulator
from volery.experiments.analysis.metrics import compute_metrics
from volery.experiments.evaluation.mav_findings import estimate_spread, mean_nees, shape_errors
from volery.experiments.figures.run_figures import BLACK, BLUE, GREEN, GREY, PURPLE, SKY, VERMILION
from volery.experiments.record.record import Record
from volery.transport.links import NANOSECONDS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

PAGE_IN = 7.16
COLOURS = {"1": BLUE, "2": VERMILION, "3": GREEN}
HOVER = "agents.script=[]"
SOUND = "faults=[]"
BURST_FROM_S, BURST_UNTIL_S = 26.0, 34.0
"""Of the scenario mav3."""
TIGHT_M = 0.025
"""Below this the paper takes estimates as agreed again."""


def parameters_of(record: Record) -> MavParameters:
    """Those of all vehicles."""
    parameters: MavParameters = record.plan.agents[0].parameters
    return parameters


def seconds(times_ns: NDArray[np.int64]) -> Floats:
    """Nominal times in seconds."""
    return np.asarray(times_ns / NANOSECONDS)


def shape_rms(record: Record, from_s: float = 2.0) -> float:
    """Root mean square of how far vehicles are from their places, from an instant on [m]."""
    positions = record.world_reports["positions"]
    errors = shape_errors(parameters_of(record), positions)[seconds(positions.time_ns) >= from_s]
    return float(np.sqrt((errors**2).mean()))


def spread_rms(record: Record, from_s: float = 2.0) -> float:
    """Root mean square of the spread of the estimates of r₁ₓ, from an instant on [m]."""
    times, spread = estimate_spread(record.estimates("formation"))
    return float(np.sqrt((spread[seconds(times) >= from_s] ** 2).mean()))


# -- The algebra --------------------------------------------------------------------------------------------------


def algebra() -> Iterator[str]:
    """What the model, the regulator and the assignment say of three vehicles, without noise and delays."""
    parameters: MavParameters = planned("mav3").agents[0].parameters
    model = parameters.model(3)
    gain = regulator(model, parameters.weights)
    sums = np.abs(gain.reshape(3, 3, -1).sum(axis=0)).max()
    yield f"sum of the gain's rows over the vehicles: {'below 1e-14' if sums < 1e-14 else sums}"
    tracked = parameters.tracked(("1", "2", "3"))
    alone = ", ".join(str(observability(3, [pair]).rank) for pair in tracked.items())
    together = observability(3, tracked.items()).rank
    yield f"rank of what one vehicle observes alone: {alone}; all together: {together} of 12"
    states = parameters.states(3)
    state, course = states["A"], []
    step_s = model.step_ns / NANOSECONDS
    for _ in range(300):
        course.append((state[0] - states["A"][0]) / (states["B"][0] - states["A"][0]))
        forces = control(gain, state, states["B"]).ravel()
        state = model.transition(step_s) @ state + model.input_map(step_s) @ forces
    risen = np.array(course)
    rise = step_s * (np.argmax(risen >= 0.9) - np.argmax(risen >= 0.1))
    over = max(0.0, 100 * (risen.max() - 1))
    yield f"step from A to B without noise and delays: 10 to 90 % in {rise:.2f} s, overshoot {over:.2f} %"


# -- Fig. 6: two references -----------------------------------------------------------------------------------------


def fig6(figure: Figure) -> Iterator[str]:
    """The two references, and the way of the vehicles from one to the other about their centre, mean of eight seeds."""
    records = list(_records(8, "mav3", SOUND, "duration=12 s"))
    parameters, times = parameters_of(records[0]), seconds(records[0].world_reports["positions"].time_ns)
    places = np.stack([record.world_reports["positions"].value.reshape(-1, 3, 3) for record in records])
    places = (places - places.mean(axis=2, keepdims=True)).mean(axis=0)
    courses = np.stack([record.world_reports["formation"].value[:, 0] for record in records])
    figure.set_size_inches(PAGE_IN, 3.2)
    left, right = figure.subplots(1, 2)
    shown = (times > 4.5) & (times < 9.0)
    for number, colour in enumerate(COLOURS.values()):
        left.plot(places[shown, number, 0], places[shown, number, 1], color=colour, lw=0.8)
        for reference, mark in (("A", "o"), ("B", "s")):
            x, y, _ = parameters.places(reference, 3)[number]
            label = f"reference {reference}" if number == 0 else None
            left.plot(x, y, mark, color=colour, mfc="none", label=label)
    left.set_aspect("equal")
    left.set_xlabel("x about the centre (m)")
    left.set_ylabel("y (m)")
    left.legend(loc="upper right")
    right.plot(times, courses.T, color=SKY, lw=0.4)
    right.plot(times, courses.mean(axis=0), color=BLUE, label="mean of 8 seeds")
    states = parameters.states(3)
    wanted = np.array([states[parameters.reference_at(int(time_s * NANOSECONDS))][0] for time_s in times])
    right.plot(times, wanted, "--", color=BLACK, lw=0.8, label="reference")
    right.set_xlabel("time (s)")
    right.set_ylabel("r₁ₓ (m)")
    right.legend(loc="upper left")
    settled = courses[:, times > 8].mean()
    error = 100 * np.sqrt(np.mean([shape_rms(record) ** 2 for record in records]))
    yield f"r1x after the step to B, mean of 8 seeds: {settled:.2f} m, reference {states['B'][0]:.2f} m"
    yield f"places in the formation: {error:.0f} cm rms, in turbulence of 0.6 m/s²"


# -- Fig. 7: estimate against truth, and a burst of lost packets ------------------------------------------------------


@cache
def flight() -> Record:
    """The scenario mav3 as it stands."""
    return simulate("mav3", "agents.report_covariance=10 Hz")


def fig7(figure: Figure) -> Iterator[str]:
    """Above r₁ₓ as vehicle 1 believes and as it is; below all three beliefs around the burst, with deviations."""
    record = flight()
    figure.set_size_inches(PAGE_IN, 4.6)
    upper, lower = figure.subplots(2, 1)
    truth, estimates = record.world_reports["formation"], record.estimates("formation")
    for axes in (upper, lower):
        axes.axvspan(BURST_FROM_S, BURST_UNTIL_S, color=GREY, lw=0, label="every packet lost")
        axes.plot(seconds(truth.time_ns), truth.value[:, 0], color=PURPLE, lw=1.0, label="truth")
        axes.set_ylabel("r₁ₓ (m)")
    upper.plot(seconds(estimates["1"].time_ns), estimates["1"].value[:, 0], color=BLUE, lw=0.8, label="vehicle 1")
    upper.set_xlim(0, seconds(truth.time_ns)[-1])
    for name, mine in estimates.items():
        lower.plot(seconds(mine.time_ns), mine.value[:, 0], color=COLOURS[name], lw=0.9, label=f"vehicle {name}")
        _deviations(lower, record, name)
    lower.set_xlim(BURST_FROM_S - 2, BURST_UNTIL_S + 3)
    lower.set_ylim(0.6, 2.3)
    lower.set_xlabel("time (s)")
    upper.legend(ncols=3)
    lower.legend(ncols=5)
    apart, back = burst_of(record, BURST_FROM_S, BURST_UNTIL_S)
    yield f"estimates of r1x apart by up to {100 * apart:.0f} cm in the burst, below 2.5 cm {back:.2f} s after it"
    error = estimates["1"].value[:, 0] - truth.value[: len(estimates["1"].value), 0]
    yield f"vehicle 1 against the truth: {100 * np.sqrt((error**2).mean()):.1f} cm rms in r1x"


def _deviations(axes: Axes, record: Record, name: str) -> None:
    """One standard deviation about a vehicle's estimate of r₁ₓ."""
    spread, mine = record.estimates("covariance")[name], record.estimates("formation")[name]
    rows = np.searchsorted(mine.sample, spread.sample)
    middle, deviation = mine.value[rows, 0], np.sqrt(spread.value[:, 0])
    times = seconds(spread.time_ns)
    axes.fill_between(times, middle - deviation, middle + deviation, color=COLOURS[name], alpha=0.15, lw=0)


# -- A burst, over seeds ----------------------------------------------------------------------------------------------


def burst_of(record: Record, from_s: float, until_s: float) -> tuple[float, float]:
    """Largest spread of r₁ₓ in a burst [m], and how long after it the spread is below 2.5 cm for the first time [s]."""
    times_ns, spread = estimate_spread(record.estimates("formation"))
    times = seconds(times_ns)
    after = (times >= until_s) & (spread < TIGHT_M)
    back = times[np.argmax(after)] - until_s if after.any() else np.nan
    return float(spread[(times >= from_s) & (times < until_s)].max()), float(back)


@cache
def bursts() -> Mapping[int, Record]:
    """Sixteen seeds of a burst of 8 s, which begins at 4 s."""
    fault = "faults=[{at: 4 s, for: 8 s, where: all, set: {loss: 1.0}}]"
    return {seed: simulate("mav3", HOVER, fault, "duration=16 s", f"seed={seed}") for seed in range(16)}


def burst(figure: Figure) -> Iterator[str]:
    """Spread of the estimates of r₁ₓ for each seed, and their median."""
    figure.set_size_inches(PAGE_IN, 2.8)
    axes = figure.subplots()
    axes.axvspan(4, 12, color=GREY, lw=0, label="every packet lost")
    courses = [estimate_spread(record.estimates("formation")) for record in bursts().values()]
    for times, spread in courses:
        axes.plot(seconds(times), 100 * spread, color=SKY, lw=0.5)
    length = min(len(spread) for _, spread in courses)
    middle = np.median([spread[-length:] for _, spread in courses], axis=0)
    axes.plot(seconds(courses[0][0][-length:]), 100 * middle, color=BLUE, label="median of 16 seeds")
    axes.axhline(100 * TIGHT_M, color=BLACK, ls="--", lw=0.8, label="2.5 cm")
    axes.set_xlim(2, 16)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("spread of r̂₁ₓ (cm)")
    axes.legend()
    found = np.array([burst_of(record, 4.0, 12.0) for record in bursts().values()])
    apart, back = 100 * found[:, 0], found[:, 1]
    yield f"16 seeds: largest spread {np.median(apart):.0f} cm in the median, {apart.min():.0f} to {apart.max():.0f} cm"
    soon = int((back <= 1.0).sum())
    times = f"{np.median(back):.2f} s in the median, within 1 s in {soon} of 16, {back.max():.2f} s at most"
    yield f"below 2.5 cm again after {times}"
    shape = 100 * np.array(
        [shape_errors(parameters_of(r), r.world_reports["positions"]).max() for r in bursts().values()]
    )
    yield f"furthest from its place: {np.median(shape):.0f} cm in the median, {shape.max():.0f} cm at most"
    closest = [_found(record, "closest approach") for record in bursts().values()]
    touched = sum(distance < 0.4 for distance in closest)
    yield f"closest approach {100 * min(closest):.0f} cm; vehicles of 40 cm touch in {touched} of 16 flights"
    pushed = [_found(record, "drift by differing estimates") for record in bursts().values()]
    yield f"drift of the centre by differing estimates in 16 s: {np.median(pushed):.1f} m in the median"


def _found(record: Record, name: str) -> float:
    return next(one.value for one in compute_metrics(record).findings if one.name == name)


# -- Old packets ------------------------------------------------------------------------------------------------------

LATENCIES_MS = (5, 50, 100, 200, 300, 400, 600)


def delay(figure: Figure) -> Iterator[str]:
    """Formation error and spread against latency, packets used as if fresh and run forward."""
    figure.set_size_inches(PAGE_IN, 2.8)
    left, right = figure.subplots(1, 2)
    for mode, colour in (("ignore", VERMILION), ("compensate", BLUE)):
        rows = []
        for latency in LATENCIES_MS:
            records = _records(
                3, "mav3-delay", "duration=15 s", f"links.latency={latency} ms", f"agents.filtering.delay={mode}"
            )
            rows.append([(shape_rms(record, 5.0), spread_rms(record, 5.0)) for record in records])
        found = np.array(rows)
        for axes, quantity in ((left, 0), (right, 1)):
            axes.plot(LATENCIES_MS, found[:, :, quantity], ".", color=colour, ms=3)
            axes.plot(LATENCIES_MS, np.median(found[:, :, quantity], axis=1), color=colour, label=mode)
        text = ", ".join(
            f"{_length(float(value))} at {ms} ms"
            for value, ms in zip(np.median(found[:, :, 0], axis=1), LATENCIES_MS, strict=True)
        )
        yield f"{mode}: places in the formation, rms, median of 3 seeds: {text}"
    for axes, name in ((left, "formation error, rms (m)"), (right, "spread of r̂₁ₓ, rms (m)")):
        axes.set_yscale("log")
        axes.set_xlabel("latency (ms)")
        axes.set_ylabel(name)
        axes.legend()


def _records(seeds: int, scenario: str, *changes: str) -> Iterator[Record]:
    return (simulate(scenario, *changes, f"seed={seed}") for seed in range(seeds))


def _length(metres: float) -> str:
    return f"{100 * metres:.0f} cm" if metres < 1 else f"{metres:.2g} m" if metres < 1e4 else "more than 10 km"


# -- Lost packets, and what the filter says of itself ---------------------------------------------------------------

LOSSES = (0.0, 0.3, 0.6, 0.8, 0.9, 0.95)


def loss(figure: Figure) -> Iterator[str]:
    """Formation error and spread against the share of packets that are lost."""
    figure.set_size_inches(PAGE_IN, 2.8)
    left, right = figure.subplots(1, 2)
    rows = []
    for probability in LOSSES:
        records = _records(4, "mav3", HOVER, SOUND, "duration=16 s", f"links.loss.bernoulli={probability}")
        rows.append([(shape_rms(record, 4.0), spread_rms(record, 4.0)) for record in records])
    found = 100 * np.array(rows)
    for axes, quantity, name in ((left, 0, "formation error, rms (cm)"), (right, 1, "spread of r̂₁ₓ, rms (cm)")):
        axes.plot(LOSSES, found[:, :, quantity], ".", color=SKY)
        axes.plot(LOSSES, np.median(found[:, :, quantity], axis=1), color=BLUE, label="median of 4 seeds")
        axes.set_xlabel("share of packets lost")
        axes.set_ylabel(name)
        axes.set_ylim(bottom=0)
        axes.legend()
    for probability, (shape, apart) in zip(LOSSES, np.median(found, axis=1), strict=True):
        yield f"{100 * probability:.0f} % lost: places {shape:.1f} cm rms, spread of r1x {apart:.1f} cm rms"


HONEST = ("agents.frames.noise=3 deg", "agents.filtering.acceleration_noise=3.3 m/s²")
"""Attitudes as they are off, and air that pushes as far within seconds as turbulence of 0.6 m/s² over 0.5 s does."""
FUSIONS = {
    "kalman": ("agents.filtering.fusion=kalman",),
    "intersection": ("agents.filtering.fusion=intersection", "agents.messages={covariance: bound, packet: 58 B}"),
}


def nees(figure: Figure) -> Iterator[str]:
    """NEES per degree of freedom against loss: messages as independent measurements, and covariance intersection."""
    figure.set_size_inches(PAGE_IN / 2, 2.8)
    axes = figure.subplots()
    bounds = (np.nan, np.nan)
    for (fusion, changes), colour in zip(FUSIONS.items(), (VERMILION, BLUE), strict=True):
        rows = []
        for probability in LOSSES:
            common = (HOVER, SOUND, "duration=21 s", "agents.report_covariance=1 Hz", *HONEST)
            records = _records(4, "mav3", *common, f"links.loss.bernoulli={probability}", *changes)
            values = [value for record in records if (value := mean_nees(record)) is not None]
            rows.append([value for value, _, _ in values])
            bounds = values[0][1:]
        found = np.array(rows)
        axes.plot(LOSSES, found, ".", color=colour, ms=3)
        axes.plot(LOSSES, found.mean(axis=1), color=colour, label=fusion)
        text = ", ".join(
            f"{value:.2f} at {100 * share:.0f} %" for value, share in zip(found.mean(axis=1), LOSSES, strict=True)
        )
        verdict = (
            "overconfident"
            if found.mean(axis=1).min() > bounds[1]
            else "never overconfident"
            if found.mean(axis=1).max() < bounds[1]
            else "overconfident at some"
        )
        yield f"{fusion}: mean of 4 seeds {text} lost: {verdict}"
    yield f"one flight of a consistent filter lies within {bounds[0]:.2f} and {bounds[1]:.2f} (95 %)"
    axes.axhspan(*bounds, color=GREY, lw=0, label="consistent, 95 %")
    axes.set_yscale("log")
    axes.set_xlabel("share of packets lost")
    axes.set_ylabel("NEES per degree of freedom")
    axes.legend()


def death(figure: Figure) -> Iterator[str]:
    """Distances of the vehicles when one of them dies in flight."""
    record = simulate("mav3", HOVER, "faults=[{at: 4 s, kill: 2}]", "duration=16 s")
    positions = record.world_reports["positions"]
    places, times = positions.value.reshape(-1, 3, 3), seconds(positions.time_ns)
    figure.set_size_inches(PAGE_IN / 2, 2.8)
    axes = figure.subplots()
    for first, second, colour in ((0, 2, BLUE), (0, 1, VERMILION), (1, 2, GREEN)):
        apart = np.linalg.norm(places[:, first] - places[:, second], axis=-1)
        axes.plot(times, apart, color=colour, label=f"{first + 1} and {second + 1}")
    axes.axvline(4.0, color=BLACK, lw=0.8)
    axes.set_ylim(0, 3)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("distance (m)")
    axes.legend()
    left = [note for note in record.notes if note["what"] == "left out"]
    yield "; ".join(
        f"{note['agent']} leaves {note['vehicle']} out at {note['time_ns'] / NANOSECONDS:.1f} s" for note in left
    )
    yield from (f"{one.name}: {one.text}" for one in compute_metrics(record).findings if one.name.startswith("without"))
    late = np.linalg.norm(places[times > 10, 0] - places[times > 10, 2], axis=-1)
    yield f"vehicles 1 and 3 keep {late.mean():.2f} m, reference 0.90 m"


DRAWN: Mapping[str, Callable[[Figure], Iterator[str]]] = {
    "fig6": fig6,
    "fig7": fig7,
    "burst": burst,
    "delay": delay,
    "loss": loss,
    "nees": nees,
    "death": death,
}


if __name__ == "__main__":
    draw_asked("naegeli", "Figures of Nägeli 2014, drawn from volery's twin.", DRAWN, {"algebra": algebra})
