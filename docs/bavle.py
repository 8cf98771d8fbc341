"""Draws Figs. 3, 4 and 5 of Bavle 2017 and two more, and prints the numbers that bavle.md quotes.

Usage: python docs/bavle.py fig3|fig4|fig5|tuning|loss|lossy|all [--out docs/images]
"""

# ruff: noqa: TID251 - a user of the package
from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from page_figures import draw_asked

from volery.agents.altitude.altitude_ekf_settings import AltitudeEkfParameters
from volery.agents.altitude.altitude_network import component_name
from volery.agents.plan import Plan
from volery.agents.sensor_node import SensorNodeParameters, numbers
from volery.agents.sensor_samples import measured
from volery.estimators.altitude.components import Ground
from volery.estimators.altitude.modular_filter import GroundJumps, ModularFilter, Variant, unobservable
from volery.estimators.altitude.replay import Stamped
from volery.experiments.figures.run_figures import BLACK, BLUE, GREEN, GREY, SKY, VERMILION
from volery.experiments.record.record import Record
from volery.experiments.scenario.fault_labels import fault_label
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded
from volery.transport.links import NANOSECONDS
from volery.units import first_period, period_ns
from volery.worlds.altitude.altitude_world import AltitudeWorld

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

PAGE_IN = 7.16
CM = 100.0
LOOKS: dict[Variant, tuple[str, str]] = {
    "as_printed": ("as printed", VERMILION),
    "gate": ("gate", BLUE),
    "gate_and_floor": ("gate and floor", GREEN),
}
HUB = "agents.only.0"
PRINTED_WALK = 0.3
PRINTED = (f"{HUB}.jumps.variant=as_printed", f"{HUB}.ground.walk={PRINTED_WALK} m/√s")
"""As printed, at a tuning with which the ground can follow a table's edge."""
MORE_SEEDS = range(1, 7)


@dataclass(frozen=True)
class Flown:
    """What the hub said of a flight: times [s], estimates and truth of (altitude, ground, climb rate) (T, 3)."""

    record: Record
    time: Floats
    estimate: Floats
    truth: Floats

    @property
    def error(self) -> Floats:
        """|ẑ − z| [m], (T,)."""
        return np.abs(self.estimate[:, 0] - self.truth[:, 0])

    @property
    def world(self) -> AltitudeWorld:
        """Where it was flown."""
        return world_of(self.record.plan)

    def counts(self) -> tuple[int, ...]:
        """In order, replayed, repeated, too old, ahead, refused, jumps."""
        last = self.record.estimates("measurements")["hub"].value[-1]
        return tuple(int(count) for count in last)


def world_of(plan: Plan) -> AltitudeWorld:
    """The world of a plan of these scenarios."""
    assert isinstance(plan.world, AltitudeWorld)
    return plan.world


def hub(plan: Plan) -> AltitudeEkfParameters:
    """What the hub of a plan runs."""
    parameters = plan.agent("hub").parameters
    assert isinstance(parameters, AltitudeEkfParameters)
    return parameters


def planned(scenario: str, *changes: str) -> Plan:
    """The plan of a built-in scenario with changes such as "seed=2"."""
    return load_scenario(scenario, changes).plan


@cache
def fly(scenario: str, *changes: str) -> Flown:
    """Such a scenario, run in the twin."""
    plan = planned(scenario, *changes)
    record = recorded(plan)
    said = record.estimates("altitude")["hub"]
    return Flown(record, said.time_ns / NANOSECONDS, said.value, record.truth("altitude")["hub"])


def stamped_samples(plan: Plan) -> list[Stamped]:
    """All that the sensors see for which the hub has a component, in the order of their instants."""
    components, world, found = hub(plan).filter().sensors, world_of(plan), []
    for agent in plan.agents:
        if not isinstance(agent.parameters, SensorNodeParameters):
            continue
        for sensor, number in numbers(plan, agent.name):
            rate, name = world.sensors(agent.name)[sensor], component_name(agent.name, number)
            for index in range(first_period(rate, plan.duration_ns) if name in components else 0):
                value = measured(plan, plan.faults, agent.name, sensor, index)
                if value is not None:
                    found.append(Stamped(period_ns(rate, index), name, value))
    return sorted(found, key=lambda measurement: measurement.key)


