"""Draws Figs. 4, 5 and 6 of Betanzos 2024 and what goes beyond them, and prints the numbers that betanzos.md quotes.

Usage: python docs/betanzos.py algebra|fig4|fig5|fig6|gain|loss|trust|all [--out docs/images]
"""

# ruff: noqa: TID251 - a user of the package
from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING

import networkx as nx
import numpy as np
from kriegleder import planned, simulate
from matplotlib.figure import Figure
from numpy.typing import NDArray
from page_figures import draw_asked

from volery import topologies
from volery.agents.plan import Plan
from volery.estimators.attitude.directions import learned_quaternion, observation_matrix
from volery.estimators.attitude.dynamic_consensus import collective_matrices, largest_step
from volery.estimators.error_measures import attitude_difference
from volery.experiments.figures.run_figures import BLACK, BLUE, GREEN, GREY, PURPLE, SKY, VERMILION
from volery.experiments.record.record import Record
from volery.experiments.record.samples import Samples, samples
from volery.experiments.scenario.fault_labels import fault_label
from volery.randomness import stream
from volery.rotations import (
    conjugate,
    euler_to_quaternion,
    exp_quaternion,
    mean_quaternion,
    normalised,
    quaternion_product,
    quaternion_to_euler,
    rotate,
)
from volery.transport.links import NANOSECONDS
from volery.worlds.rigid_body.measurement_units import DIRECTIONS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

PAGE_IN = 7.16
DEG = math.degrees(1)
ENDS = (200, 400, 500, 700, 900, 1100, 1300, 1500)
SCENES = tuple(zip((0, *ENDS), ENDS, strict=False))
"""The eight scenes of Table 2: begin and end [s]."""


def rms(values: Floats) -> float:
    """Root mean square of all that is known."""
    return float(np.sqrt(np.nanmean(values**2)))


def within(seen: Samples, from_s: float, until_s: float) -> NDArray[np.bool_]:
    """Which samples lie in a span, by their index."""
    return (seen.index >= 10 * from_s) & (seen.index < 10 * until_s)


# -- The algebra --------------------------------------------------------------------------------------------------


def algebra() -> Iterator[str]:
    """What (14) and (23) say of any attitude and of the complete graph of three."""
    references = np.array(list(DIRECTIONS.values()))
    draws, worst, ranks = stream(1, "attitudes"), 0.0, set()
    for trial in range(1000):
        attitude = normalised(np.array([draws.normal(4 * trial + part) for part in range(4)]))
        observed = np.array([rotate(conjugate(attitude), reference) for reference in references])
        H = observation_matrix(observed, references)
        worst = max(worst, float(np.abs(H @ attitude).max()))
        ranks.add(tuple(int(np.linalg.matrix_rank(H[: 4 * m], tol=1e-9)) for m in (1, 2)))
    yield f"1000 attitudes: |HQ| {'below 2e-15' if worst < 2e-15 else worst}, ranks for one and two directions {ranks}"
    for name, graph in (
        ("three that hear each other", topologies.complete(3)),
        ("a line of three", topologies.line(3)),
    ):
        adjacency = nx.to_numpy_array(graph, nodelist=topologies.agents(graph))
        rates, B = collective_matrices(adjacency)
        values = ", ".join(f"{value:.3g}" for value in np.linalg.eigvalsh(rates))
        weights = "; ".join(" ".join(f"{weight:.2f}" for weight in row) for row in np.linalg.solve(rates, B))
        yield f"{name}: eigenvalues {values}, largest step {largest_step(adjacency):.3f} s, averages {weights}"


# -- Fig. 4: attitude of the body and of the network --------------------------------------------------------------


def fig4(figure: Figure) -> Iterator[str]:
    """Euler angles of the body and of a unit's average under a torque in yaw."""
    record = simulate("attitude3")
    seen, alone = samples(record, "attitude"), samples(record, "attitude-alone")
    time_s = seen.index / 10
    true, mine = (np.degrees([quaternion_to_euler(q) for q in each[:, 0]]) for each in (seen.truth, seen.estimate))
    figure.set_size_inches(PAGE_IN, 2.8)
    axes = figure.subplots()
    for part, (name, colour) in enumerate((("roll", BLUE), ("pitch", GREEN), ("yaw", VERMILION))):
        axes.plot(time_s, mine[:, part], color=colour, label=f"{name}, unit 1")
        axes.plot(time_s, true[:, part], "--", color=BLACK, lw=0.8, label="body" if part == 2 else None)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("angle (deg)")
    axes.set_xlim(0, time_s[-1])
    axes.legend(ncols=2)
    errors = np.sqrt(np.mean((mine - true) ** 2, axis=0))
    yield f"unit 1: root mean square {', '.join(f'{e:.2f}' for e in errors)} deg in roll, pitch, yaw"
    largest = DEG * seen.truth_error.max()
    yield f"network: angle off by {DEG * rms(seen.truth_error):.2f} deg rms, {largest:.2f} deg at most"
    yield f"unit outside: {DEG * rms(alone.truth_error):.2f} deg rms, {DEG * alone.truth_error.max():.2f} deg at most"


