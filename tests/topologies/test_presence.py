"""Graphs that change: spans of edges, and what they say of the whole."""

from __future__ import annotations

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery import topologies
from volery.errors import BadInput
from volery.topologies import presence
from volery.topologies.presence import Span, TimedGraph

from ..surroundings import edges_at

END = 40
SPANS = st.lists(st.tuples(st.integers(-5, 45), st.integers(-5, 45)), max_size=8)
PATH = [("1", "2"), ("2", "3"), ("3", "4")]


def instants(spans: list[Span] | tuple[Span, ...]) -> set[int]:
    """Every nanosecond in the spans."""
    return {instant for start, end in spans for instant in range(start, end)}


@given(SPANS)
def test_merged_spans_are_ascending_apart_and_the_same_instants(spans: list[Span]) -> None:
    """Touching and overlapping spans are one, and empty or reversed ones are nothing."""
    found = presence.merged(spans)
    assert instants(found) == instants(spans)
    assert all(start < end for start, end in found)
    assert all(before[1] < after[0] for before, after in pairwise(found))


@given(st.dictionaries(st.sampled_from(PATH), SPANS, min_size=3))
def test_an_edge_is_there_exactly_in_its_spans(spans: dict[tuple[str, str], list[Span]]) -> None:
    """At every instant the edges are those whose spans hold it; where one is never there the union falls apart."""
    inside = {edge: instants(its) & set(range(END)) for edge, its in spans.items()}
    if not all(inside.values()):
        with pytest.raises(BadInput):
            presence.timed(spans, END, ["1", "2", "3", "4"])
        return
    graph = presence.timed(spans, END)
    for instant in range(END):
        assert edges_at(graph, instant) == [edge for edge in PATH if instant in inside[edge]]
    apart = presence.disconnected(graph, END)
    assert instants(apart) == {instant for instant in range(END) if not all(instant in its for its in inside.values())}
    assert presence.merged(apart) == apart


def test_edges_hold_from_one_begin_to_the_next() -> None:
    """An edge of two epochs in a row has one span; either end may come first."""
    found = presence.epochs([(0, [("1", "2"), ("3", "2")]), (10, [("2", "3")]), (15, [("2", "1")])], END)
    assert found == {("1", "2"): ((0, 10), (15, 40)), ("2", "3"): ((0, 15),)}


def test_an_edge_that_never_goes_has_no_spans() -> None:
    """Only those that are absent at some time are in `presence`; what lies outside of the time does not count."""
    graph = presence.timed({("2", "1"): [(-5, 20), (20, 99)], ("2", "3"): [(0, 5), (35, 50)]}, END)
    assert topologies.edges(graph.union) == [("1", "2"), ("2", "3")]
    assert graph.presence == {("2", "3"): ((0, 5), (35, 40))}


def test_a_union_must_be_connected() -> None:
    """No path from 1 to 3 at any time, or an agent that never has an edge."""
    with pytest.raises(BadInput, match="no path from 1 to 3, 4"):
        presence.timed({("1", "2"): [(0, 5)], ("3", "4"): [(2, 9)]}, END)
    with pytest.raises(BadInput, match="no path from 1 to 9"):
        presence.timed({("1", "2"): [(0, 5)]}, END, ["9"])


def test_the_mean_laplacian_is_the_average_over_time() -> None:
    """The same as the sum over every instant, in any order of edges; λ_2 of a graph that never changes is its own."""
    graph = presence.timed({("1", "2"): [(0, 13)], ("2", "3"): [(5, 9), (20, 40)], ("1", "3"): [(0, 40)]}, END)
    total = np.zeros((3, 3))
    for instant in range(END):
        now = nx.Graph()
        now.add_nodes_from("123")
        now.add_edges_from(edges_at(graph, instant))
        total += topologies.laplacian(now) / END
    np.testing.assert_allclose(presence.mean_laplacian(graph, END), total, atol=1e-14)
    ring = topologies.ring(7)
    assert presence.mean_connectivity(TimedGraph(ring), END) == pytest.approx(topologies.algebraic_connectivity(ring))
    with pytest.raises(BadInput, match="an average over 0 ns"):
        presence.mean_laplacian(graph, 0)


def test_a_graph_never_connected_at_an_instant_may_agree_all_the_same() -> None:
    """Two halves of a path take turns: disconnected all the time, yet λ_2 of the average is half that of the path."""
    graph = presence.timed({("1", "2"): [(0, 20)], ("2", "3"): [(20, 40)]}, END)
    assert presence.disconnected(graph, END) == ((0, 40),)
    whole = topologies.algebraic_connectivity(topologies.line(3))
    assert presence.mean_connectivity(graph, END) == pytest.approx(whole / 2)
