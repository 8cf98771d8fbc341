"""Draws Figs. 2, 3 and 4 of Bassolillo 2025 and what goes beyond, and prints the numbers that bassolillo.md quotes.

Usage: python docs/bassolillo.py fig2|fig3|fig4|altitude|sign|ranges|bounds|bias|links|all [--out docs/images]
"""

# ruff: noqa: TID251 - a user of the package
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from page_figures import draw_asked

from volery.agents.mhe.estimator import DISTURBANCE
from volery.estimators.horizon.quadrotor_model import RANGES, QuadrotorModel
from volery.experiments.figures.run_figures import BLACK, BLUE, GREEN, GREY, PAGE_IN, VERMILION
from volery.experiments.record.record import Record
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded

Floats = NDArray[np.float64]

MRAD, MM = 1000.0, 1000.0
ANGLES = ("roll", "pitch", "yaw")
BEGIN_S = 5.0
HUB = "agents.only.1"
ONLY_A, ONLY_B = f"{HUB}.configurations=[A]", f"{HUB}.configurations=[B]"


@dataclass(frozen=True)
class Course:
    """A quantity of the hub over time: time_s (T,), estimate and truth (T, k)."""

    time_s: Floats
    estimate: Floats
    truth: Floats

    @property
    def error(self) -> Floats:
        """Estimate less truth."""
        return self.estimate - self.truth

    def rms(self, since_s: float = BEGIN_S, until_s: float = np.inf) -> Floats:
        """Root mean square error of each component within a span."""
        of = (self.time_s >= since_s) & (self.time_s <= until_s)
        return np.asarray(np.sqrt((self.error[of] ** 2).mean(axis=0)))


def simulate(scenario: str, *changes: str) -> Record:
    """The record of a built-in scenario with changes, run in the twin."""
    plan = load_scenario(scenario, changes).plan
    return recorded(plan)


def course(record: Record, quantity: str) -> Course:
    """What the hub said of a quantity, at the instants that the reports are of."""
    series = record.estimates(quantity)["hub"]
    rate = next(agent.parameters.rate for agent in record.plan.agents if agent.name == "hub")
    return Course(series.sample / rate, series.value, record.truth(quantity)["hub"])


def _milliradians(values: Floats) -> str:
    return ", ".join(f"{angle} {MRAD * value:.3f}" for angle, value in zip(ANGLES, values, strict=True)) + " mrad"


# -- Figs. 2 to 4: the manoeuvres ---------------------------------------------------------------------------------


def manoeuvre(figure: Figure, angle: str) -> Iterator[str]:
    """The angle that is asked for, with both configurations, and the errors of A."""
    figure.set_size_inches(PAGE_IN, 2.4)
    record, number = simulate(f"mhe-{angle}"), ANGLES.index(angle)
    full, inertial, filtered = (course(record, f"attitude {name}") for name in ("A", "B", "A ekf"))
    left, right = figure.subplots(1, 2)
    left.plot(full.time_s, MRAD * inertial.estimate[:, number], color=VERMILION, label="B")
    left.plot(full.time_s, MRAD * full.estimate[:, number], color=BLUE, label="A")
    left.plot(full.time_s, MRAD * full.truth[:, number], color=BLACK, ls="--", label="true")
    left.set(xlabel="time [s]", ylabel=f"{angle} [mrad]", title="moving horizon estimates")
    left.legend()
    for error, colour, name in zip(full.error.T, (BLUE, GREEN, VERMILION), ANGLES, strict=True):
        right.plot(full.time_s, MRAD * error, color=colour, lw=0.5, label=name)
    right.set(xlabel="time [s]", ylabel="error of A [mrad]", title="configuration A", ylim=(-1.2, 1.2))
    right.legend(ncols=3)
    yield f"A, rms error from {BEGIN_S:g} s: {_milliradians(full.rms())}"
    yield f"A, Kalman filter: {_milliradians(filtered.rms())}"
    yield f"B, rms error from {BEGIN_S:g} s: {_milliradians(inertial.rms())}"
    yield f"B, {angle} at the end: {MRAD * inertial.estimate[-1, number]:.1f} mrad"
    yield f"B over A in {angle}: {inertial.rms()[number] / full.rms()[number]:.0f}"


