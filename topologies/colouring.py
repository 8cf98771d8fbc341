"""Graph colouring for slot plans: agents of the same colour may transmit at the same time."""

from __future__ import annotations

from itertools import count

import networkx as nx

from .graphs import agents, at_least


def node_colouring(graph: nx.Graph, distance: int = 2) -> dict[str, int]:
    """Agent → colour from 0; agents at most `distance` hops apart have different colours.

    Greedy, agents with the most others within this distance first, then in natural order. It needs at most 1 + (the
    largest number of agents within this distance of one) colours, so 1 + Δ² at distance 2.

    Raises:
        BadInput: a distance below 1.
    """
    crowd = nx.power(graph, at_least(distance, 1, "distance"))
    order = sorted(agents(graph), key=lambda agent: -crowd.degree[agent])
    colours: dict[str, int] = {}
    for agent in order:
        colours[agent] = _lowest_free({colours[other] for other in crowd[agent] if other in colours})
    return {agent: colours[agent] for agent in agents(graph)}


def _lowest_free(used: set[int]) -> int:
    return next(colour for colour in count() if colour not in used)
