"""Weights of the fastest mixing chain."""

from __future__ import annotations

import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.topologies import (
    Weights,
    complete,
    constant_edge,
    contraction,
    erdos_renyi,
    fastest_mixing,
    line,
    maximum_degree,
    metropolis,
    random_hexagonal,
    ring,
    star,
    weight_matrix,
)

TOLERANCE = 1e-6


def radius(graph: nx.Graph, weights: Weights) -> float:
    """Essential spectral radius."""
    return contraction(weight_matrix(graph, weights))


@settings(max_examples=15)
@given(seed=st.integers(0, 10**4), count=st.integers(2, 12), hexagons=st.booleans())
def test_no_other_rule_mixes_faster(seed: int, count: int, hexagons: bool) -> None:
    """Weights are symmetric, nonnegative, sum to one, and have a radius of at most that of any rule that is so too."""
    graph = random_hexagonal(count, seed) if hexagons else erdos_renyi(count, 0.6, seed)
    found = fastest_mixing(graph, TOLERANCE)
    matrix = weight_matrix(graph, found)
    assert matrix.min() >= 0
    assert abs(matrix - matrix.T).max() == 0
    best = contraction(matrix)
    assert best <= radius(graph, metropolis(graph)) + TOLERANCE
    assert best <= radius(graph, maximum_degree(graph)) + TOLERANCE
    step = min(1 / max(degree for _, degree in graph.degree), 1.0)
    assert best <= radius(graph, constant_edge(graph, 0.999 * step)) + TOLERANCE


@pytest.mark.parametrize(
    ("graph", "known"),
    [
        (complete(6), 0.0),
        (star(7), 1 - 1 / 6),
        (line(6), 3**0.5 / 2),
        (ring(5), 5**0.5 / 5),
    ],
    ids=["complete", "star", "line", "ring"],
)
def test_known_optima(graph: nx.Graph, known: float) -> None:
    """Boyd, Diaconis and Xiao 2004: 1/N; 1/(N − 1) on each edge of a star; 1/2 on a path, cos(π/N).

    On a ring of 5 all edges are alike, and the best step leaves (λ_5 − λ_2) / (λ_5 + λ_2) = 1/√5.
    """
    assert radius(graph, fastest_mixing(graph, TOLERANCE)) == pytest.approx(known, abs=TOLERANCE)


def test_bad_input_is_refused() -> None:
    """A graph in two parts, and a tolerance that cannot be met."""
    with pytest.raises(BadInput, match="not connected"):
        fastest_mixing(nx.Graph([("1", "2"), ("3", "4")]))
    with pytest.raises(BadInput, match="tolerance is 0"):
        fastest_mixing(ring(3), 0.0)
