"""Spectra, contraction and distances."""

import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery import topologies
from volery.errors import BadInput

# Eigenvalues of symmetric matrices of norm below 30 come out to a few times 30 · 2⁻⁵³.
EIGENVALUE = 1e-12


@given(st.integers(3, 12))
def test_spectra_in_closed_form(count: int) -> None:
    """Complete graph: all N. Ring: 2 − 2 cos(2πk/N). Star: 1 and N. Line: 2 − 2 cos(π/N)."""
    assert topologies.laplacian_spectrum(topologies.complete(count))[1:] == pytest.approx(count, abs=EIGENVALUE)
    ring = 2 - 2 * math.cos(2 * math.pi / count)
    assert topologies.algebraic_connectivity(topologies.ring(count)) == pytest.approx(ring, abs=EIGENVALUE)
    assert topologies.algebraic_connectivity(topologies.star(count)) == pytest.approx(1, abs=EIGENVALUE)
    assert topologies.laplacian_spectrum(topologies.star(count))[-1] == pytest.approx(count, abs=EIGENVALUE)
    line = 2 - 2 * math.cos(math.pi / count)
    assert topologies.algebraic_connectivity(topologies.line(count)) == pytest.approx(line, abs=EIGENVALUE)


def test_connectivity_of_parts_is_zero() -> None:
    """A graph in two parts has no connectivity, also where an agent is all alone, and no diameter."""
    graph = topologies.proximity({"a": (0, 0), "b": (1, 0), "c": (9, 0)}, 2.0)
    assert topologies.algebraic_connectivity(graph) == pytest.approx(0, abs=EIGENVALUE)
    with pytest.raises(BadInput, match="not connected has no diameter"):
        topologies.diameter(graph)


@given(st.integers(2, 12))
def test_complete_graph_agrees_in_one_round(count: int) -> None:
    """Metropolis weights on the complete graph are all 1/N: the contraction is zero."""
    graph = topologies.complete(count)
    matrix = topologies.weight_matrix(graph, topologies.metropolis(graph))
    assert topologies.contraction(matrix) == pytest.approx(0, abs=EIGENVALUE)


@given(st.integers(0, 10**6), st.integers(3, 10))
def test_contraction_bounds_the_disagreement(seed: int, count: int) -> None:
    """Each round shrinks the disagreement by the contraction or more, the slowest mode by just that."""
    graph = topologies.random_hexagonal(count, seed)
    matrix = topologies.weight_matrix(graph, topologies.metropolis(graph))
    factor = topologies.contraction(matrix)
    state = np.arange(count, dtype=float) ** 2
    before = np.linalg.norm(state - state.mean())
    after = np.linalg.norm(matrix @ state - state.mean())
    assert after <= factor * before * (1 + EIGENVALUE) + EIGENVALUE
    values, vectors = np.linalg.eigh(matrix - 1 / count)
    slowest = vectors[:, np.argmax(np.abs(values))]
    assert np.linalg.norm(matrix @ slowest - slowest.mean()) == pytest.approx(factor, abs=EIGENVALUE)


def test_contraction_of_unsymmetric_weights() -> None:
    """Doubly stochastic weights need not be symmetric: a ring that passes half on in one direction."""
    matrix = 0.5 * (np.eye(4) + np.roll(np.eye(4), 1, axis=1))
    # Eigenvalues (1 + e^{iπk/2})/2; the largest below one has the absolute value cos(π/4).
    assert topologies.contraction(matrix) == pytest.approx(math.cos(math.pi / 4), abs=1e-12)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.ones((2, 3)), r"shape \(2, 3\)"),
        (np.array([[1.0, 0.0], [0.5, 0.4]]), "row 2 of the weights sums to 0.9"),
        (np.array([[1.0, 0.0], [0.5, 0.5]]), "column 1 of the weights sums to 1.5"),
    ],
)
def test_contraction_refuses_weights_that_lose_the_average(matrix: np.ndarray, message: str) -> None:
    """A matrix that is not square, or a row or column that does not sum to one, is named."""
    with pytest.raises(BadInput, match=message):
        topologies.contraction(matrix)


@given(st.floats(0, 0.999), st.floats(1e-12, 0.999))
def test_rounds_suffice_and_one_less_does_not(per_round: float, factor: float) -> None:
    """The rounds reach the factor and no smaller number does."""
    rounds = topologies.rounds_to(per_round, factor)
    assert per_round**rounds <= factor
    assert rounds == 1 or per_round ** (rounds - 1) > factor


@given(st.floats(0.01, 0.99), st.integers(1, 40))
def test_rounds_are_exact_at_powers(per_round: float, power: int) -> None:
    """A factor that is a power of the contraction takes just that many rounds, the next number below one more."""
    assert topologies.rounds_to(per_round, per_round**power) == power
    assert topologies.rounds_to(per_round, math.nextafter(per_round**power, 0)) == power + 1


@pytest.mark.parametrize(("per_round", "factor"), [(1.0, 0.5), (-0.1, 0.5), (0.5, 0.0), (0.5, 1.0), (math.nan, 0.5)])
def test_impossible_rounds_are_refused(per_round: float, factor: float) -> None:
    """A contraction of one never gets there; a factor must lie between zero and one."""
    with pytest.raises(BadInput, match=r"(contraction|factor) is"):
        topologies.rounds_to(per_round, factor)


def test_balls_and_diameter() -> None:
    """The ball of k hops grows along a line until it holds all; its diameter is N − 1."""
    graph = topologies.line(12)
    assert topologies.diameter(graph) == 11
    assert topologies.ball(graph, "10", 0) == ["10"]
    assert topologies.ball(graph, "10", 1) == ["9", "10", "11"]
    assert topologies.ball(graph, "10", 11) == list(graph)
    with pytest.raises(BadInput, match="no agent '13'"):
        topologies.ball(graph, "13", 1)


def test_laplacian_ignores_edge_data() -> None:
    """Edges count as one whatever attributes they bear; rows are in natural order."""
    graph = nx.Graph()
    graph.add_edge("10", "2", weight=7.0)
    graph.add_edge("2", "1", weight=3.0)
    assert topologies.laplacian(graph).tolist() == [[1, -1, 0], [-1, 2, -1], [0, -1, 1]]
