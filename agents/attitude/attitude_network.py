"""The network of measurement units as a whole: the attitude that all sensors tell, errors, what cannot work."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import chain

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from ...estimators.attitude.directions import least_squares_attitude
from ...estimators.attitude.dynamic_consensus import largest_step
from ...estimators.error_measures import attitude_difference, integrated_square_error
from ...rotations import euler_to_quaternion, rotate, same_sign
from ...units import period_ns
from ...worlds.rigid_body.measurement_units import DIRECTIONS, RigidBodyWorld
from ..agent import Finding, RunData
from ..plan import AgentPlan, Plan
from .attitude_unit_settings import AttitudeParameters

Floats = NDArray[np.float64]

ATTITUDE, ALONE, OWN, MESSAGES = "attitude", "attitude-alone", "own-attitude", "messages"
FATES = ("used", "too late", "ahead of the clock")
"""What becomes of a message; one that is ahead is used too."""


def units(plan: Plan) -> list[AgentPlan]:
    """The measurement units of a plan."""
    return [agent for agent in plan.agents if isinstance(agent.parameters, AttitudeParameters)]


def network(plan: Plan) -> list[AgentPlan]:
    """Those of them that are in the network."""
    return [unit for unit in units(plan) if not unit.parameters.is_alone(unit.name)]


def partners(plan: Plan, name: str) -> list[str]:
    """The units that a unit ever talks to."""
    inside = {unit.name for unit in network(plan)}
    return [other for other in plan.agent(name).neighbours if other in inside] if name in inside else []


def truth(plan: Plan, index: int) -> Floats:
    """The attitude of the body at a sample."""
    assert plan.world is not None
    return plan.world.truth(period_ns(_parameters(plan).rate, index))[:4]


def oracle(plan: Plan, index: int) -> Floats | None:
    """The attitude that fits best the directions that all sensors of the network see in one sample.

    Each is turned into the body's frame by the mounting of its unit. Of q and −q, which are one attitude, that nearer
    to the true one. None where the directions leave a turn open.
    """
    observed, references = [], []
    for unit in network(plan):
        for sensor, direction in DIRECTIONS.items():
            if not _has(plan, unit.name, sensor):
                continue
            value = plan.measure(unit.name, sensor, index)
            if value is not None and 0.0 < (norm := float(np.linalg.norm(value))) < math.inf:
                mounting = euler_to_quaternion(*(unit.parameters.mounting(unit.name) or (0.0, 0.0, 0.0)))
                observed.append(rotate(mounting, value / norm))
                references.append(direction)
    found = least_squares_attitude(np.array(observed).reshape(-1, 3), np.array(references).reshape(-1, 3))
    return None if found is None else same_sign(found, truth(plan, index))


def findings(plan: Plan, run: RunData) -> Sequence[Finding]:
    """Each unit's root mean square error, the integral of the square of half of it, Betanzos 2024, (31); messages."""
    found = []
    for quantity in (ATTITUDE, ALONE):
        for name, series in run.estimates(quantity).items() if quantity in run.quantities() else ():
            true = np.array([truth(plan, int(index)) for index in series.sample])
            angle = np.linalg.norm(attitude_difference(series.value, true), axis=1)
            where = "alone" if quantity == ALONE else "in the network"
            rms = math.degrees(math.sqrt(float(np.mean(angle**2))))
            ise = integrated_square_error(series.time_ns, 0.5 * angle)
            text = f"root mean square; the ISE of half of it is {ise:.4g} rad² s"
            found.append(Finding(f"attitude error of unit {name}, {where}", rms, "deg", text))
    return [*found, *_messages(run)]


def _messages(run: RunData) -> Iterator[Finding]:
    """What became of messages until each unit's last count of them; units that died began to count anew."""
    if MESSAGES not in run.quantities():
        return
    total = np.zeros(len(FATES))
    for series in run.estimates(MESSAGES).values():
        more = np.diff(series.value, axis=0, prepend=0.0)
        total += np.where((more < 0.0).any(axis=1, keepdims=True), series.value, more).sum(axis=0)
    for fate, count in zip(FATES, total.tolist(), strict=True):
        yield Finding(f"messages {fate}", count)


