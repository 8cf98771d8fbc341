"""Least squares, centralised and in the neighbourhood, and the hand-on of estimates."""

import itertools

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.estimators.averages.averaging import weighted_average
from volery.estimators.flying_array.least_squares import (
    ForwardedEstimate,
    centralised_estimate,
    covariance,
    forwarded_estimate,
    neighbourhood_estimate,
    noncollinear,
    well_conditioned,
)
from volery.estimators.flying_array.plane import design_matrix
from volery.randomness import stream
from volery.topologies import agents, ball, metropolis, positions, random_hexagonal, sixteen_module_array

RHOMBUS = {"1": (-0.5, 3**0.5 / 2), "2": (-1.0, 0.0), "3": (-0.5, -(3**0.5) / 2), "4": (0.0, 0.0)}
RHOMBUS_NEIGHBOURS = {"1": "24", "2": "134", "3": "24", "4": "123"}


def centred(places: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """The same array about its centroid."""
    x, y = np.mean(list(places.values()), axis=0)
    return {name: (place[0] - x, place[1] - y) for name, place in places.items()}


def test_four_modules_have_the_covariance_ratios_of_the_paper() -> None:
    """With unit spacing ‖Q‖₂/‖Q_i‖₂ is 0.9105, 1, 0.9105, 1 (Fig. 4a, errata), to the digits stated."""
    places = centred(RHOMBUS)
    whole = np.linalg.norm(covariance(list(places.values()), 1.0), 2)
    ratios = [
        whole / np.linalg.norm(covariance([places[j] for j in name + RHOMBUS_NEIGHBOURS[name]], 1.0), 2)
        for name in places
    ]
    assert ratios == pytest.approx([0.9105, 1.0, 0.9105, 1.0], abs=5e-5)


@given(seed=st.integers(0, 10**6), count=st.integers(3, 16))
def test_estimate_satisfies_the_normal_equations(seed: int, count: int) -> None:
    """The residual of the least-squares estimate is orthogonal to the design matrix: CᵀC x̂ = Cᵀ ŷ."""
    places = list(positions(random_hexagonal(count, seed)).values())
    if not noncollinear(places):
        return
    measured = np.array([0.2 + 0.05 * stream(seed, "test", "noise").normal(k) for k in range(count)])
    rows = design_matrix(places)
    estimate = centralised_estimate(places, measured)
    np.testing.assert_allclose(rows.T @ (measured - rows @ estimate), 0.0, atol=1e-12)


def test_covariance_is_what_a_thousand_estimates_show() -> None:
    """Estimates from noisy distances scatter by Q: variances of 1000 draws within 5 standard errors √(2/1000)."""
    noise = 0.005
    places = list(positions(sixteen_module_array()).values())
    draws = stream(1, "test", "scatter")
    samples = np.array([[noise * draws.normal(16 * k + i) for i in range(16)] for k in range(1000)])
    estimates = np.array([centralised_estimate(places, sample) for sample in samples])
    expected = covariance(places, noise)
    np.testing.assert_allclose(np.var(estimates, axis=0) / expected.diagonal(), 1.0, atol=5 * (2 / 1000) ** 0.5)
    np.testing.assert_array_equal(expected, expected.T)


@pytest.mark.parametrize(
    "places",
    [
        [(0.0, 0.0)],
        [(0.0, 0.0), (0.25, 0.0)],
        [(0.1, 0.0), (0.35, 0.0), (0.6, 0.0)],
        [(0.1, 0.1), (0.2, 0.3), (0.3, 0.5), (0.4, 0.7)],
    ],
)
def test_modules_on_a_line_have_no_estimate(places: list[tuple[float, float]]) -> None:
    """The neighbourhood estimate is None; the centralised one and the covariance refuse, and say what to do."""
    assert not noncollinear(places)
    assert neighbourhood_estimate(places, [0.2] * len(places)) is None
    with pytest.raises(BadInput, match="add a module off the line"):
        centralised_estimate(places, [0.2] * len(places))
    with pytest.raises(BadInput, match="add a module off the line"):
        covariance(places, 0.005)


@given(angle=st.floats(0.0, 6.3), scale=st.floats(1e-3, 1e3), offset=st.floats(-1.0, 1.0))
def test_rank_test_does_not_depend_on_place_direction_or_size(angle: float, scale: float, offset: float) -> None:
    """A line stays a line and a triangle a triangle, wherever the body's frame lies and however large they are."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    line = np.array([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)])
    triangle = np.array([(0.0, 0.0), (1.0, 0.0), (0.5, 0.9)])
    assert not noncollinear(scale * (line @ turn.T + offset))
    assert noncollinear(scale * (triangle @ turn.T + offset))


def test_tolerance_is_the_smallest_eigenvalue_after_scaling() -> None:
    """A matrix with unit diagonal and eigenvalue 0.1 passes at 0.09 and fails at 0.11; a zero diagonal fails."""
    matrix = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert well_conditioned(matrix, 0.09)
    assert not well_conditioned(matrix, 0.11)
    assert not well_conditioned(np.zeros((3, 3)))


def solved(graph: nx.Graph, measured: dict[str, float]) -> dict[str, ForwardedEstimate | None]:
    """What each module solves for by itself, from its neighbourhood."""
    places = positions(graph)
    own: dict[str, ForwardedEstimate | None] = {}
    for name in agents(graph):
        near = agents(graph.subgraph(ball(graph, name, 1)))
        state = neighbourhood_estimate([places[j] for j in near], [measured[j] for j in near])
        own[name] = None if state is None else ForwardedEstimate(state)
    return own


def distributed(
    graph: nx.Graph, own: dict[str, ForwardedEstimate | None], rounds: int
) -> dict[str, ForwardedEstimate | None]:
    """What each module holds after so many rounds in which all hear all their neighbours."""
    for _ in range(rounds):
        told = {name: estimate for name, estimate in own.items() if estimate is not None}
        own = {name: forwarded_estimate(own[name], {j: told[j] for j in graph[name] if j in told}) for name in graph}
    return own


def test_estimates_are_handed_on_outwards_from_the_modules_that_can_solve() -> None:
    """On a triangle with a tail every module of the tail holds the estimate one hop nearer, after as many rounds."""
    graph = nx.Graph([("1", "2"), ("2", "3"), ("1", "3"), ("3", "4"), ("4", "5"), ("5", "6")])
    first = {name: ForwardedEstimate(np.full(3, float(name))) if name in "123" else None for name in graph}
    for rounds, expected in ((1, [0, 0, 0, 1, None, None]), (5, [0, 0, 0, 1, 2, 3])):
        held = distributed(graph, first, rounds)
        assert [None if held[name] is None else held[name].hops for name in agents(graph)] == expected  # type: ignore[union-attr]
    assert [held[name].state[0] for name in "456"] == [3.0, 3.0, 3.0]  # type: ignore[union-attr]


def test_hand_on_takes_the_mean_of_the_nearest_and_never_what_comes_back() -> None:
    """Of neighbours at 0, 0 and 1 hops it takes the mean of the first two; what is as far as itself changes nothing."""
    near = {"2": ForwardedEstimate(np.zeros(3)), "3": ForwardedEstimate(np.full(3, 2.0))}
    far = {"10": ForwardedEstimate(np.full(3, 50.0), 1)}
    held = forwarded_estimate(None, near | far)
    assert held is not None
    assert held.hops == 1
    np.testing.assert_array_equal(held.state, np.ones(3))
    assert forwarded_estimate(held, far) is held
    assert forwarded_estimate(held, {}) is held
    own = ForwardedEstimate(np.full(3, 9.0))
    assert forwarded_estimate(own, near) is own
    assert forwarded_estimate(None, {}) is None


def test_what_is_held_in_the_end_does_not_depend_on_the_order_of_messages() -> None:
    """One neighbour heard at a time, in any order and again until nothing changes, gives the same hops."""
    graph = nx.path_graph(5)
    names = nx.relabel_nodes(graph, {k: str(k + 1) for k in range(5)})
    first = {name: ForwardedEstimate(np.full(3, float(name))) if name in "15" else None for name in names}
    expected = {name: held.hops for name, held in distributed(names, first, 5).items() if held is not None}
    directions = list(names.to_directed().edges)
    for order in itertools.islice(itertools.permutations(directions), 0, 40000, 2500):
        held = dict(first)
        for source, target in order * 4:
            told = held[source]
            held[target] = forwarded_estimate(held[target], {} if told is None else {source: told})
        assert {name: estimate.hops for name, estimate in held.items() if estimate is not None} == expected


def test_averaging_of_handed_estimates_reaches_their_mean_and_is_worse_than_the_centralised_estimate() -> None:
    """Weighted averaging converges to (19); over 400 noisy samples its scatter is above that of (12) in all states."""
    graph = sixteen_module_array()
    places = positions(graph)
    weights = metropolis(graph)
    draws = stream(2, "test", "averaging")
    means, optima = [], []
    for k in range(400):
        measured = {name: 0.2 + 0.005 * draws.normal(16 * k + i) for i, name in enumerate(agents(graph))}
        held = {n: e.state for n, e in distributed(graph, solved(graph, measured), 3).items() if e is not None}
        assert len(held) == 16
        means.append(np.mean(list(held.values()), axis=0))
        optima.append(centralised_estimate([places[n] for n in held], [measured[n] for n in held]))
    assert (np.std(means, axis=0) > np.std(optima, axis=0)).all()
    for _ in range(400):
        held = {i: weighted_average(x, {j: held[j] for j in graph[i]}, only(weights[i], i)) for i, x in held.items()}
    np.testing.assert_allclose(list(held.values()), [means[-1]] * 16, atol=1e-9)


def only(weights: dict[str, float], own: str) -> dict[str, float]:
    """The weights of the neighbours, without the own."""
    return {name: weight for name, weight in weights.items() if name != own}
