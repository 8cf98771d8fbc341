"""Draws Figs. 4, 5, 7, 8 and 9 of Kriegleder 2012 and one more, and prints the numbers that kriegleder.md quotes.

Usage: python docs/kriegleder.py fig4|fig5|fig7|fig8|fig9|async|all [--out docs/images]
"""

# ruff: noqa: TID251 - a user of the package
from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import networkx as nx
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import RegularPolygon
from numpy.typing import NDArray
from page_figures import draw_asked

from volery.agents.plan import Plan
from volery.estimators.flying_array.least_squares import covariance, noncollinear
from volery.experiments.figures.run_figures import BLACK, BLUE, GREEN, GREY, SKY, VERMILION
from volery.experiments.record.record import Record
from volery.experiments.record.samples import samples
from volery.experiments.scenario.fault_labels import fault_label
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded
from volery.topologies import MODULE_SPACING, Position, ball, laplacian, positions, random_hexagonal
from volery.transport.links import NANOSECONDS
from volery.worlds.plane.distance_sensors import Infrared, curves
from volery.worlds.plane.plane_world import PlaneWorld

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

PAGE_IN = 7.16
MM, CM, DEG = 1000.0, 100.0, math.degrees(1)
STATE = (("altitude", "mm", MM), ("roll", "deg", DEG), ("pitch", "deg", DEG))


def planned(scenario: str, *changes: str) -> Plan:
    """The plan of a built-in scenario with changes such as "agents.hold=true"."""
    return load_scenario(scenario, changes).plan


def simulate(scenario: str, *changes: str) -> Record:
    """The record of such a scenario, run in the twin."""
    plan = planned(scenario, *changes)
    return recorded(plan)


def places(plan: Plan) -> dict[str, Position]:
    """Module → (r_X, r_Y) [m]."""
    return {agent.name: agent.position for agent in plan.agents if agent.position is not None}


def _rms(values: Floats) -> Floats:
    """Root mean square over the first axis."""
    return np.asarray(np.sqrt((values**2).mean(axis=0)))


def _order(truth: Floats) -> tuple[bool, float]:
    """Roll before pitch, from negative to positive."""
    return bool(truth[2] != 0), float(truth[1] + truth[2])


# -- Fig. 4: what a neighbourhood knows ---------------------------------------------------------------------------


def covariance_ratios(plan: Plan) -> dict[str, float]:
    """Module → ‖Q‖₂ / ‖Q_i‖₂ of (14) and (17), NaN where its neighbourhood stands on a line; the noise cancels."""
    place = places(plan)
    whole = np.linalg.norm(covariance(list(place.values()), 1.0), 2)
    ratios = {}
    for agent in plan.agents:
        near = [place[name] for name in (agent.name, *agent.neighbours)]
        ratios[agent.name] = float(whole / np.linalg.norm(covariance(near, 1.0), 2)) if noncollinear(near) else math.nan
    return ratios


def fig4(figure: Figure) -> Iterator[str]:
    """Both arrays, each module coloured by how close its neighbourhood comes to the whole array."""
    figure.set_size_inches(PAGE_IN, 3.1)
    panels = figure.subplots(1, 2, width_ratios=(1.0, 2.0))
    shades = ScalarMappable(Normalize(0.0, 1.0), "viridis")
    for scenario, axes in zip(("dfa4", "dfa16"), panels, strict=True):
        plan = planned(scenario)
        ratios = covariance_ratios(plan)
        draw_array(axes, places(plan), ratios, shades)
        yield f"{scenario}: ratios of modules 1 to {len(ratios)}: {', '.join(map(_ratio, ratios.values()))}"
    figure.colorbar(shades, ax=panels, label="‖Q‖₂ / ‖Q$_i$‖₂", shrink=0.8)
    unit = covariance_ratios(planned("dfa4", "topology.spacing=1 m"))
    yield f"dfa4 with modules 1 m apart: {', '.join(f'{ratio:.4f}' for ratio in unit.values())}"


