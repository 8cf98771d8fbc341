"""Hexagonal arrays and the two configurations of Kriegleder 2012."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery import topologies
from volery.errors import BadInput


def _covariance_norm(places: list[topologies.Position]) -> float:
    """‖(CᵀC)⁻¹‖₂ with rows (1, r_Y, −r_X) of C, Kriegleder 2012, (13) and (17); infinite where C has no full rank."""
    rows = np.array([(1.0, y, -x) for x, y in places])
    if np.linalg.matrix_rank(rows) < 3:
        return math.inf
    return float(1 / np.linalg.svd(rows, compute_uv=False)[-1] ** 2)


def _ratios(spacing: float, count: int) -> dict[str, float]:
    make = {4: topologies.four_module_array, 16: topologies.sixteen_module_array}[count]
    graph = make(spacing)
    places = topologies.positions(graph)
    whole = _covariance_norm(list(places.values()))
    return {
        module: whole / _covariance_norm([places[other] for other in topologies.ball(graph, module, 1)])
        for module in topologies.agents(graph)
    }


def test_four_modules() -> None:
    """Modules 2 and 4 touch all others, 1 and 3 touch only those; with unit spacing the covariance ratios are known."""
    graph = topologies.four_module_array()
    assert topologies.edges(graph) == [("1", "2"), ("1", "4"), ("2", "3"), ("2", "4"), ("3", "4")]
    # The reference has four decimals.
    assert [round(ratio, 4) for ratio in _ratios(1.0, 4).values()] == [0.9105, 1.0, 0.9105, 1.0]


def test_sixteen_modules() -> None:
    """Module 12 alone has one neighbour and alone cannot solve; 2 and 7 come closest, with about three times Q."""
    graph = topologies.sixteen_module_array()
    assert len(graph) == 16
    assert [module for module in graph if graph.degree[module] == 1] == ["12"]
    ratios = _ratios(topologies.MODULE_SPACING, 16)
    assert [module for module, ratio in ratios.items() if ratio == 0] == ["12"]
    assert set(sorted(ratios, key=lambda module: -ratios[module])[:2]) == {"2", "7"}
    assert 1 / ratios["2"] == pytest.approx(3, abs=0.05)
    assert 1 / ratios["7"] == pytest.approx(3, abs=0.05)


@given(st.integers(2, 20), st.integers(0, 10**6), st.floats(0.05, 2))
def test_linked_exactly_where_sides_touch(count: int, seed: int, spacing: float) -> None:
    """Modules are linked exactly when their centres are one spacing apart; no two are closer; the centroid is zero."""
    graph = topologies.random_hexagonal(count, seed, spacing)
    places = topologies.positions(graph)
    # Centres are one spacing apart or at least √3 of it; rounding is far below the middle between.
    for index, first in enumerate(graph):
        for second in list(graph)[index + 1 :]:
            distance = math.dist(places[first], places[second]) / spacing
            assert distance > 1 - 1e-9
            assert graph.has_edge(first, second) == (distance < 1.3)
    assert np.allclose(np.mean(list(places.values()), axis=0), 0, atol=1e-13)


@given(st.integers(2, 15), st.integers(0, 10**6))
def test_random_arrays_grow(count: int, seed: int) -> None:
    """A larger random array is the smaller one of the same seed with modules added."""
    small = topologies.random_hexagonal(count, seed)
    large = topologies.random_hexagonal(count + 1, seed)
    assert topologies.edges(large.subgraph(small)) == topologies.edges(small)
    names = list(small)
    shift = np.subtract(topologies.positions(large)["1"], topologies.positions(small)["1"])
    for name in names:
        moved = np.add(topologies.positions(small)[name], shift)
        assert np.allclose(topologies.positions(large)[name], moved, atol=1e-12)


def test_growth_is_uniform() -> None:
    """The second module takes each of the six sides equally often."""
    places = [topologies.positions(topologies.random_hexagonal(2, seed, 1.0)) for seed in range(600)]
    angles = [math.atan2(*reversed(np.subtract(place["2"], place["1"]))) for place in places]
    counts = np.bincount([round(angle / (math.pi / 3)) % 6 for angle in angles], minlength=6)
    # Binomial with n = 600, p = 1/6: mean 100, standard deviation 9.1; five of them.
    assert (np.abs(counts - 100) < 46).all()


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ([(0, 0), (1, 0), (0, 0)], r"cell \[0, 0\] is taken by module 1 and given again to module 3"),
        ([(0, 0), (1, 0), (1, 1), (3, 3)], "no path from 1 to 4"),
        ([(0, 0), (1, 1)], "no path from 1 to 2"),
        ([(0, 0)], "1 agents"),
        ([], "0 agents"),
    ],
)
def test_bad_cells_are_refused(cells: list[tuple[int, int]], message: str) -> None:
    """Duplicate cells, modules that touch nobody and arrays of fewer than two modules are refused by name."""
    with pytest.raises(BadInput, match=message):
        topologies.hexagonal(tuple(cells))


def test_spacing_is_checked() -> None:
    """A spacing of zero is refused."""
    with pytest.raises(BadInput, match="spacing is 0 m"):
        topologies.four_module_array(0.0)
