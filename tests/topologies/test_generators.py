"""Regular graphs, random graphs and proximity graphs."""

import math
from collections.abc import Callable
from itertools import combinations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery import topologies
from volery.errors import BadInput

COUNTS = st.integers(3, 12)
SEEDS = st.integers(0, 2**32)


@pytest.mark.parametrize(
    ("graph", "model"),
    [
        (topologies.line(5), nx.path_graph(5)),
        (topologies.ring(6), nx.cycle_graph(6)),
        (topologies.star(5), nx.star_graph(4)),
        (topologies.complete(4), nx.complete_graph(4)),
        (topologies.grid(3, 4), nx.grid_2d_graph(3, 4)),
    ],
)
def test_shape_and_names(graph: nx.Graph, model: nx.Graph) -> None:
    """Each generator gives the graph of its name on agents "1" to "N"."""
    assert list(graph) == [str(number) for number in range(1, len(model) + 1)]
    assert nx.is_isomorphic(graph, model)


@given(COUNTS, st.floats(0.01, 100))
def test_regular_positions(count: int, spacing: float) -> None:
    """Neighbours on a line, a ring, a star and a grid are one spacing apart, and the centroid is the origin."""
    for graph in (
        topologies.line(count, spacing),
        topologies.ring(count, spacing),
        topologies.star(count, spacing),
        topologies.grid(2, count, spacing),
    ):
        places = topologies.positions(graph)
        for first, second in topologies.edges(graph):
            assert math.isclose(math.dist(places[first], places[second]), spacing, rel_tol=1e-9)
        # A mean of at most 24 places of size below 12 spacings, each rounded to 2⁻⁵³.
        assert np.allclose(np.mean(list(places.values()), axis=0), 0, atol=1e-13 * spacing)


def test_smallest_star_is_centred() -> None:
    """A star of two agents has its hub beside the centroid."""
    assert topologies.positions(topologies.star(2, 3.0)) == {"1": (-1.5, 0.0), "2": (1.5, 0.0)}


def test_geometric_fills_the_square() -> None:
    """Both coordinates spread over the square, independently of each other."""
    places = np.array(list(topologies.positions(topologies.geometric(200, 2.0, 5, side=2.0)).values()))
    # Uniform on 2 m: standard deviation 0.577 m, known to within 1/√(5·200) = 3 % (one standard error).
    assert np.std(places, axis=0) == pytest.approx(2 / math.sqrt(12), rel=0.15)
    # The correlation of 200 independent pairs has standard deviation 1/√200 = 0.07.
    assert abs(np.corrcoef(places.T)[0, 1]) < 0.35


def test_grid_is_numbered_row_by_row() -> None:
    """Agent 2 stands beside agent 1, agent 4 in the next row of a grid of three columns."""
    assert topologies.neighbours(topologies.grid(2, 3), "1") == ["2", "4"]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: topologies.line(1), "count is 1, it must be at least 2"),
        (lambda: topologies.ring(2), "count is 2, it must be at least 3"),
        (lambda: topologies.star(1), "count is 1"),
        (lambda: topologies.complete(0), "count is 0"),
        (lambda: topologies.grid(0, 3), "rows is 0"),
        (lambda: topologies.grid(3, -1), "columns is -1"),
        (lambda: topologies.grid(1, 1), "1 agents"),
        (lambda: topologies.ring(4, 0.0), "spacing is 0 m"),
        (lambda: topologies.star(4, math.inf), "spacing is inf m"),
        (lambda: topologies.grid(2, 2, math.nan), "spacing is nan m"),
        (lambda: topologies.geometric(5, -1.0, 0), "radius is -1 m"),
        (lambda: topologies.geometric(5, 1.0, 0, side=0.0), "side is 0 m"),
        (lambda: topologies.geometric(1, 1.0, 0), "count is 1"),
        (lambda: topologies.geometric(30, 0.01, 0), "none of 100 draws with 30 agents .* larger radius"),
        (lambda: topologies.erdos_renyi(5, 1.5, 0), "probability is 1.5"),
        (lambda: topologies.erdos_renyi(5, 0.0, 0), "probability is 0"),
        (lambda: topologies.erdos_renyi(1, 0.5, 0), "count is 1"),
        (lambda: topologies.erdos_renyi(60, 0.001, 0), "none of 100 draws with 60 agents .* higher probability"),
        (lambda: topologies.small_world(10, 3, 0.1, 0), "neighbours is 3, it must be even"),
        (lambda: topologies.small_world(10, 0, 0.1, 0), "neighbours is 0"),
        (lambda: topologies.small_world(4, 4, 0.1, 0), "count is 4, it must be at least 5"),
        (lambda: topologies.small_world(10, 4, 1.1, 0), "rewiring is 1.1"),
    ],
)
def test_bounds_are_named(call: Callable[[], nx.Graph], message: str) -> None:
    """A parameter out of bounds is refused with its value and the bound; a hopeless draw ends with a remedy."""
    with pytest.raises(BadInput, match=message):
        call()