def _ratio(ratio: float) -> str:
    return "none" if math.isnan(ratio) else f"{ratio:.3f}"


def draw_array(axes: Axes, place: dict[str, Position], ratios: dict[str, float], shades: ScalarMappable) -> None:
    """Hexagonal modules in their places, in the colours of their ratios; grey where there is none."""
    for name, (x, y, *_) in place.items():
        ratio = ratios[name]
        colour = GREY if math.isnan(ratio) else shades.cmap(ratio)
        axes.add_patch(RegularPolygon((x, y), 6, radius=MODULE_SPACING / math.sqrt(3), ec="white", lw=1.5, fc=colour))
        text = f"{name}\n" + ("none" if math.isnan(ratio) else f"{ratio:.2f}")
        ink = "white" if ratio < 0.6 else BLACK
        axes.text(x, y, text, ha="center", va="center", color=ink, fontsize=6.5)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_axis_off()
    axes.set_title(f"{len(place)} modules, {CM * MODULE_SPACING:g} cm apart")


# -- Fig. 5: consensus and connectivity ---------------------------------------------------------------------------

ARRAYS = range(10)
SHOWN_ROUNDS = (5, 10, 20)


def round_errors(record: Record) -> Floats:
    """ε(k) = max_i ‖x̂_i(k) − x̂‖₂ / ‖x̂‖₂, rms over the samples, (rounds,); NaN where a module has no estimate."""
    seen = samples(record, "estimate/round")
    rounds = record.plan.agents[0].parameters.rounds
    errors = (seen.oracle_error / np.linalg.norm(seen.oracle, axis=2)).max(axis=1)
    whole = np.full(-(-seen.index[-1] // rounds) * rounds, np.nan)
    whole[seen.index - 1] = errors
    return _rms(whole.reshape(-1, rounds)[:-1])


def first_round(graph: nx.Graph) -> int:
    """The first k for which the modules within k hops of any module stand on no line."""
    place = positions(graph)

    def rounds(name: str) -> int:
        return next(k for k in range(len(place)) if noncollinear([place[near] for near in ball(graph, name, k)]))

    return max(map(rounds, place))


def normalised_connectivity(graph: nx.Graph) -> float:
    """λ_2 of the normalised Laplacian D^(−1/2) L D^(−1/2) of a connected graph."""
    matrix = laplacian(graph)
    roots = np.sqrt(np.diag(matrix))
    return float(np.linalg.eigvalsh(matrix / np.outer(roots, roots))[1])


def fig5(figure: Figure) -> Iterator[str]:
    """Largest error against rounds and connectivity for ten random arrays."""
    figure.set_size_inches(PAGE_IN, 2.8)
    left, right = figure.subplots(1, 2)
    graphs = [random_hexagonal(8, seed) for seed in ARRAYS]
    connectivity = [normalised_connectivity(graph) for graph in graphs]
    errors = np.array([round_errors(simulate("dfa8-random", f"topology.hexagonal.seed={seed}")) for seed in ARRAYS])
    shades = ScalarMappable(LogNorm(0.1, 0.5), "viridis_r")
    rounds = np.arange(1, errors.shape[1] + 1)
    for colour, error in zip(shades.to_rgba(np.array(connectivity)), errors, strict=True):
        left.semilogy(rounds, 100 * error, color=colour)
    left.set_xlabel("rounds k")
    figure.colorbar(
        shades, ax=left, label="connectivity λ", ticks=(0.1, 0.2, 0.3, 0.4, 0.5), format="{x:g}"
    ).minorticks_off()
    for (number, marker), colour in zip(zip(SHOWN_ROUNDS, "os^", strict=True), (SKY, BLUE, VERMILION), strict=True):
        right.semilogy(connectivity, 100 * errors[:, number - 1], marker, ms=4, color=colour, label=f"k = {number}")
    right.set_xlabel("connectivity λ")
    right.legend()
    for axes in (left, right):
        axes.set_ylabel("largest error ε (%)")
        axes.yaxis.set_major_formatter("{x:g}")
    first = [int(np.argmin(np.isnan(error))) + 1 for error in errors]
    yield f"connectivity {min(connectivity):.3f} to {max(connectivity):.3f}"
    yield f"first round in which every module has an estimate: {', '.join(map(str, first))}"
    yield f"predicted from what is within k hops of it: {', '.join(str(first_round(graph)) for graph in graphs)}"
    for number in SHOWN_ROUNDS:
        column = 100 * errors[:, number - 1]
        rank = np.corrcoef(np.argsort(np.argsort(connectivity)), np.argsort(np.argsort(column)))[0, 1]
        span = f"{column.min():.2g} % to {column.max():.2g} %"
        yield f"after {number} rounds: error {span}, rank correlation with λ {rank:.2f}"


# -- Fig. 7: calibration ------------------------------------------------------------------------------------------


def fig7(figure: Figure) -> Iterator[str]:
    """Calibration curves (31) of the four sensors of dfa4, and what is left of their errors."""
    figure.set_size_inches(PAGE_IN, 2.6)
    left, right = figure.subplots(1, 2)
    plan = planned("dfa4")
    assert isinstance(plan.world, PlaneWorld)
    sensor = plan.world.sensor
    assert isinstance(sensor, Infrared)
    references = sensor.farthest * np.arange(1, sensor.references + 1) / sensor.references
    distances = np.linspace(sensor.nearest, sensor.farthest, 400)
    for agent, colour in zip(plan.agents, (BLUE, VERMILION, GREEN, SKY), strict=True):
        true, fitted = curves(sensor, plan.seed, agent.name)
        voltages = [true.voltage(distance) for distance in distances]
        error = np.array([fitted.distance(voltage) for voltage in voltages]) - distances
        left.plot([true.voltage(distance) for distance in references], CM * references, "o", ms=3, color=colour)
        left.plot(voltages, CM * (distances + error), color=colour, label=f"module {agent.name}")
        right.plot(CM * distances, MM * error, color=colour)
        curve = f"a = {CM * fitted.a:.2f} cm, b = {CM * fitted.b:.2f} cm V, c = {CM * fitted.c:.3f} cm V²"
        near, far = (MM * abs(error[distances <= farthest]).max() for farthest in (0.4, 0.8))
        yield f"module {agent.name}: {curve}, error within {near:.2f} mm up to 40 cm, {far:.2f} mm up to 80 cm"
    left.set_xlabel("voltage V (V)")
    left.set_ylabel("distance m (cm)")
    left.legend()
    right.set_xlabel("distance m (cm)")
    right.set_ylabel("error of the calibrated curve (mm)")
    right.axhline(0, color=GREY, zorder=0)
    slope = (sensor.typical.voltage(0.2) - sensor.typical.voltage(0.2001)) / 0.0001
    yield f"noise of {MM * sensor.noise:g} mV is {MM * sensor.noise / slope:.2f} mm at 20 cm"


# -- Fig. 8: estimates of the 4-module array ----------------------------------------------------------------------

SOLVER = "2"
LOW_ROLL = (
    "duration=2 s",
    "world.altitude=10 cm",
    "world.roll={steps: {0 s: -10 deg, 1 s: 10 deg}}",
    "world.pitch=0 deg",
)


Attitude = tuple[Floats, Floats, Floats]
"""Truth, mean and standard deviation of the estimates while an attitude is held, (3,) each [m, rad, rad]."""


def attitudes(*changes: str) -> Iterator[Attitude]:
    """What module 2 makes of every attitude held."""
    record = simulate("dfa4", "agents.estimator=neighbourhood-least-squares", *changes)
    seen = samples(record, "estimate")
    column = seen.agents.index(SOLVER)
    truth, estimate = seen.truth[:, column], seen.estimate[:, column]
    starts = np.flatnonzero((np.diff(truth, axis=0) != 0).any(axis=1)) + 1
    for true, mine in zip(np.split(truth, starts), np.split(estimate, starts), strict=True):
        yield true[0], mine.mean(axis=0), mine.std(axis=0)


def fig8(figure: Figure) -> Iterator[str]:
    """Estimated altitude, roll and pitch of the 4-module array at two altitudes, against the references."""
    figure.set_size_inches(PAGE_IN, 3.4)
    upper, lower = figure.subplots(2, 2, height_ratios=(1.0, 1.6), sharex="col")
    held = [*attitudes(), *attitudes(*LOW_ROLL)]
    for altitude, heights, angles in zip((0.1, 0.2), upper, lower, strict=True):
        mine = sorted((case for case in held if case[0][0] == altitude), key=lambda case: _order(case[0]))
        draw_attitudes(heights, angles, mine)
        heights.set_title(f"reference altitude {CM * altitude:g} cm")
        yield f"{CM * altitude:g} cm: largest error of a mean {_worst(mine)}"
        yield f"{CM * altitude:g} cm: standard deviation {_shown(_rms(np.array([spread for _, _, spread in mine])))}"
    exact = [*attitudes("agents.model=exact"), *attitudes(*LOW_ROLL, "agents.model=exact")]
    yield f"exact inversion: largest error of a mean {_worst(exact)}"


def _worst(held: list[Attitude]) -> str:
    return _shown(np.array([abs(estimate - truth) for truth, estimate, _ in held]).max(axis=0))


def _shown(state: Floats) -> str:
    altitude, roll, pitch = state * (MM, DEG, DEG)
    return f"{altitude:.2f} mm, {roll:.3f} deg roll, {pitch:.3f} deg pitch"


def draw_attitudes(heights: Axes, angles: Axes, held: list[Attitude]) -> None:
    """Means and standard deviations of the estimates; references as black lines."""
    numbers = range(len(held))
    looks = ((heights, CM, GREEN, "o"), (angles, DEG, BLUE, "o"), (angles, DEG, VERMILION, "s"))
    for component, (axes, factor, colour, marker) in enumerate(looks):
        mean, spread = ([factor * case[part][component] for case in held] for part in (1, 2))
        reference = [factor * case[0][component] for case in held]
        axes.hlines(reference, [n - 0.4 for n in numbers], [n + 0.4 for n in numbers], color=BLACK, lw=0.8)
        axes.errorbar(
            numbers, mean, spread, fmt=marker, ms=3, lw=0.8, capsize=2, color=colour, label=STATE[component][0]
        )
    heights.set_ylabel("altitude (cm)")
    angles.set_ylabel("angle (deg)")
    names = [f"{'pitch' if truth[2] else 'roll'} {DEG * (truth[1] + truth[2]):+.0f}°" for truth, _, _ in held]
    labels = [name.replace("-", "−") for name in names]
    angles.set_xticks(numbers, labels, rotation=45, ha="right", rotation_mode="anchor")
    angles.legend(loc="upper left")


# -- Fig. 9: larger arrays ----------------------------------------------------------------------------------------

SIZES = (4, 8, 16, 32)
SEEDS = range(3)
TICKS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)


def seconds(size: int) -> int:
    """Small arrays are cheap to run for longer."""
    return max(15, 240 // size)


def spreads(size: int, seed: int) -> tuple[Floats, Floats, Floats]:
    """Standard deviation of the modules' and of the centralised estimates, and that of (14), (3,) each."""
    array = f"topology.hexagonal={{count: {size}, seed: {seed}}}"
    record = simulate("dfa-sizes", array, f"seed={seed}", f"duration={seconds(size)} s")
    seen = samples(record, "estimate")
    world = record.plan.world
    assert isinstance(world, PlaneWorld)
    assert isinstance(world.sensor, Infrared)
    height, curve = float(world.truth(0)[0]), world.sensor.typical
    noise = world.sensor.noise * (curve.distance(curve.voltage(height) - 1e-6) - height) / 1e-6
    predicted = np.sqrt(np.diag(covariance(list(places(record.plan).values()), noise)))
    return _rms(seen.estimate.std(axis=0)), seen.oracle[:, 0].std(axis=0), predicted


def fig9(figure: Figure) -> Iterator[str]:
    """Standard deviation of altitude, roll and pitch against the size of the array."""
    figure.set_size_inches(PAGE_IN, 2.5)
    found = np.array([[spreads(size, seed) for seed in SEEDS] for size in SIZES])
    pooled = np.array([_rms(of_size) for of_size in found])
    looks = (("modules, 30 rounds", BLUE, "o"), ("centralised", VERMILION, "^"), ("predicted by (14)", BLACK, ""))
    for component, ((name, unit, factor), axes) in enumerate(zip(STATE, figure.subplots(1, 3), strict=True)):
        for kind, (label, colour, marker) in enumerate(looks):
            line, shown = "-" if marker else "--", factor * pooled[:, kind, component]
            axes.loglog(SIZES, shown, line, color=colour, marker=marker, ms=4, label=label)
        for size, of_size in zip(SIZES, found, strict=True):
            axes.plot([size] * len(of_size), factor * of_size[:, 0, component], ".", ms=3, color=SKY)
        axes.minorticks_off()
        axes.set_xticks(SIZES, map(str, SIZES))
        lowest, highest = axes.get_ylim()
        ticks = [tick for tick in TICKS if lowest < tick < highest]
        axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xlabel("modules")
        axes.set_title(f"{name} ({unit})")
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    figure.supylabel("standard deviation", fontsize=8)
    rate = planned("dfa-sizes").agents[0].parameters.rate
    for size, row in zip(SIZES, pooled, strict=True):
        count = int(len(SEEDS) * rate * seconds(size))
        yield f"{size} modules, {count} samples (known to {1 / math.sqrt(2 * count):.0%})"
        yield from (f"  {label}: {_shown(row[kind])}" for kind, (label, _, _) in enumerate(looks))


# -- Beyond: rounds that wait for nobody --------------------------------------------------------------------------

LAWS = (
    ("Metropolis", "metropolis-least-squares", VERMILION),
    ("running sum", "running-sum", BLUE),
    ("flow updating", "flow-updating", GREEN),
)


def asynchronous(figure: Figure) -> Iterator[str]:
    """Error to the centralised estimate of one held sample, for three laws of consensus under loss."""
    figure.set_size_inches(PAGE_IN, 2.8)
    axes = figure.subplots()
    for name, estimator, colour in LAWS:
        record = simulate("dfa16-async", f"agents.estimator={estimator}", "agents.hold=true")
        seen = samples(record, "estimate")
        time_s, error = seen.time_ns / NANOSECONDS, seen.oracle_error.max(axis=1)
        axes.semilogy(time_s, error, color=colour, label=f"{name}: error")
        axes.semilogy(time_s, seen.disagreement, ":", color=colour, label=f"{name}: disagreement")
        last = _small(error[-1]), _small(seen.disagreement[-1])
        yield f"{name}: after {time_s[-1]:.0f} s the largest error is {last[0]}, the disagreement {last[1]}"
    for fault in record.faults:
        from_s, until_s = fault.at_ns / NANOSECONDS, (fault.until_ns or 0) / NANOSECONDS
        axes.axvspan(from_s, until_s, color=GREY, alpha=0.6, lw=0, zorder=0)
        label = fault_label(fault, len(record.plan.links))
        axes.text(from_s, 1.02, label, transform=axes.get_xaxis_transform(), fontsize=7)
    axes.set_xlim(0, record.last_ns / NANOSECONDS)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("two-norm (m, rad)")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right center")


def _small(norm: float) -> str:
    """What is only rounding differs between machines."""
    return f"{norm:.1e}" if norm > 1e-12 else "below 1e-12"


# -- The command --------------------------------------------------------------------------------------------------

Draw = Callable[[Figure], Iterator[str]]
DRAWN: dict[str, Draw] = {"fig4": fig4, "fig5": fig5, "fig7": fig7, "fig8": fig8, "fig9": fig9, "async": asynchronous}


if __name__ == "__main__":
    draw_asked("kriegleder", "Figures of Kriegleder 2012, drawn from volery's twin.", DRAWN)
