"""Results of a flight: shape, spread of the estimates, drift, collisions, frames and consistency."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...agents.mav.mav_settings import MavParameters
from ...agents.plan import Plan
from ...estimators.error_measures import chi_square_bounds
from ...estimators.formation.assignment import observability
from ...quantities import Floats
from ...rotations import angle_between, conjugate, mean_quaternion, quaternion_product
from ...transport.faults import Kill
from .evaluation import Finding, RunData, Series

SETTLING_NS = 3_000_000_000
"""After a change of the reference the shape is not held against it for so long: the step takes 1.2 s to rise."""
INDEPENDENT_NS = 1_000_000_000
"""Errors so far apart in time are taken as independent of each other."""
HELD_NS = 1_000_000_000
"""A vehicle that is dead commands nothing: by default its world lets go of its last command after so long."""
_SECOND = 1e-9


def findings(plan: Plan, run: RunData) -> Sequence[Finding]:
    """Of a run whose agents are vehicles."""
    parameters: MavParameters = plan.agents[0].parameters
    names = tuple(agent.name for agent in plan.agents)
    parts = (
        _shape(parameters, names, run),
        _spread(run),
        _drift(parameters, names, run),
        _distances(names, run),
        _frames(names, run),
        _consistency(run),
        _lost(parameters, names, run),
    )
    return [finding for part in parts for finding in part]


# -- shape ----------------------------------------------------------------------------------------------------------


def shape_errors(
    parameters: MavParameters, positions: Series, dead: Mapping[int, Sequence[Kill]] | None = None
) -> Floats:
    """How far each vehicle is from its place in the reference about the centre of those that live, (T, N) [m].

    Args:
        parameters: references and script.
        positions: true ones, (T, 3N).
        dead: vehicle → its deaths; NaN while it is dead.
    """
    vehicles = positions.value.shape[1] // 3
    places = positions.value.reshape(-1, vehicles, 3).copy()
    for vehicle, kills in (dead or {}).items():
        for kill in kills:
            until_ns = np.iinfo(np.int64).max if kill.until_ns is None else kill.until_ns
            places[(positions.time_ns >= kill.at_ns) & (positions.time_ns < until_ns), vehicle] = np.nan
    shapes = {name: parameters.places(name, vehicles) for name in parameters.references}
    wanted = np.stack([shapes[parameters.reference_at(int(time_ns))] for time_ns in positions.time_ns])
    deviations = places - wanted
    living = np.isfinite(deviations).sum(axis=1, keepdims=True)
    centre = np.nansum(deviations, axis=1, keepdims=True) / np.maximum(living, 1)
    return np.asarray(np.linalg.norm(deviations - centre, axis=-1))


def _shape(parameters: MavParameters, names: tuple[str, ...], run: RunData) -> Iterator[Finding]:
    positions = run.world_reports.get("positions")
    if positions is None:
        return
    dead: dict[int, list[Kill]] = {}
    kills = _kills(run)
    for kill in kills:
        dead.setdefault(names.index(kill.agent), []).append(kill)
    changes = [0, *(leg.at for leg in parameters.script), *(kill.at_ns for kill in kills)]
    changes += (kill.until_ns for kill in kills if kill.until_ns is not None)
    settled = np.all([(positions.time_ns < at) | (positions.time_ns >= at + SETTLING_NS) for at in changes], axis=0)
    errors = shape_errors(parameters, positions, dead)[settled]
    if np.isfinite(errors).any():
        text = f"rms of places in the formation, from {SETTLING_NS * _SECOND:g} s after each change on"
        yield Finding("formation error", float(np.sqrt(np.nanmean(errors**2))), "m", text)
        yield Finding("largest formation error", float(np.nanmax(errors)), "m")


def _kills(run: RunData) -> list[Kill]:
    return [fault for fault in run.faults_in_effect if isinstance(fault, Kill)]


# -- spread of the estimates ----------------------------------------------------------------------------------------


def estimate_spread(estimates: Mapping[str, Series], component: int = 0) -> tuple[NDArray[np.int64], Floats]:
    """Largest minus smallest estimate of one component among those who report it at an instant.

    Args:
        estimates: vehicle → its reports.
        component: of the state; 0 is r₁ₓ.
    Returns:
        Instants (T,) [ns] and spreads (T,).
    """
    times = np.concatenate([mine.time_ns for mine in estimates.values()])
    values = np.concatenate([mine.value[:, component] for mine in estimates.values()])
    instants, place = np.unique(times, return_inverse=True)
    largest, smallest = np.full(len(instants), -np.inf), np.full(len(instants), np.inf)
    np.maximum.at(largest, place, values)
    np.minimum.at(smallest, place, values)
    return instants, largest - smallest


def _spread(run: RunData) -> Iterator[Finding]:
    if "formation" not in run.quantities():
        return
    instants, spread = estimate_spread(run.estimates("formation"))
    worst = int(spread.argmax())
    text = f"of r̂₁ₓ, at {instants[worst] * _SECOND:.2f} s; median {np.median(spread):.3g} m"
    yield Finding("largest spread of estimates", float(spread[worst]), "m", text)


# -- the centre of gravity --------------------------------------------------------------------------------------------


def pushed_centre(parameters: MavParameters, forces: Mapping[str, Series]) -> tuple[NDArray[np.int64], Floats]:
    """Where the vehicles' forces alone would have moved the centre of gravity, which a common estimate leaves alone.

    c̈ = Σ_i u_i / (N m), forces held from report to report, but no longer than `HELD_NS`.

    Returns:
        Instants (T,) [ns] and displacements (T, 3) [m].
    """
    instants = np.unique(np.concatenate([mine.time_ns for mine in forces.values()]))
    total = np.zeros((len(instants), 3))
    for mine in forces.values():
        rows = np.searchsorted(mine.time_ns, instants, side="right") - 1
        held = (rows >= 0) & (instants - mine.time_ns[rows] < HELD_NS)
        total += np.where(held[:, np.newaxis], mine.value[rows], 0.0)
    steps = np.diff(instants, append=instants[-1])[:, np.newaxis] * _SECOND
    acceleration = total / (len(forces) * parameters.mass)
    gained = np.cumsum(acceleration * steps, axis=0)
    velocity = np.vstack([np.zeros((1, 3)), gained[:-1]])
    moved = np.cumsum(velocity * steps + acceleration * steps**2 / 2, axis=0)
    return instants, np.vstack([np.zeros((1, 3)), moved[:-1]])


def _drift(parameters: MavParameters, names: Sequence[str], run: RunData) -> Iterator[Finding]:
    centre = run.world_reports.get("centre")
    if centre is not None and len(centre.value):
        moved = float(np.linalg.norm(centre.value[-1] - centre.value[0]))
        yield Finding("drift of the centre of gravity", moved, "m", "by wind and by estimates; nothing holds it")
    if "force" in run.quantities():
        _, pushed = pushed_centre(parameters, run.estimates("force"))
        text = f"what Σ u_i / ({len(names)} m) alone makes of it"
        yield Finding("drift by differing estimates", float(np.linalg.norm(pushed[-1])), "m", text)


def _distances(names: Sequence[str], run: RunData) -> Iterator[Finding]:
    positions = run.world_reports.get("positions")
    if positions is None or not len(positions.value):
        return
    places = positions.value.reshape(len(positions.value), len(names), 3)
    first, second = np.triu_indices(len(names), 1)
    distances = np.linalg.norm(places[:, first] - places[:, second], axis=-1)
    when, pair = np.unravel_index(int(distances.argmin()), distances.shape)
    who = f"{names[first[pair]]} and {names[second[pair]]} at {positions.time_ns[when] * _SECOND:.2f} s"
    collisions = sum(note["what"] == "collision" for note in run.notes)
    collided = f"{collisions or 'no'} collision{'' if collisions == 1 else 's'}"
    yield Finding("closest approach", float(distances[when, pair]), "m", f"{who}; {collided}")


# -- frames ---------------------------------------------------------------------------------------------------------


def _frames(names: Sequence[str], run: RunData) -> Iterator[Finding]:
    """Each vehicle's frame is what turns its true attitude into its estimate: E = q̂ ⊙ q*."""
    if "attitude" not in run.quantities():
        return
    frames: dict[int, list[Floats]] = {}
    for name, mine in run.estimates("attitude").items():
        for index, value, true in zip(mine.sample.tolist(), mine.value, run.truth("attitude")[name], strict=True):
            if np.isfinite(true).all():
                frames.setdefault(index, []).append(quaternion_product(value, conjugate(true)))
    angles = [
        angle_between(mean, each)
        for all_ in frames.values()
        for mean in [mean_quaternion(np.array(all_))]
        for each in all_
    ]
    if angles:
        spread = math.degrees(math.sqrt(sum(angle**2 for angle in angles) / len(angles)))
        yield Finding("disagreement on the inertial frame", spread, "deg", f"rms to the mean of {len(names)} vehicles")