def seen(plan: Plan, agent: str, sensor: str) -> tuple[Floats, Floats]:
    """Times [s] and readings [m] of a barometer or range finder."""
    rate = world_of(plan).sensors(agent)[sensor]
    count = int(plan.duration_ns / NANOSECONDS * rate)
    values = [measured(plan, plan.faults, agent, sensor, index) for index in range(count)]
    times = [period_ns(rate, index) / NANOSECONDS for index in range(count)]
    return np.array(times), np.array([math.nan if value is None else value[0] for value in values])


# -- Figs. 3, 4 and 5 ---------------------------------------------------------------------------------------------


def draw_flight(axes: Axes, flown: Flown, *, barometer: bool = True) -> None:
    """Altitude as estimated and as it was, beside what the sensors read."""
    if barometer:
        axes.plot(*seen(flown.record.plan, "baro", "barometer"), ".", ms=1, color=GREY, label="barometer", zorder=0)
    axes.plot(*seen(flown.record.plan, "laser", "range"), color=SKY, lw=0.6, label="range finder")
    axes.plot(flown.time, flown.estimate[:, 0], color=GREEN, label="estimate")
    axes.plot(flown.time, flown.truth[:, 0], "--", color=BLACK, lw=0.8, label="truth")
    axes.set_ylabel("altitude (m)")


def fig3(figure: Figure) -> Iterator[str]:
    """The complete flight over tables and chairs: altitude, and the barometer's bias below."""
    figure.set_size_inches(PAGE_IN, 4.0)
    upper, lower = figure.subplots(2, 1, height_ratios=(2.0, 1.0), sharex=True)
    flown = fly("altitude-obstacles")
    draw_flight(upper, flown)
    bias = flown.record.estimates("barometer bias")["hub"]
    true = np.array([flown.world.bias("baro", time_ns) for time_ns in bias.time_ns.tolist()])
    lower.plot(flown.time, bias.value[:, 0], color=GREEN)
    lower.plot(flown.time, true, "--", color=BLACK, lw=0.8)
    lower.set_ylabel("barometer bias (m)")
    lower.set_xlabel("time (s)")
    figure.legend(*upper.get_legend_handles_labels(), loc="outside upper center", ncols=4, markerscale=6)
    tour = flown.world.tour
    phases = {
        "take-off": (tour.take_off_ns, tour.legs_ns[0]),
        "navigation": (tour.legs_ns[0], tour.legs_ns[-1]),
        "landing": (tour.descent_ns, tour.down_ns),
    }
    yield f"altitude: {_error(flown.error)}"
    for name, (from_ns, until_ns) in phases.items():
        during = (flown.time * NANOSECONDS >= from_ns) & (flown.time * NANOSECONDS < until_ns)
        yield f"{name}, {from_ns / NANOSECONDS:.0f} s to {until_ns / NANOSECONDS:.0f} s: {_error(flown.error[during])}"
    readings = seen(flown.record.plan, "laser", "range")[1]
    rate = flown.world.sensors("laser")["range"]
    below = np.array([flown.world.truth(period_ns(rate, index))[0] for index in range(len(readings))])
    yield f"the range taken for the altitude: {_error(np.abs(readings - below))}"
    heights = seen(flown.record.plan, "baro", "barometer")[1]
    yield f"the barometer taken for the altitude: {_error(np.abs(heights - below))}"
    off = _error(np.abs(bias.value[:, 0] - true))
    yield f"barometer bias, which goes from {true[0]:.2f} m to {true[-1]:.2f} m: {off}"


