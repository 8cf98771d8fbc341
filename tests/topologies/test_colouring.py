"""The colouring for slot plans."""

from itertools import combinations

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery import topologies
from volery.errors import BadInput


def _named(count: int, probability: float, seed: int) -> nx.Graph:
    raw = nx.gnp_random_graph(count, probability, seed=seed)
    return nx.relabel_nodes(raw, {node: str(node) for node in raw})


GRAPHS = st.builds(_named, st.integers(1, 14), st.floats(0.05, 1.0), st.integers(0, 10**6))


@given(GRAPHS, st.integers(1, 3))
def test_node_colouring_separates_within_the_distance(graph: nx.Graph, distance: int) -> None:
    """Agents within the distance differ, and the number of colours keeps its bound."""
    colours = topologies.node_colouring(graph, distance)
    assert list(colours) == topologies.agents(graph)
    for first, second in combinations(graph, 2):
        if second in topologies.ball(graph, first, distance):
            assert colours[first] != colours[second]
    crowd = max(len(topologies.ball(graph, agent, distance)) for agent in graph)
    assert max(colours.values()) < crowd


@given(GRAPHS, st.data())
def test_a_colouring_does_not_depend_on_the_order_of_arrival(graph: nx.Graph, data: st.DataObject) -> None:
    """The same graph built in another order gets the same colours."""
    other = nx.Graph()
    other.add_nodes_from(data.draw(st.permutations(list(graph))))
    other.add_edges_from((second, first) for first, second in data.draw(st.permutations(list(graph.edges()))))
    assert topologies.node_colouring(other) == topologies.node_colouring(graph)


def test_hidden_terminals_get_different_slots() -> None:
    """On a star all leaves hear the hub, so at distance 2 all colours differ; at distance 1 two are enough."""
    star = topologies.star(6)
    assert len(set(topologies.node_colouring(star).values())) == 6
    assert len(set(topologies.node_colouring(star, 1).values())) == 2


def test_crowded_agents_choose_first() -> None:
    """On the line 1-3-4-2 the inner agents choose first, and two colours are enough; by name it would take three."""
    graph = topologies.from_edges([("1", "3"), ("3", "4"), ("4", "2")])
    assert topologies.node_colouring(graph, 1) == {"1": 1, "2": 0, "3": 0, "4": 1}


def test_distance_below_one_is_refused() -> None:
    """A distance of zero separates nobody."""
    with pytest.raises(BadInput, match="distance is 0"):
        topologies.node_colouring(topologies.line(3), 0)
