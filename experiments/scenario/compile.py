"""Compiles a scenario to a plan: graph, world, links and faults by name, and checks that they fit together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from ... import topologies
from ...agents.coupled_world import couple
from ...agents.plan import AgentPlan, Coupled, Plan, World, moving
from ...errors import BadInput
from ...topologies import TimedGraph
from ...topologies.graph_settings import FromFile, GraphSettings
from ...topologies.over_time import GRAPHS, Proximity
from ...topologies.presence import Places as GraphPlaces
from ...transport.faults import Fault, LinkName
from ...transport.links import LinkSettings
from ...worlds.moving.motions import MovingWorld
from ...worlds.moving.moving_settings import MovingSettings
from ...worlds.own_world import OwnWorld, OwnWorldSettings
from ..evaluation.evaluation import evaluation_class
from .consistency import inconsistencies
from .edge_settings import edge_settings
from .expansion import expand
from .fault_conflicts import conflicts
from .fault_places import Places, changed_links, group_problems, parse_agents
from .link_schema import LinkOverride
from .schema import AgentKind, Scenario
from .slots import radio_slots
from .yaml_document import Problem


def compile_plan(scenario: Scenario) -> Plan:
    """The plan of a scenario, without faults that start after the end of the run.

    Raises:
        BadInput: all parts that do not fit together.
    """
    plan, problems = attempt(scenario)
    if plan is None or problems:
        raise BadInput("\n".join(f"{'.'.join(map(str, problem.loc))}: {problem.message}" for problem in problems))
    return plan


def attempt(scenario: Scenario) -> tuple[Plan | None, list[Problem]]:
    """The plan, or None, and all problems, each with its place in the scenario."""
    problems: list[Problem] = []
    of_world: list[Problem] = []
    try:
        timed, world = _surroundings(scenario, of_world)
    except _Refused as refused:
        return None, [refused.problem]
    places = Places(topologies.edges(timed.union), scenario.groups, scenario.seed, world)
    of_edges = _edge_settings(scenario.topology, timed.union, problems)
    problems.extend(Problem(("groups", name), text) for name, text in group_problems(scenario.groups, places.agents))
    links = _links(scenario, of_edges, places, problems)
    faults = _faults(scenario, places, problems)
    problems.extend(of_world)
    plan = Plan(
        scenario.name,
        scenario.seed,
        scenario.duration,
        _agents(timed.union, _kinds(scenario, places, problems), placed=moving(world) is None),
        links,
        None if isinstance(world, Coupled) else world,
        faults,
        presence={link: spans for edge, spans in timed.presence.items() for link in (edge, edge[::-1])},
        slots=radio_slots(links),
        groups=scenario.groups,
        coupled=world if isinstance(world, Coupled) else None,
    )
    if plan.coupled is not None:
        try:
            plan = couple(plan)
        except BadInput as error:
            problems.append(Problem(("topology",), str(error)))
    try:
        classes = {evaluation_class(agent.kind) for agent in plan.agents}
        plan = replace(plan, keeps_payloads=any(each.needs_payloads for each in classes))
    except BadInput as error:
        problems.append(Problem(("agents",), str(error)))
    if not problems:
        problems = [*inconsistencies(plan), *conflicts(plan, scenario.faults)]
    return plan, problems


class _Refused(Exception):
    """A problem that leaves no plan."""

    def __init__(self, error: BadInput, *place: str) -> None:
        super().__init__(str(error))
        self.problem = Problem((*place, *error.place), str(error))


def _surroundings(scenario: Scenario, problems: list[Problem]) -> tuple[TimedGraph, World | Coupled | None]:
    """The graph over time and the world; a proximity graph is made from the world, any other before the world.

    Raises:
        _Refused: no graph, or no world from which it could follow.
    """
    seed, of_world = scenario.seed, scenario.world
    if isinstance(scenario.topology, Proximity) and isinstance(of_world, MovingSettings | OwnWorldSettings):
        try:
            world = of_world.build({}, seed, ())
        except BadInput as error:
            raise _Refused(error, "world") from error
        if isinstance(world, MovingWorld | OwnWorld) and world.moves:
            everywhere = world
            return _graph(scenario, lambda time_ns: _places(everywhere, time_ns)), world
    timed = _graph(scenario)
    return timed, _world(scenario, timed.union, problems)


def _places(world: MovingWorld | OwnWorld, time_ns: int) -> dict[str, NDArray[np.float64]]:
    return {agent: world.position(agent, time_ns) for agent in world.agents}


def _graph(scenario: Scenario, places: GraphPlaces | None = None) -> TimedGraph:
    try:
        return scenario.topology.over_time(scenario.seed, scenario.duration, places)
    except BadInput as error:
        raise _Refused(error, "topology", GRAPHS.name_of(type(scenario.topology))) from error


def _kinds(scenario: Scenario, places: Places, problems: list[Problem]) -> dict[str, AgentKind]:
    kinds: dict[str, AgentKind] = dict.fromkeys(places.agents, scenario.agents)
    for index, some in enumerate(scenario.agents.only):
        try:
            named = parse_agents(some.where, replace(places, fault_id=f"agents{index + 1}"))
        except BadInput as error:
            problems.append(Problem(("agents", "only", index, "where"), str(error)))
            continue
        kinds.update(dict.fromkeys(named, some))
    return kinds


def _agents(graph: nx.Graph, kinds: Mapping[str, AgentKind], *, placed: bool) -> tuple[AgentPlan, ...]:
    positions = topologies.positions(graph) if placed else {}
    neighbours = {name: tuple(topologies.neighbours(graph, name)) for name in topologies.agents(graph)}
    return tuple(
        AgentPlan(
            name,
            kinds[name].kind,
            kinds[name].parameters,
            near,
            {other: len(neighbours[other]) for other in (name, *near)},
            positions.get(name),
            kinds[name].compute,
        )
        for name, near in neighbours.items()
    )


def _edge_settings(topology: GraphSettings, graph: nx.Graph, problems: list[Problem]) -> list[LinkOverride]:
    path = Path(topology.path) if isinstance(topology, FromFile) else None
    try:
        return edge_settings(graph, path.parent if path else Path.cwd())
    except BadInput as error:
        problems.append(Problem(("topology", GRAPHS.name_of(type(topology))), f"{f'{path}: ' if path else ''}{error}"))
        return []


def _links(
    scenario: Scenario, of_edges: list[LinkOverride], places: Places, problems: list[Problem]
) -> dict[LinkName, LinkSettings]:
    """The settings of each link: those of all, changed by what edges of the graph say, changed by entries of `only`."""
    links = dict.fromkeys(places.links, scenario.links.base)
    for entry in of_edges:
        try:
            changed = changed_links(entry.where, entry.changes, places)
        except BadInput as error:
            problems.append(Problem(("topology",), str(error)))
            continue
        links.update({link: replace(links[link], **entry.changes) for link in changed})
    for index, override in enumerate(scenario.links.only):
        if not override.changes:
            text = "says where, and nothing that differs there: write for example loss: 0.3, or leave it out"
            problems.append(Problem(("links", "only", index), text))
        try:
            changed = changed_links(override.where, override.changes, replace(places, fault_id=f"only{index + 1}"))
        except BadInput as error:
            problems.append(Problem(("links", "only", index, "where"), str(error)))
            continue
        links.update({link: replace(links[link], **override.changes) for link in changed})
    return links


def _faults(scenario: Scenario, places: Places, problems: list[Problem]) -> tuple[Fault, ...]:
    faults: list[Fault] = []
    for index, entry in enumerate(scenario.faults):
        if not scenario.in_run(entry):
            continue
        try:
            faults += expand(entry, f"t{index + 1}", places, scenario.duration)
        except BadInput as error:
            problems.append(Problem(("faults", index, entry.place), str(error)))
    return tuple(faults)


def _world(scenario: Scenario, graph: nx.Graph, problems: list[Problem]) -> World | Coupled | None:
    if scenario.world is None:
        return None
    positions = topologies.positions(graph)
    try:
        if not positions and scenario.world.needs_places:
            kind = GRAPHS.name_of(type(scenario.topology))
            text = f"agents of topology {kind} have no positions, and this world needs them"
            raise BadInput(f"{text}: take an array, or drop the world")
        world: World | Coupled = scenario.world.build(positions, scenario.seed, topologies.agents(graph))
    except BadInput as error:
        problems.append(Problem(("world", *error.place), str(error)))
        return None
    return world