def fig4(figure: Figure) -> Iterator[str]:
    """A part of the navigation phase: altitude and ground, as printed and gated."""
    figure.set_size_inches(PAGE_IN, 4.0)
    upper, lower = figure.subplots(2, 1, sharex=True)
    flights = {"as_printed": fly("altitude-obstacles", *PRINTED), "gate_and_floor": fly("altitude-obstacles")}
    gated = flights["gate_and_floor"]
    upper.plot(*seen(gated.record.plan, "laser", "range"), color=SKY, lw=0.6, label="range finder")
    for variant, flown in flights.items():
        label, colour = LOOKS[variant]  # type: ignore[index]
        upper.plot(flown.time, flown.estimate[:, 0], color=colour, label=label)
        lower.plot(flown.time, flown.estimate[:, 1], color=colour)
        over = flown.truth[:, 1] > 0
        yield f"{label}: altitude over obstacles {_error(flown.error[over])}"
        yield f"{label}: altitude over the floor {_error(flown.error[~over])}"
        yield f"{label}: ground {_error(np.abs(flown.estimate[:, 1] - flown.truth[:, 1]))}"
    for axes, component in ((upper, 0), (lower, 1)):
        axes.plot(gated.time, gated.truth[:, component], "--", color=BLACK, lw=0.8, label="truth")
    upper.set_ylabel("altitude (m)")
    lower.set_ylabel("ground (m)")
    lower.set_xlabel("time (s)")
    lower.set_xlim(10, 110)
    figure.legend(*upper.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    yield f"jumps of the ground that the gate saw: {gated.counts()[-1]}"
    plans = [planned("altitude-obstacles", f"seed={seed}") for seed in MORE_SEEDS]
    flights = [(plan, stamped_samples(plan)) for plan in plans]
    for variant, walk in (("as_printed", PRINTED_WALK), ("gate", Ground().walk), ("gate_and_floor", Ground().walk)):
        errors = (f"{CM * mean_error(*flight, variant, walk):.1f}" for flight in flights)  # type: ignore[arg-type]
        seeds = f"seeds {MORE_SEEDS[0]} to {MORE_SEEDS[-1]}"
        yield f"{LOOKS[variant][0]}, {seeds}: mean error {', '.join(errors)} cm"  # type: ignore[index]
    rises = (world_of(plan).bias("baro", plan.duration_ns) or math.nan for plan in plans)
    yield f"the barometer's bias at the end of these: {', '.join(f'{bias:.2f}' for bias in rises)} m"


WEAK = "world.sensors.imu={imu: {saturation: 30 m/s²}}"


def fig5(figure: Figure) -> Iterator[str]:
    """From a platform and back: altitude and ground; the landing again with an accelerometer that saturates."""
    figure.set_size_inches(PAGE_IN, 4.0)
    (whole, landing), (ground, below) = figure.subplots(2, 2, width_ratios=(2.0, 1.0), sharex="col", sharey="row")
    flown, weak = fly("altitude-platform"), fly("altitude-platform", WEAK)
    draw_flight(whole, flown)
    for axes, component in ((landing, 0), (below, 1)):
        axes.plot(flown.time, flown.estimate[:, component], color=GREEN)
        axes.plot(weak.time, weak.estimate[:, component], color=VERMILION, label="estimate, saturated at 3 g")
        axes.plot(flown.time, flown.truth[:, component], "--", color=BLACK, lw=0.8)
    ground.plot(flown.time, flown.estimate[:, 1], color=GREEN)
    ground.plot(flown.time, flown.truth[:, 1], "--", color=BLACK, lw=0.8)
    ground.set_ylabel("ground (m)")
    for axes in (ground, below):
        axes.set_xlabel("time (s)")
    down = flown.world.tour.down_ns / NANOSECONDS
    landing.set_xlim(down - 4, down + 6)
    handles, labels = whole.get_legend_handles_labels()
    more = landing.get_legend_handles_labels()
    figure.legend(handles + more[0], labels + more[1], loc="outside upper center", ncols=5, markerscale=6)
    flying = flown.time < flown.world.tour.descent_ns / NANOSECONDS
    yield f"until the descent: altitude {_error(flown.error[flying])}"
    yield f"from the descent on: altitude {_error(flown.error[~flying])}"
    for label, each in (("16 g", flown), ("3 g", weak)):
        z, z_ground, _ = each.estimate[-1]
        yield f"at rest on the platform, accelerometer up to {label}: altitude {z:.2f} m, ground {z_ground:.2f} m"
    printed = fly("altitude-platform", *PRINTED)
    yield f"as printed: altitude {_error(printed.error)}"


def _error(error: Floats) -> str:
    return f"mean error {CM * error.mean():.1f} cm, largest {CM * error.max():.0f} cm"


# -- Tuning -------------------------------------------------------------------------------------------------------

SCENES: dict[str, tuple[str, ...]] = {
    "flat": ("world.obstacles=[]", f"{HUB}.robot.altitude=0", f"{HUB}.ground.height=0"),
    "obstacles": (
        "world.obstacles.0={table: {centre: [0 m, 40 m]}}",
        f"{HUB}.robot.altitude=0",
        f"{HUB}.ground.height=0",
    ),
    "platform": (),
}
"""The flight of altitude-platform over the bare floor, over its obstacles from the floor, and as it is."""
WALKS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
SEEDS = (1, 2, 3)


def mean_error(plan: Plan, measurements: Sequence[Stamped], variant: Variant, walk: float) -> float:
    """Mean |ẑ − z| [m] at 20 Hz of a filter that has all measurements of a plan at once."""
    parameters = hub(plan)
    ground = Ground(parameters.ground.height, walk=walk)
    of = ModularFilter(parameters.robot, ground, parameters.components(), GroundJumps(variant))
    belief, errors = of.start(), []
    for each in measurements:
        belief = of.take(belief, each.time_ns, each.source, each.values)
        if each.source == "baro":
            errors.append(abs(belief.altitude - world_of(plan).truth(each.time_ns)[0]))
    return float(np.mean(errors))


def tuning(figure: Figure) -> Iterator[str]:
    """Mean error against the strength of the ground's walk, for three scenes, three seeds and three variants."""
    figure.set_size_inches(PAGE_IN, 2.6)
    of = hub(planned("altitude-platform")).filter()
    direction = unobservable(of, of.start().mean)
    named = [f"{name} {entry:+.3f}" for name, entry in zip(of.names, direction[:, 0], strict=True) if abs(entry) > 1e-6]
    yield f"directions that no measurement shows: {direction.shape[1]}: {', '.join(named)}"
    yield f"mean (least to most of {len(SEEDS)} seeds) in cm for walks of {', '.join(map(str, WALKS))} m/√s"
    for axes, (scene, changes) in zip(figure.subplots(1, len(SCENES), sharey=True), SCENES.items(), strict=True):
        plans = [planned("altitude-platform", f"seed={seed}", *changes) for seed in SEEDS]
        flights = [(plan, stamped_samples(plan)) for plan in plans]
        for variant, (label, colour) in LOOKS.items():
            errors = CM * np.array([[mean_error(*flight, variant, walk) for walk in WALKS] for flight in flights])
            mean, low, high = errors.mean(axis=0), errors.min(axis=0), errors.max(axis=0)
            axes.loglog(WALKS, mean, "o-", ms=3, color=colour, label=label)
            axes.fill_between(WALKS, low, high, color=colour, alpha=0.2, lw=0)
            shown = (f"{m:.1f} ({a:.1f} to {b:.1f})" for m, a, b in zip(mean, low, high, strict=True))
            yield f"{scene}, {label}: {', '.join(shown)}"
        axes.axhline(10, color=GREY, lw=0.8, zorder=0)
        axes.set_title(scene)
        axes.set_xlabel("walk of the ground (m/√s)")
        axes.yaxis.set_major_formatter("{x:g}")
    figure.axes[0].set_ylabel("mean error (cm)")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)