def problems(plan: Plan) -> Sequence[str]:
    """What makes a plan impossible for measurement units, each a sentence with the remedy."""
    if any(agent.parameters != _parameters(plan) for agent in units(plan)):
        return ["units name each other in mountings and alone: write the same for all agents of kind attitude-unit"]
    if not isinstance(plan.world, RigidBodyWorld):
        return ["attitude-unit needs a body that turns: add `world: {kind: rigid-body, units: …}`"]
    strangers = [*_strangers(plan)]
    return strangers or list(chain(_rates(plan), _blind(plan), _mountings(plan), _unstable(plan), _late(plan)))


def _strangers(plan: Plan) -> Iterator[str]:
    known, parameters = {agent.name for agent in plan.agents}, _parameters(plan)
    for field, named in (("mountings", parameters.mountings), ("alone", parameters.alone)):
        for name in named:
            if str(name) not in known:
                yield f"{field} names {name}, and there is no such agent: it has {', '.join(sorted(known))}"


def _rates(plan: Plan) -> Iterator[str]:
    rate = _parameters(plan).rate
    for unit in units(plan):
        for sensor, its in plan.world.sensors(unit.name).items() if plan.world is not None else ():
            if its != rate:
                yield f"agents.rate is {rate:g} Hz, but {unit.name}.{sensor} runs at {its:g} Hz: make them equal"
                return


def _blind(plan: Plan) -> Iterator[str]:
    """Nobody, or a unit alone, that sees any direction."""
    if not any(_has(plan, unit.name, sensor) for unit in network(plan) for sensor in DIRECTIONS):
        yield "no unit of the network has a sensor: give one to a unit that is not alone in world.units"
    for unit in units(plan):
        if unit.parameters.is_alone(unit.name) and not any(_has(plan, unit.name, sensor) for sensor in DIRECTIONS):
            yield f"unit {unit.name} is alone and has no sensor, so it can know nothing: give it one in world.units"


def _mountings(plan: Plan) -> Iterator[str]:
    for unit in units(plan):
        sees = any(_has(plan, unit.name, sensor) for sensor in DIRECTIONS)
        if sees and unit.parameters.mounting(unit.name) is None:
            yield f"mountings lacks unit {unit.name}, which has a sensor: add {unit.name}: [0, 0, 0] if it is aligned"


def _unstable(plan: Plan) -> Iterator[str]:
    """A step of the dynamic consensus that is too large for the graph."""
    names = [unit.name for unit in network(plan)]
    graph = nx.Graph([(name, other) for name in names for other in partners(plan, name)])
    graph.add_nodes_from(names)
    if not names:
        return
    if not nx.is_connected(graph):
        yield "without the units that are alone, the network falls apart: link its parts"
    parameters, bound = _parameters(plan), largest_step(nx.to_numpy_array(graph, weight=None))
    if not parameters.step < bound:
        yield (
            f"gain / rate is {parameters.step:.4g} s, and on this graph averages converge below {bound:.4g} s only: "
            f"take a gain below {bound * parameters.rate:.4g}, or a higher rate"
        )


def _late(plan: Plan) -> Iterator[str]:
    """Frames that, at mean latency, come when they are too old already."""
    parameters = _parameters(plan)
    limit_ns = period_ns(parameters.rate, parameters.max_age)
    for unit in network(plan):
        for other in partners(plan, unit.name):
            settings = plan.links[unit.name, other]
            airtime_ns = settings.airtime_ns(parameters.largest_payload)
            after_ns = parameters.spread_ns() + unit.compute_ns + airtime_ns + int(settings.latency.mean_ns)
            if after_ns >= limit_ns:
                yield (
                    f"a frame of mean latency from {unit.name} to {other} comes up to {after_ns / 1e6:.3f} ms after "
                    f"its sample, and {limit_ns / 1e6:.3f} ms is too old: raise max_age, or lower rate or latency"
                )
                return


def _has(plan: Plan, name: str, sensor: str) -> bool:
    return plan.world is not None and sensor in plan.world.sensors(name)


def _parameters(plan: Plan) -> AttitudeParameters:
    parameters: AttitudeParameters = units(plan)[0].parameters
    return parameters
