"""Validation of topologies and the order of what is listed."""

import networkx as nx
import pytest

from volery import topologies
from volery.errors import BadInput


def test_agents_and_edges_are_in_natural_order() -> None:
    """Whatever the order of the edges, agents, edges and neighbours come in natural order."""
    graph = topologies.from_edges([("10", "2"), ("2", "1"), ("10", "9")])
    assert topologies.agents(graph) == list(graph) == ["1", "2", "9", "10"]
    assert topologies.edges(graph) == [("1", "2"), ("2", "10"), ("9", "10")]
    assert topologies.neighbours(graph, "10") == ["2", "9"]


def test_copy_keeps_the_original_untouched() -> None:
    """Validating makes a copy; positions become tuples of floats."""
    raw = nx.Graph([("a", "b")])
    raw.nodes["a"]["position"] = [0, 1]
    raw.nodes["b"]["position"] = [2, 3]
    clean = topologies.validate(raw)
    assert topologies.positions(clean) == {"a": (0.0, 1.0), "b": (2.0, 3.0)}
    assert raw.nodes["a"]["position"] == [0, 1]


@pytest.mark.parametrize(
    ("graph", "message"),
    [
        (nx.Graph(), "0 agents"),
        (nx.path_graph(["a"]), "1 agents"),
        (nx.DiGraph([("a", "b")]), "directed"),
        (nx.Graph([("a", "b"), ("b", "b")]), "agent b has an edge to itself"),
        (nx.MultiGraph([("a", "b"), ("b", "a")]), "edge a-b is there more than once"),
        (nx.Graph([("1", "2"), ("10", "4")]), "no path from 1 to 4, 10"),
        (nx.Graph([("a", "b-c")]), "'b-c' cannot be an agent's name"),
        (nx.Graph([(1, 2)]), "1 cannot be an agent's name"),
    ],
)
def test_offender_is_named(graph: nx.Graph, message: str) -> None:
    """What is not a connected simple graph of at least two agents is refused; the message names the offender."""
    with pytest.raises(BadInput, match=message):
        topologies.validate(graph)


def test_long_lists_are_cut() -> None:
    """A message lists at most eight agents and counts the rest."""
    graph = nx.Graph([("0", "1")])
    graph.add_nodes_from(str(number) for number in range(2, 30))
    with pytest.raises(BadInput, match=r"2, 3, 4, 5, 6, 7, 8, 9 and 20 more"):
        topologies.validate(graph)


@pytest.mark.parametrize(
    ("positions", "message"),
    [
        ({"a": (0, 0)}, "agent b has no position"),
        ({"a": (0, 0), "b": (0,)}, "position of agent b"),
        ({"a": (0, 0), "b": (0, float("nan"))}, "position of agent b"),
        ({"a": (0, 0), "b": "xy"}, "position of agent b"),
        ({"a": (0, 0), "b": (1, 0), "c": (2, 0)}, "no agent 'c'.*a, b"),
    ],
)
def test_bad_positions_are_refused(positions: dict[str, tuple[float, ...]], message: str) -> None:
    """Positions are for all agents or none, finite, of two or three coordinates, and for agents that exist."""
    with pytest.raises(BadInput, match=message):
        topologies.from_edges([("a", "b")], positions=positions)


def test_unknown_agent_is_named() -> None:
    """Asking for the neighbours of an agent that does not exist lists those that do."""
    with pytest.raises(BadInput, match=r"no agent '7'.*1, 2, 3"):
        topologies.neighbours(topologies.line(3), "7")