# -- Beyond: what the links lose, and when it comes ----------------------------------------------------------------

LOSSES = (0.0, 0.3, 0.6, 0.9)
ASKED = 0.6


def lossy_flight(scene: str, variant: Variant, loss: float, seed: int = SEEDS[0]) -> Flown:
    """A scene with so much of what barometer and range finder send lost."""
    tuned = PRINTED if variant == "as_printed" else (f"{HUB}.jumps.variant={variant}",)
    return fly("altitude-platform", *SCENES[scene], f"links.only.0.loss={loss}", f"seed={seed}", *tuned)


def loss(figure: Figure) -> Iterator[str]:
    """Mean error against the share of barometer and range frames that is lost."""
    figure.set_size_inches(PAGE_IN, 2.6)
    for axes, scene in zip(figure.subplots(1, len(SCENES), sharey=True), SCENES, strict=True):
        for variant, (label, colour) in LOOKS.items():
            errors = [CM * lossy_flight(scene, variant, share).error.mean() for share in LOSSES]
            axes.semilogy([100 * share for share in LOSSES], errors, "o-", ms=3, color=colour, label=label)
            lost = (f"{error:.1f} cm with {share:.0%}" for share, error in zip(LOSSES, errors, strict=True))
            yield f"{scene}, {label}: {', '.join(lost)} lost"
        others = [lossy_flight(scene, "gate_and_floor", ASKED, seed) for seed in SEEDS]
        shown = ", ".join(f"{CM * flown.error.mean():.1f} cm" for flown in others)
        yield f"{scene}, gate and floor, {ASKED:.0%} lost, seeds {', '.join(map(str, SEEDS))}: {shown}"
        axes.axhline(5, color=GREY, lw=0.8, zorder=0)
        axes.set_title(scene)
        axes.set_xlabel("frames lost (%)")
        axes.yaxis.set_major_formatter("{x:g}")
    figure.axes[0].set_ylabel("mean error (cm)")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)


