"""Random connected graphs, repeatable from a seed, and the proximity graph of moving agents.

If a random graph is not connected, the next one of the same seed is taken, up to a bound of attempts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import networkx as nx
import numpy as np

from ..errors import BadInput
from ..randomness import stream
from ..units import BareMetres, Count, Probability, check_above_zero
from .graphs import Position, at_least, validate
from .naming import check_name, natural_key
from .regular import centred

_TRIES = 100


def geometric(count: Count, radius: BareMetres, seed: int, side: BareMetres = 1.0) -> nx.Graph:
    """Agents at random positions in a square, uniformly distributed, linked if they are near each other.

    Args:
        count: number of agents.
        radius: largest distance of linked agents.
        seed: seed of the positions; by default that of the run.
        side: side of the square.
    Raises:
        BadInput: fewer than 2 agents, a length that is not positive, or no connected graph within the attempts.
    """
    at_least(count, 2, "count")
    check_above_zero("radius", radius, "m")
    check_above_zero("side", side, "m")
    streams = {str(number): stream(seed, "topology", "geometric", str(number)) for number in range(1, count + 1)}

    def draw(attempt: int) -> nx.Graph:
        places = {
            agent: (side * draws.uniform(2 * attempt), side * draws.uniform(2 * attempt + 1))
            for agent, draws in streams.items()
        }
        return proximity(centred(places), radius)

    return _first_connected(draw, f"{count} agents within {side:g} m and a radius of {radius:g} m", "a larger radius")


def erdos_renyi(count: Count, probability: Probability, seed: int) -> nx.Graph:
    """Every pair of agents linked with the same probability, independently: G(N, p) given that it is connected.

    Args:
        count: number of agents.
        probability: probability of each link.
        seed: seed of the links; by default that of the run.
    Raises:
        BadInput: fewer than 2 agents, a probability outside (0, 1], or no connected graph within the attempts.
    """
    at_least(count, 2, "count")
    if not 0 < probability <= 1:
        raise BadInput(f"probability is {probability:g}, it must be above 0 and at most 1")

    def draw(attempt: int) -> nx.Graph:
        return nx.gnp_random_graph(count, probability, seed=_draw_seed(seed, "erdos-renyi", attempt))

    return _numbered(_first_connected(draw, f"{count} agents and probability {probability:g}", "a higher probability"))


def small_world(count: Count, neighbours: int, rewiring: Probability, seed: int) -> nx.Graph:
    """A ring with links to the nearest agents, some of them rewired (Watts and Strogatz).

    Args:
        count: number of agents.
        neighbours: number of neighbours of each agent before rewiring, even.
        rewiring: probability that a link is rewired.
        seed: seed of the links; by default that of the run.
    Raises:
        BadInput: `neighbours` is odd, below 2 or not below the count; `rewiring` outside [0, 1]; no connected graph.
    """
    at_least(neighbours, 2, "neighbours")
    at_least(count, neighbours + 1, "count")
    if neighbours % 2:
        raise BadInput(f"neighbours is {neighbours}, it must be even: half of them on either side of the ring")
    if not 0 <= rewiring <= 1:
        raise BadInput(f"rewiring is {rewiring:g}, it must lie between 0 and 1")

    def draw(attempt: int) -> nx.Graph:
        return nx.watts_strogatz_graph(count, neighbours, rewiring, seed=_draw_seed(seed, "small-world", attempt))

    return _numbered(_first_connected(draw, f"{count} agents and rewiring {rewiring:g}", "more neighbours"))


def proximity(positions: Mapping[str, Sequence[float]], radius: float) -> nx.Graph:
    """Graph of the agents at most `radius` metres apart; it may be disconnected or without any edge.

    Args:
        positions: agent → (x, y) or (x, y, z) in metres, the same number of coordinates for all.
        radius: range in metres.

    Raises:
        BadInput: an invalid name, different numbers of coordinates, or a radius that is not positive.
    """
    check_above_zero("radius", radius, "m")
    names = sorted((check_name(name) for name in positions), key=natural_key)
    places: dict[str, Position] = {name: tuple(map(float, positions[name])) for name in names}
    sizes = {len(place): name for name, place in places.items()}
    if len(sizes) > 1 or not sizes.keys() <= {2, 3}:
        found = ", ".join(f"{size} for agent {name}" for size, name in sizes.items())
        raise BadInput(f"positions need 2 coordinates for all agents, or 3 for all: there are {found}")
    graph = nx.Graph()
    graph.add_nodes_from((name, {"position": place}) for name, place in places.items())
    points = np.array(list(places.values()))
    for index, name in enumerate(names):
        near = np.linalg.norm(points[index + 1 :] - points[index], axis=1) <= radius
        graph.add_edges_from((name, names[index + 1 + other]) for other in np.flatnonzero(near))
    return graph


def _first_connected(draw: Callable[[int], nx.Graph], what: str, remedy: str) -> nx.Graph:
    for attempt in range(_TRIES):
        graph = draw(attempt)
        if nx.is_connected(graph):
            return graph
    raise BadInput(f"none of {_TRIES} draws with {what} is connected: ask for {remedy}, or try another seed")


def _draw_seed(seed: int, kind: str, attempt: int) -> int:
    return int(stream(seed, "topology", kind).uniform(attempt) * 2**53)


def _numbered(graph: nx.Graph) -> nx.Graph:
    return validate(nx.relabel_nodes(graph, {node: str(node + 1) for node in graph}))
