"""The network of measurement units: its members, and what makes it impossible."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import networkx as nx

from ...estimators.attitude.dynamic_consensus import largest_step
from ...units import period_ns
from ...worlds.rigid_body.measurement_units import DIRECTIONS, RigidBodyWorld
from ..plan import AgentPlan, Plan
from .attitude_unit_settings import AttitudeParameters

ATTITUDE, ALONE, OWN, MESSAGES = "attitude", "attitude-alone", "own-attitude", "messages"
FATES = ("used", "too late", "ahead of the clock")
"""Outcomes of a message; one that is ahead is used too."""


def units(plan: Plan) -> list[AgentPlan]:
    """The measurement units of a plan."""
    return [agent for agent in plan.agents if isinstance(agent.parameters, AttitudeParameters)]


def network(plan: Plan) -> list[AgentPlan]:
    """Measurement units in the network: those that are not alone."""
    return [unit for unit in units(plan) if not unit.parameters.is_alone(unit.name)]


def partners(plan: Plan, name: str) -> list[str]:
    """Units with which a unit ever exchanges messages."""
    inside = {unit.name for unit in network(plan)}
    return [other for other in plan.agent(name).neighbours if other in inside] if name in inside else []


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
    """Problem of a network, or a unit that is alone, without a sensor."""
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
    """Problem of a step of the dynamic consensus that is too large for the graph."""
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
    """Problem of frames that, at mean latency, arrive too old to be used."""
    parameters = _parameters(plan)
    limit_ns = period_ns(parameters.rate, parameters.max_age)
    for unit in network(plan):
        for other in partners(plan, unit.name):
            settings = plan.links[unit.name, other]
            airtime_ns = settings.airtime_ns(parameters.largest_payload)
            after_ns = parameters.spread_ns() + unit.compute_ns + airtime_ns + settings.typical_latency_ns()
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