# -- Figs. 5 and 6: eight scenes of failing sensors ---------------------------------------------------------------


@cache
def scenes(*changes: str) -> Record:
    """The run of Table 2, with the units' own estimates."""
    return simulate("attitude3-scenes", "agents.report_own=true", *changes)


def markley(record: Record) -> Floats:
    """Error of the central average of the units' own estimates, sample by sample (T,) [rad]."""
    own = samples(record, "own-attitude")
    mean = np.array([mean_quaternion(row) for row in own.estimate])
    return np.asarray(np.linalg.norm(attitude_difference(mean, own.truth[:, 0]), axis=1))


def _cumulative_ise(half: Floats) -> Floats:
    """∫ β_e² dt [deg² s] through each scene, from 0 again at its beginning, (T,)."""
    square = np.degrees(half) ** 2 / 10
    courses = [np.cumsum(square[10 * begin : 10 * end]) for begin, end in SCENES]
    for course in courses:
        course[-1] = np.nan  # the line ends here
    return np.concatenate(courses)


def fig5(figure: Figure) -> Iterator[str]:
    """The integral of the squared error, scene by scene, of the network and of the unit outside."""
    record = scenes()
    seen, alone = samples(record, "attitude"), samples(record, "attitude-alone")
    central = markley(record)
    figure.set_size_inches(PAGE_IN, 3.0)
    axes = figure.subplots()
    looks = ((alone.truth_error[:, 0], VERMILION, "unit outside"), (seen.truth_error[:, 0], BLUE, "network, unit 1"))
    for error, colour, name in looks:
        axes.semilogy(seen.index / 10, _cumulative_ise(0.5 * error), color=colour, label=name)
    _mark_scenes(axes)
    axes.set_ylabel("ISE of β$_e$ since the scene began (deg² s)")
    axes.set_ylim(bottom=0.1)
    axes.legend(loc="lower right")
    for number, (begin, end) in enumerate(SCENES, start=1):
        span = within(seen, begin, end)
        mine, its, mean = seen.truth_error[span], alone.truth_error[span], central[span]
        ratio = (rms(its) / rms(mine)) ** 2
        yield (
            f"scene {number}: network {DEG * rms(mine):.2f} deg rms, {DEG * mine.max():.1f} at most; Markley's mean "
            f"{DEG * rms(mean):.2f}; unit outside {DEG * rms(its):.2f}; its ISE is {ratio:.4g} times the network's"
        )
    yield f"all scenes: network {DEG * rms(seen.truth_error):.2f} deg rms, Markley's mean {DEG * rms(central):.2f}"


def fig6(figure: Figure) -> Iterator[str]:
    """The scalar part of the quaternions of body, network, and unit outside."""
    record = scenes()
    seen, alone = samples(record, "attitude"), samples(record, "attitude-alone")
    figure.set_size_inches(PAGE_IN, 2.8)
    axes = figure.subplots()
    axes.plot(seen.index / 10, alone.estimate[:, 0, 0], color=VERMILION, lw=0.7, label="unit outside")
    axes.plot(seen.index / 10, seen.estimate[:, 0, 0], color=BLUE, label="network, unit 1")
    axes.plot(seen.index / 10, seen.truth[:, 0, 0], "--", color=BLACK, lw=0.8, label="body")
    _mark_scenes(axes)
    axes.set_ylabel("scalar part $q_0$")
    axes.legend(loc="lower left")
    for name, each in (("network, unit 1", seen), ("unit outside", alone)):
        apart = np.abs(each.estimate[:, 0, 0] - each.truth[:, 0, 0])
        yield f"{name}: q0 is off by {rms(apart):.4f} rms, {apart.max():.3f} at most"


