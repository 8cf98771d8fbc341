"""Colourings for slot plans: what has one colour may be on the air at one time. Deterministic in natural order."""

from __future__ import annotations

from itertools import count

import networkx as nx

from .bounds import at_least
from .graphs import agents, edges

_Taken = dict[str, dict[int, str]]


def edge_colouring(graph: nx.Graph) -> dict[tuple[str, str], int]:
    """Edge, lower name first → colour from 0, edges that share an agent differing; at most Δ + 1 colours.

    Δ is the largest degree. Misra and Gries 1992; where exchanging two colours along a path makes room, no fan is
    turned, and so a bipartite graph gets Δ colours (König 1916).
    """
    taken: _Taken = {agent: {} for agent in agents(graph)}
    for first, second in edges(graph):
        _colour(taken, first, second)
    colour = {(agent, other): hue for agent, at in taken.items() for hue, other in at.items()}
    return {edge: colour[edge] for edge in edges(graph)}


def node_colouring(graph: nx.Graph, distance: int = 2) -> dict[str, int]:
    """Agent → colour from 0, agents at most `distance` hops apart differing; greedy, the most crowded agent first.

    At most 1 + (the largest number of agents within that distance of one) colours, so 1 + Δ² at distance 2.

    Raises:
        BadInput: a distance below 1.
    """
    crowd = nx.power(graph, at_least(distance, 1, "distance"))
    order = sorted(agents(graph), key=lambda agent: -crowd.degree[agent])
    colours: dict[str, int] = {}
    for agent in order:
        colours[agent] = _lowest_free({colours[other] for other in crowd[agent] if other in colours})
    return {agent: colours[agent] for agent in agents(graph)}


def _colour(taken: _Taken, agent: str, other: str) -> None:
    """Colour one more edge: `taken` maps agent → colour → the neighbour over the edge of that colour."""
    free, last = _lowest_free(taken[agent]), _lowest_free(taken[other])
    fan = [other]
    if _path(taken, agent, free, last)[-1] == other:
        fan = _fan(taken, agent, other)
        last = _lowest_free(taken[fan[-1]])
    _exchange(taken, _path(taken, agent, free, last), free, last)
    end = next(index for index, leaf in enumerate(fan) if last not in taken[leaf])
    hues = {leaf: hue for hue, leaf in taken[agent].items()}
    rotated = [*(hues[leaf] for leaf in fan[1 : end + 1]), last]
    for leaf in fan[1 : end + 1]:
        del taken[agent][hues[leaf]], taken[leaf][hues[leaf]]
    for leaf, hue in zip(fan[: end + 1], rotated, strict=True):
        taken[agent][hue], taken[leaf][hue] = leaf, agent


def _fan(taken: _Taken, agent: str, other: str) -> list[str]:
    """Neighbours of the agent, each linked to it by an edge of the lowest colour that is free at the one before."""
    fan = [other]
    while True:
        leaf = taken[agent].get(_lowest_free(taken[fan[-1]]))
        if leaf is None or leaf in fan:
            return fan
        fan.append(leaf)


def _path(taken: _Taken, start: str, free: int, other: int) -> list[str]:
    """Agents along the edges that alternate between `other` and `free`, from one at which `free` is free to the end."""
    path, hue = [start], other
    while (following := taken[path[-1]].get(hue)) is not None:
        path.append(following)
        hue = free if hue == other else other
    return path


def _exchange(taken: _Taken, path: list[str], first: int, second: int) -> None:
    for agent in path:
        at = taken[agent]
        at.update({new: at.pop(old) for old, new in ((first, second), (second, first)) if old in at})


def _lowest_free(used: dict[int, str] | set[int]) -> int:
    return next(colour for colour in count() if colour not in used)
