"""Topologies: connected simple graphs of named agents, and the validation that all graphs pass."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from numbers import Real

import networkx as nx

from ..errors import BadInput
from .naming import check_name, natural_key

Position = tuple[float, ...]


def at_least(value: int, bound: int, what: str) -> int:
    """Return the value if it is at least the bound.

    Raises:
        BadInput: the value is below the bound.
    """
    if value < bound:
        raise BadInput(f"{what} is {value}, it must be at least {bound}")
    return value


def agents(graph: nx.Graph) -> list[str]:
    """Names of all agents in natural order, which is the order of rows of every matrix in this package."""
    return sorted(graph, key=natural_key)


def edges(graph: nx.Graph) -> list[tuple[str, str]]:
    """All edges in natural order, each with its lower name first."""
    return sorted(
        (ordered(*edge) for edge in graph.edges()), key=lambda edge: (natural_key(edge[0]), natural_key(edge[1]))
    )


def ordered(first: str, second: str) -> tuple[str, str]:
    """The two ends of an edge, the lower name first."""
    return (first, second) if natural_key(first) <= natural_key(second) else (second, first)


def neighbours(graph: nx.Graph, agent: str) -> list[str]:
    """Neighbours of an agent in natural order.

    Raises:
        BadInput: no such agent.
    """
    known(graph, agent)
    return sorted(graph[agent], key=natural_key)


def known(graph: nx.Graph, agent: str) -> str:
    """Return the agent's name if the graph has it.

    Raises:
        BadInput: no such agent; the message lists those that exist.
    """
    if agent in graph:
        return agent
    raise BadInput(f"there is no agent {agent!r} in this topology: its agents are {_listed(agents(graph))}")


def positions(graph: nx.Graph) -> dict[str, Position]:
    """Agent → position (x, y) or (x, y, z) in metres; empty if the topology has none."""
    return {agent: graph.nodes[agent]["position"] for agent in agents(graph) if "position" in graph.nodes[agent]}


def from_edges(
    pairs: Iterable[tuple[str, str]],
    names: Iterable[str] = (),
    positions: Mapping[str, Sequence[float]] | None = None,
) -> nx.Graph:
    """Build and validate the graph of these edges.

    Args:
        pairs: edges, each once, with the ends in any order.
        names: further agents; those of the edges need not be repeated.
        positions: agent → (x, y) or (x, y, z) in metres, for every agent or for none.

    Raises:
        BadInput: see `validate`; or a position is given for an agent that does not exist.
    """
    raw = nx.MultiGraph()
    raw.add_nodes_from(names)
    raw.add_edges_from((first, second) for first, second in pairs)
    for agent, position in (positions or {}).items():
        known(raw, agent)
        raw.nodes[agent]["position"] = position
    return validate(raw)


def validate(
    graph: nx.Graph,
    *,
    loop: str = "remove it",
    parallel: str = "keep one, it carries both directions",
    apart: str = "link the parts",
) -> nx.Graph:
    """Validate a networkx graph, and return a copy: agents and edges in natural order, `position` of nodes in metres.

    Args:
        graph: undirected, with or without parallel edges.
        loop: what the error of an edge from an agent to itself proposes.
        parallel: what the error of an edge that is there twice proposes.
        apart: what the error of a graph that is not connected proposes.
    Raises:
        BadInput: fewer than 2 agents, a directed or repeated edge, an edge of an agent to itself, an invalid name, a
            graph that is not connected, positions of only some agents, or not finite. The message names the offender.
    """
    if graph.is_directed():
        raise BadInput("the topology is directed, links go both ways: use an undirected graph")
    for agent in graph:
        check_name(agent)
    if len(graph) < 2:
        raise BadInput(f"a topology of {len(graph)} agents is not a network: it needs at least 2")
    _check_edges(graph, loop, parallel)
    _check_connected(graph, apart)
    clean = nx.Graph()
    clean.add_nodes_from(agents(graph))
    clean.add_edges_from(edges(graph))
    _copy_positions(graph, clean)
    return clean


def _check_edges(graph: nx.Graph, loop: str, parallel: str) -> None:
    seen: set[tuple[str, str]] = set()
    for edge in edges(graph):
        if edge[0] == edge[1]:
            raise BadInput(f"agent {edge[0]} has an edge to itself, {edge[0]}-{edge[1]}: {loop}")
        if edge in seen:
            raise BadInput(f"the edge {edge[0]}-{edge[1]} is there more than once: {parallel}")
        seen.add(edge)


def _check_connected(graph: nx.Graph, remedy: str) -> None:
    first = agents(graph)[0]
    reached = nx.node_connected_component(graph, first)
    if len(reached) < len(graph):
        missing = _listed([agent for agent in agents(graph) if agent not in reached])
        raise BadInput(f"the topology is not connected, there is no path from {first} to {missing}: {remedy}")


def _copy_positions(source: nx.Graph, target: nx.Graph) -> None:
    given = positions(source)
    for agent in agents(source) if given else ():
        if agent not in given:
            raise BadInput(f"agent {agent} has no position while others have one: give all agents one, or none")
        target.nodes[agent]["position"] = _position(agent, given[agent])


def _position(agent: str, value: object) -> Position:
    if isinstance(value, Sequence) and len(value) in {2, 3} and all(_finite(part) for part in value):
        return tuple(float(part) for part in value)
    raise BadInput(f"the position of agent {agent} is {value!r}: write 2 or 3 finite numbers, in metres")


def _finite(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def _listed(names: Sequence[str], limit: int = 8) -> str:
    more = f" and {len(names) - limit} more" if len(names) > limit else ""
    return ", ".join(names[:limit]) + more