def _mark_scenes(axes: Axes) -> None:
    for number, (begin, end) in enumerate(SCENES, start=1):
        if number % 2 == 0:
            axes.axvspan(begin, end, color=GREY, alpha=0.5, lw=0, zorder=0)
        axes.text((begin + end) / 2, 1.02, str(number), transform=axes.get_xaxis_transform(), ha="center", fontsize=7)
    axes.set_xlim(0, ENDS[-1])
    axes.set_xlabel("time (s)")


# -- Beyond: the gain ---------------------------------------------------------------------------------------------

GAINS = (0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
CALM = ("faults=[]", "duration=100 s")


def errors_at(gains: Sequence[float], *changes: str) -> list[float]:
    """Error of the network [deg rms], after 10 s, for each gain."""
    found = []
    for gain in gains:
        seen = samples(simulate("attitude3-scenes", *CALM, f"agents.gain={gain}", *changes), "attitude")
        found.append(DEG * rms(seen.truth_error[within(seen, 10, 100)]))
    return found


def left_over(plan: Plan) -> tuple[float, float]:
    """Mean rate of turning [rad/s], and which part of a small lag one pass of LQS leaves, over units and time."""
    assert plan.world is not None
    parameters, lag, rates, left = plan.agents[0].parameters, 0.01, [], []
    references = [np.array(direction) for direction in DIRECTIONS.values()]
    for second in range(10, 100):
        state = plan.world.truth(second * NANOSECONDS)
        turning = float(np.linalg.norm(state[4:]))
        rates.append(turning)
        behind = quaternion_product(state[:4], exp_quaternion(-lag / turning * state[4:]))
        for name in ("1", "2", "3"):
            mounting = euler_to_quaternion(*parameters.mounting(name))
            frame, prior = (quaternion_product(each, mounting) for each in (state[:4], behind))
            observed = [rotate(conjugate(frame), reference) for reference in references]
            learned = learned_quaternion(prior, observed, references, parameters.alpha, parameters.gamma)
            along = attitude_difference(learned, frame) @ attitude_difference(prior, frame)
            left.append(float(along) / lag**2)
    return float(np.mean(rates)), float(np.mean(left))


def gain(figure: Figure) -> Iterator[str]:
    """Lag against noise: the error over the gain, with noise and without."""
    noisy, quiet = errors_at(GAINS), errors_at(GAINS, *(f"world.units.{name}.noise=0" for name in ("1", "2", "3")))
    turning, left = left_over(planned("attitude3-scenes", *CALM))
    predicted = [DEG * turning / (3 * each * (1 - left)) for each in GAINS]
    yield f"the body turns at {DEG * turning:.2f} deg/s; of a lag one pass of LQS leaves {left:.2f}"
    figure.set_size_inches(PAGE_IN, 2.6)
    axes = figure.subplots()
    axes.loglog(GAINS, noisy, "o-", ms=4, color=BLUE, label="network")
    axes.loglog(GAINS, quiet, "s-", ms=4, color=GREEN, label="without noise")
    axes.loglog(GAINS, predicted, "--", color=BLACK, label="ω / 3κ(1 − ρ)")
    axes.set_xticks(GAINS, [f"{each:g}" for each in GAINS])
    axes.set_yticks((0.1, 0.2, 0.5, 1, 2), ("0.1", "0.2", "0.5", "1", "2"))
    axes.minorticks_off()
    axes.set_xlabel("gain κ")
    axes.set_ylabel("error (deg rms)")
    axes.legend()
    for each, error, lag, expected in zip(GAINS, noisy, quiet, predicted, strict=True):
        yield f"gain {each:g}: {error:.2f} deg rms, without noise {lag:.2f}, predicted lag {expected:.2f}"
    for each, changes in ((1, ("agents.gain=1",)), (2, ())):
        seen = samples(scenes(*changes), "attitude")
        worst = max(DEG * rms(seen.truth_error[within(seen, *scene)]) for scene in SCENES)
        yield f"gain {each}, all scenes: {DEG * rms(seen.truth_error):.2f} deg rms, {worst:.2f} in the worst"


# -- Beyond: lost frames ------------------------------------------------------------------------------------------

LOSSES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)