def altitude(figure: Figure) -> Iterator[str]:
    """The climb, and its error."""
    figure.set_size_inches(PAGE_IN, 2.2)
    record = simulate("mhe-altitude", ONLY_A)
    height, attitude = course(record, "altitude A"), course(record, "attitude A")
    left, right = figure.subplots(1, 2)
    left.plot(height.time_s, height.estimate, color=BLUE, label="A")
    left.plot(height.time_s, height.truth, color=BLACK, ls="--", label="true")
    left.set(xlabel="time [s]", ylabel="altitude [m]")
    left.legend()
    right.plot(height.time_s, MM * height.error, color=BLUE, lw=0.5)
    right.set(xlabel="time [s]", ylabel="error of A [mm]", ylim=(-1.0, 1.0))
    yield f"A, rms error from {BEGIN_S:g} s: {MM * height.rms()[0]:.3f} mm, {_milliradians(attitude.rms())}"


# -- The errata: what a sign and a lever arm do -------------------------------------------------------------------


def sign(figure: Figure) -> Iterator[str]:
    """Roll in configuration B with the physics of an accelerometer, and with (13) to the letter."""
    figure.set_size_inches(PAGE_IN, 2.4)
    axes = figure.subplots()
    letter = ("world.as_printed=[accelerometer]", f"{HUB}.as_printed=[accelerometer]")
    true = None
    for name, colour, changes in (("(13) as printed", VERMILION, letter), ("specific force", BLUE, ())):
        record = simulate("mhe-roll", *changes)
        full, inertial = course(record, "attitude A"), course(record, "attitude B")
        axes.plot(inertial.time_s, MRAD * inertial.estimate[:, 0], color=colour, label=f"B, {name}")
        true = inertial
        yield f"{name}: B ends at a roll of {MRAD * inertial.estimate[-1, 0]:.1f} mrad of 100"
        yield f"{name}: A, rms error from {BEGIN_S:g} s: {_milliradians(full.rms())}"
    assert true is not None
    axes.plot(true.time_s, MRAD * true.truth[:, 0], color=BLACK, ls="--", label="true")
    axes.set(xlabel="time [s]", ylabel="roll [mrad]")
    axes.legend()


def ranges(figure: Figure) -> Iterator[str]:
    """Five range sensors with lever arms and with (17) to the letter, in roll."""
    figure.set_size_inches(PAGE_IN, 2.4)
    states, still = QuadrotorModel().start(np.array([1.0, 0.0, 0.0, 0.0]), 10.0)[np.newaxis], np.zeros((1, 6))
    for name, printed in (("lever arms", False), ("(17) as printed", True)):
        _, C = QuadrotorModel(printed_range=printed).outputs(states, still)
        yield f"{name}: rank of the five rows when hovering: {np.linalg.matrix_rank(C[0, RANGES])}"
    world, models = "world.as_printed=[range]", f"{HUB}.as_printed=[range]"
    axes = figure.subplots()
    for name, colour, dashes, changes in (
        ("lever arms", BLUE, "-", ()),
        ("(17) as printed in world and model", GREEN, "-", (world, models)),
        ("(17) as printed in the model alone", BLACK, ":", (models,)),
    ):
        record = simulate("mhe-roll", ONLY_A, *changes)
        attitude, height = course(record, "attitude A"), course(record, "altitude A")
        axes.plot(attitude.time_s, MRAD * abs(attitude.error[:, 0]), color=colour, ls=dashes, lw=0.6, label=name)
        yield f"{name}: {_milliradians(attitude.rms())}, altitude {MM * height.rms()[0]:.2f} mm"
    axes.set(xlabel="time [s]", ylabel="|roll error| [mrad]", yscale="log", ylim=(1e-3, 1e2))
    axes.legend()


# -- Beyond the paper ---------------------------------------------------------------------------------------------

LIE_S = (5.0, 5.5)