def lossy(figure: Figure) -> Iterator[str]:
    """The flight of altitude-lossy, with late measurements put where they belong and with those left out."""
    figure.set_size_inches(PAGE_IN, 3.2)
    axes = figure.subplots()
    sides = {"history of 500 ms": (GREEN, []), "no history": (VERMILION, [f"{HUB}.history=0"])}
    for label, (colour, changes) in sides.items():
        flown = fly("altitude-lossy", *changes)
        axes.plot(flown.time, CM * (flown.estimate[:, 0] - flown.truth[:, 0]), color=colour, label=label)
        in_order, replayed, _, too_old, *_ = flown.counts()
        used = f"{in_order + replayed:,} measurements used, {replayed:,} of them replayed, {too_old:,} too old"
        yield f"{label}: {used}; altitude {_error(flown.error)}"
    record = flown.record
    for fault in record.faults:
        from_s, until_s = fault.at_ns / NANOSECONDS, (fault.until_ns or 0) / NANOSECONDS
        axes.axvspan(from_s, until_s, color=GREY, alpha=0.6, lw=0, zorder=0)
        label = fault_label(fault, len(record.plan.links)).replace(" ", "\n", 1)
        axes.text(from_s, 1.02, label, transform=axes.get_xaxis_transform(), fontsize=7)
    axes.set_xlim(0, record.last_ns / NANOSECONDS)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("error of the altitude (cm)")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2)


# -- The command --------------------------------------------------------------------------------------------------

Draw = Callable[[Figure], Iterator[str]]
DRAWN: dict[str, Draw] = {"fig3": fig3, "fig4": fig4, "fig5": fig5, "tuning": tuning, "loss": loss, "lossy": lossy}


if __name__ == "__main__":
    draw_asked("bavle", "Figures of Bavle 2017, drawn from volery's twin.", DRAWN)