def loss(figure: Figure) -> Iterator[str]:
    """Error and disagreement of the network over the fraction of lost frames."""
    found: dict[float, list[tuple[float, float]]] = {}
    for each in (1.0, 2.0):
        found[each] = []
        for lost in LOSSES:
            changes = (*CALM, f"agents.gain={each}", f"links.loss.bernoulli={lost}")
            seen = samples(simulate("attitude3-scenes", *changes), "attitude")
            span = within(seen, 10, 100)
            found[each].append((DEG * rms(seen.truth_error[span]), DEG * rms(seen.disagreement[span])))
    alone = samples(simulate("attitude3-scenes", *CALM), "attitude-alone")
    outside = DEG * rms(alone.truth_error[within(alone, 10, 100)])
    figure.set_size_inches(PAGE_IN, 2.8)
    axes = figure.subplots()
    for each, colour in ((1.0, GREEN), (2.0, BLUE)):
        errors, apart = zip(*found[each], strict=True)
        axes.plot(LOSSES, errors, "o-", ms=4, color=colour, label=f"network, κ = {each:g}")
        axes.plot(LOSSES, apart, ":", color=colour, label=f"disagreement, κ = {each:g}")
    axes.axhline(outside, color=VERMILION, label="unit outside")
    axes.set_xlabel("fraction of frames lost")
    axes.set_ylabel("angle (deg rms)")
    axes.set_ylim(bottom=0)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right center")
    for each, rows in found.items():
        first = rows[0][0]
        texts = (f"{lost:g}: {error / first:.2f}" for lost, (error, _) in zip(LOSSES, rows, strict=True))
        yield f"gain {each:g}: {first:.2f} deg rms without loss; times that with a fraction lost of {', '.join(texts)}"
    whole, half = (samples(scenes(*changes), "attitude") for changes in ((), ("links.loss.bernoulli=0.5",)))
    for number, (begin, end) in enumerate(SCENES, start=1):
        span = within(whole, begin, end)
        before, after = DEG * rms(whole.truth_error[span]), DEG * rms(half.truth_error[span])
        yield f"scene {number}, half lost: {after:.2f} deg rms instead of {before:.2f}, {after / before:.2f} times"
    before, after = rms(whole.truth_error), rms(half.truth_error)
    yield f"all scenes, half lost: {DEG * after:.2f} deg rms instead of {DEG * before:.2f}, {after / before:.2f} times"


# -- Beyond: sensors that are off ---------------------------------------------------------------------------------


def trust(figure: Figure) -> Iterator[str]:
    """Eight nodes in a ring whose sensors get stuck, are off or have spikes, with trust and without."""
    runs = {
        name: simulate("attitude8", *change) for name, change in (("with", ()), ("without", ("agents.trust=180 deg",)))
    }
    courses = {name: samples(record, "attitude") for name, record in runs.items()}
    figure.set_size_inches(PAGE_IN, 2.8)
    axes = figure.subplots()
    for (name, seen), colour in zip(courses.items(), (BLUE, PURPLE), strict=True):
        worst = DEG * np.nanmax(seen.truth_error, axis=1)
        axes.semilogy(seen.index / 10, worst, color=colour, label=f"worst of eight, {name} trust")
    for level, fault in enumerate(runs["with"].faults):
        from_s, until_s = fault.at_ns / NANOSECONDS, (fault.until_ns or 0) / NANOSECONDS
        axes.axvspan(from_s, until_s, color=SKY, alpha=0.15, lw=0, zorder=0)
        label = fault_label(fault, len(runs["with"].plan.links))
        axes.text(from_s, 1.02 + 0.07 * (level % 3), label, transform=axes.get_xaxis_transform(), fontsize=6)
    axes.set_xlim(0, 80)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("error (deg)")
    axes.legend(loc="upper right")
    for note in runs["with"].notes:
        yield f"{note['time_ns'] / NANOSECONDS:.1f} s: {note['agent']}.{note['sensor']}: {note['what']}"
    for name, seen in courses.items():
        error = DEG * seen.truth_error
        yield f"{name} trust: {rms(error):.2f} deg rms, {error.max():.1f} deg at most"


# -- The command --------------------------------------------------------------------------------------------------

Draw = Callable[[Figure], Iterator[str]]
DRAWN: dict[str, Draw] = {"fig4": fig4, "fig5": fig5, "fig6": fig6, "gain": gain, "loss": loss, "trust": trust}


if __name__ == "__main__":
    draw_asked("betanzos", "Figures of Betanzos 2024, drawn from volery's twin.", DRAWN, {"algebra": algebra})