def bounds(figure: Figure) -> Iterator[str]:
    """A gyroscope that lies by four times its bound for half a second."""
    figure.set_size_inches(PAGE_IN, 2.4)
    left, right = figure.subplots(1, 2)
    fault = "faults=[{at: 5 s, for: 500 ms, sensor: imu.gyroscope, bias: [0.2, 0.0, 0.0]}]"
    for name, colour, bound in (("bound of 0.05 rad/s", BLUE, "0.05"), ("no bound", VERMILION, "1000")):
        record = simulate(
            "mhe-roll", "duration=7 s", ONLY_A, fault, f"{HUB}.largest_gyroscope={bound} rad/s", "world.roll=0 rad"
        )
        attitude, series = course(record, "attitude A"), record.estimates(f"{DISTURBANCE} A")["hub"]
        time_s = series.sample / 100.0 - 0.1
        left.plot(time_s, series.value[:, 0], color=colour, lw=0.7, label=name)
        right.plot(attitude.time_s, MRAD * attitude.error[:, 0], color=colour, lw=0.7, label=name)
        active = record.estimates("measurements")["hub"].value[-1, -1]
        largest = abs(series.value[:, 0]).max()
        yield f"{name}: largest disturbance {largest:.6f} rad/s, active in {active:.0f} windows"
        yield f"{name}: largest error in roll {MRAD * abs(attitude.error[500:, 0]).max():.2f} mrad"
    left.set(xlabel="time [s]", ylabel="disturbance about x [rad/s]", xlim=(4.8, 6.0))
    right.set(xlabel="time [s]", ylabel="error in roll [mrad]", xlim=(4.8, 6.0))
    for axes in (left, right):
        axes.axvspan(*LIE_S, color=GREY, lw=0)
        axes.legend()


def bias(figure: Figure) -> Iterator[str]:
    """A constant bias of 0.01 rad/s of the gyroscope about each axis, as a state or not, in both configurations."""
    figure.set_size_inches(PAGE_IN, 2.4)
    panels = dict(zip("AB", figure.subplots(1, 2), strict=True))
    fault = "faults=[{at: 0 s, sensor: imu.gyroscope, bias: [0.01, 0.01, 0.01]}]"
    for name, colour, state in (("not a state", VERMILION, "false"), ("a state", BLUE, "true")):
        record = simulate("mhe-yaw", "world.yaw=0 rad", fault, f"{HUB}.gyroscope_bias={state}")
        for configuration, axes in panels.items():
            attitude = course(record, f"attitude {configuration}")
            axes.plot(attitude.time_s, MRAD * attitude.error[:, 2], color=colour, lw=0.7, label=f"bias {name}")
            axes.set(xlabel="time [s]", ylabel="error in yaw [mrad]", title=f"configuration {configuration}")
            axes.legend()
            yield f"{configuration}, bias {name}: {_milliradians(attitude.rms(10.0))} from 10 s"


LOSSES = (0.0, 0.2, 0.4, 0.6, 0.8)


def links(figure: Figure) -> Iterator[str]:
    """Error in roll of window and filter, against the loss of links that deliver late."""
    figure.set_size_inches(PAGE_IN, 2.4)
    left, right = figure.subplots(1, 2)
    found: dict[str, list[float]] = {"window": [], "filter": []}
    for loss in LOSSES:
        record = simulate("mhe-lossy", f"links.loss.bernoulli={loss}")
        for name, suffix, colour in (("filter", " ekf", VERMILION), ("window", "", BLUE)):
            attitude = course(record, f"attitude A{suffix}")
            found[name].append(MRAD * float(attitude.rms(1.0)[0]))
            if loss == LOSSES[2]:
                left.plot(attitude.time_s, MRAD * attitude.error[:, 0], color=colour, lw=0.5, label=name)
        window, filtered = found["window"][-1], found["filter"][-1]
        yield f"loss {loss:.0%}: rms error in roll, window {window:.2f} mrad, filter {filtered:.2f} mrad"
    left.set(xlabel="time [s]", ylabel="error in roll [mrad]", title=f"loss {LOSSES[2]:.0%}", ylim=(-4.0, 4.0))
    left.legend()
    for (name, errors), colour in zip(found.items(), (BLUE, VERMILION), strict=True):
        right.plot(np.multiply(LOSSES, 100), errors, "o-", color=colour, ms=3, label=name)
    right.set(xlabel="loss [%]", ylabel="rms error in roll [mrad]", ylim=(0.0, None))
    right.legend()


DRAWN: dict[str, Callable[[Figure], Iterator[str]]] = {
    "fig2": partial(manoeuvre, angle="roll"),
    "fig3": partial(manoeuvre, angle="pitch"),
    "fig4": partial(manoeuvre, angle="yaw"),
    "altitude": altitude,
    "sign": sign,
    "ranges": ranges,
    "bounds": bounds,
    "bias": bias,
    "links": links,
}


if __name__ == "__main__":
    draw_asked("bassolillo", "Figures of Bassolillo 2025, drawn from volery's twin.", DRAWN)