# -- consistency ----------------------------------------------------------------------------------------------------


def mean_nees(run: RunData) -> tuple[float, float, float] | None:
    """Mean NEES of all vehicles per degree of freedom, and its bounds for a consistent filter (95 %); None without P.

    Reports at least `INDEPENDENT_NS` apart count, and those of one instant as one, since vehicles share what they know.
    """
    if not {"formation", "covariance"} <= set(run.quantities()):
        return None
    means: dict[int, list[float]] = {}
    for name, values in run.nees("formation").items():
        reports = run.estimates("formation")[name]
        size = reports.value.shape[1]
        last_ns = -INDEPENDENT_NS
        for time_ns, index, value in zip(
            reports.time_ns.tolist(), reports.sample.tolist(), values.tolist(), strict=True
        ):
            if time_ns - last_ns >= INDEPENDENT_NS and math.isfinite(value):
                last_ns = time_ns
                means.setdefault(index, []).append(value / size)
    if not means:
        return None
    low, high = chi_square_bounds(size, len(means))
    return float(np.mean([np.mean(values) for values in means.values()])), low / size, high / size


def _consistency(run: RunData) -> Iterator[Finding]:
    found = mean_nees(run)
    if found is None:
        return
    value, low, high = found
    verdict = "overconfident" if value > high else "cautious" if value < low else "consistent"
    yield Finding(
        "NEES per degree of freedom", value, "", f"{verdict}: 95 % of consistent filters in {low:.2f} to {high:.2f}"
    )


def _lost(parameters: MavParameters, names: tuple[str, ...], run: RunData) -> Iterator[Finding]:
    """What could not be estimated any more once vehicles were dead."""
    kills = _kills(run)
    for kill in kills:
        dead = {names.index(other.agent) for other in kills if other.in_force(kill.at_ns)}
        left = observability(len(names), parameters.in_sight(names, dead), dead)
        relative = ", ".join(f"r{number + 1}" for number in left.lost)
        text = f"unobservable: {relative}; among those that are left {left.describe(names)}"
        yield Finding(f"without vehicle {kill.agent}", text=text)