def _random_graphs(count: int, seed: int) -> list[nx.Graph]:
    return [
        topologies.geometric(count, 0.7, seed),
        topologies.erdos_renyi(count, 0.6, seed),
        topologies.small_world(count, 2, 0.3, seed),
        topologies.random_hexagonal(count, seed),
    ]


@given(COUNTS, SEEDS)
def test_random_graphs_are_connected_and_repeat(count: int, seed: int) -> None:
    """Every random generator gives a connected graph of the asked size, and the same one for the same seed."""
    for graph, again in zip(_random_graphs(count, seed), _random_graphs(count, seed), strict=True):
        assert len(graph) == count
        assert nx.is_connected(graph)
        assert topologies.edges(graph) == topologies.edges(again)
        assert topologies.positions(graph) == topologies.positions(again)


def test_seeds_matter() -> None:
    """Two seeds give two graphs."""
    for graph, other in zip(_random_graphs(12, 1), _random_graphs(12, 2), strict=True):
        assert topologies.edges(graph) != topologies.edges(other)


def test_disconnected_draws_are_drawn_anew() -> None:
    """A sparse Erdős–Rényi graph, connected in few draws only, is found by drawing again."""
    # With Np = ln N the probability of being connected tends to 1/e: of 30 seeds some need a second draw.
    graphs = [topologies.erdos_renyi(20, math.log(20) / 20, seed) for seed in range(30)]
    assert all(nx.is_connected(graph) for graph in graphs)


@given(COUNTS, st.floats(0.5, 1.0), st.floats(0.1, 50), SEEDS)
def test_geometric_links_by_distance(count: int, share: float, side: float, seed: int) -> None:
    """Agents lie in the square about their centroid and are linked exactly where they are within the radius."""
    graph = topologies.geometric(count, share * side, seed, side)
    places = topologies.positions(graph)
    assert (np.ptp(list(places.values()), axis=0) <= side).all()
    # A mean of at most 12 places of size below the side, each rounded to 2⁻⁵³.
    assert np.allclose(np.mean(list(places.values()), axis=0), 0, atol=1e-13 * side)
    for first, second in combinations(places, 2):
        assert graph.has_edge(first, second) == (math.dist(places[first], places[second]) <= share * side)


def test_proximity_may_be_disconnected() -> None:
    """Moving agents may lose each other; the radius itself is within range, also in space."""
    graph = topologies.proximity({"10": (3.0, 4.0, 0.0), "2": (0.0, 0.0, 0.0), "x": (50.0, 0.0, 0.0)}, 5.0)
    assert list(graph) == ["2", "10", "x"]
    assert topologies.edges(graph) == [("2", "10")]
    assert topologies.positions(graph)["x"] == (50.0, 0.0, 0.0)
    assert len(topologies.proximity({}, 1.0)) == 0


@pytest.mark.parametrize(
    ("positions", "radius", "message"),
    [
        ({"a b": (0.0, 0.0)}, 1.0, "'a b' cannot be an agent's name"),
        ({"a": (0.0, 0.0), "b": (0.0, 0.0, 0.0)}, 1.0, "2 for agent a, 3 for agent b"),
        ({"a": (0.0,)}, 1.0, "1 for agent a"),
        ({"a": (0.0, 0.0)}, 0.0, "radius is 0 m"),
    ],
)
def test_proximity_refuses(positions: dict[str, tuple[float, ...]], radius: float, message: str) -> None:
    """Bad names, mixed dimensions and a radius that is not positive are refused by name."""
    with pytest.raises(BadInput, match=message):
        topologies.proximity(positions, radius)
