"""Consensus weights."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery import topologies
from volery.errors import BadInput

GRAPHS = st.builds(topologies.erdos_renyi, st.integers(2, 12), st.floats(0.5, 1.0), st.integers(0, 10**6))
# Sums of at most 12 numbers below 2 in absolute value, each rounded to 2⁻⁵³.
ROUNDING = 1e-14


@given(GRAPHS)
def test_rows_sum_to_one_and_weights_are_symmetric(graph: nx.Graph) -> None:
    """All rules keep the average: symmetric matrices whose rows sum to one, zero off the edges."""
    for rule in (topologies.metropolis, topologies.maximum_degree, topologies.constant_edge):
        weights = rule(graph)
        matrix = topologies.weight_matrix(graph, weights)
        assert np.array_equal(matrix, matrix.T)
        assert np.allclose(matrix.sum(axis=1), 1, rtol=0, atol=ROUNDING)
        assert {agent: set(row) for agent, row in weights.items()} == {agent: {agent, *graph[agent]} for agent in graph}


@given(GRAPHS)
def test_metropolis_and_maximum_degree_are_nonnegative_and_converge(graph: nx.Graph) -> None:
    """Their own weights are positive, so every connected graph agrees in the end."""
    for rule in (topologies.metropolis, topologies.maximum_degree):
        matrix = topologies.weight_matrix(graph, rule(graph))
        assert (matrix >= 0).all()
        # w_ii ≥ 1 − Δ/(1 + Δ) = 1/(1 + Δ) for both rules.
        assert (np.diag(matrix) > 1 / (1 + len(graph))).all()
        assert topologies.contraction(matrix) < 1


def test_metropolis_by_hand() -> None:
    """On a line of three: 1/3 over both edges, 2/3 at the ends and 1/3 in the middle."""
    weights = topologies.metropolis(topologies.line(3))
    assert weights["1"] == pytest.approx({"1": 2 / 3, "2": 1 / 3})
    assert weights["2"] == pytest.approx({"1": 1 / 3, "2": 1 / 3, "3": 1 / 3})
    assert topologies.metropolis_weight(1, 2) == topologies.metropolis_weight(2, 1) == 1 / 3


def test_maximum_degree_by_hand() -> None:
    """On a star of four the largest degree is 3: every edge has 1/4."""
    weights = topologies.maximum_degree(topologies.star(4))
    assert weights["1"] == pytest.approx({"1": 0.25, "2": 0.25, "3": 0.25, "4": 0.25})
    assert weights["3"] == pytest.approx({"1": 0.25, "3": 0.75})


@given(GRAPHS, st.floats(0.05, 0.95))
def test_default_step_is_the_best(graph: nx.Graph, share: float) -> None:
    """No other constant step contracts faster than 2 / (λ_2 + λ_N)."""
    bound = 2 / topologies.laplacian_spectrum(graph)[-1]
    other = topologies.weight_matrix(graph, topologies.constant_edge(graph, share * bound))
    best = topologies.weight_matrix(graph, topologies.constant_edge(graph))
    assert topologies.contraction(best) <= topologies.contraction(other) + 1e-9


def test_steps_that_do_not_converge_are_refused() -> None:
    """Three agents that hear each other: the step must lie below 2/3."""
    triangle = topologies.complete(3)
    topologies.constant_edge(triangle, 0.666)
    for step in (0.0, -0.1, 0.6667, 1.0, float("nan")):
        with pytest.raises(BadInput, match=r"below 2/λ_max = 0\.666667"):
            topologies.constant_edge(triangle, step)


def test_disconnected_graphs_have_weights_but_no_best_step() -> None:
    """Agents that lost all others keep their own state; the optimal step needs a connected graph."""
    graph = topologies.proximity({"a": (0, 0), "b": (1, 0), "c": (9, 0)}, 2.0)
    assert topologies.metropolis(graph)["c"] == {"c": 1.0}
    with pytest.raises(BadInput, match="not connected: give the step"):
        topologies.constant_edge(graph)
    assert topologies.constant_edge(graph, 0.25)["a"] == {"b": 0.25, "a": 0.75}


@pytest.mark.parametrize("weights", [{"1": {"3": 0.5}}, {"9": {"9": 1.0}}])
def test_weights_off_the_edges_are_refused(weights: dict[str, dict[str, float]]) -> None:
    """A weight for an agent that is no neighbour, or not there at all, is named."""
    with pytest.raises(BadInput, match=r"weight of (3 at 1|9 at 9)"):
        topologies.weight_matrix(topologies.line(3), weights)
