"""Consensus on information pairs."""

from collections.abc import Mapping

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from volery.errors import BadInput
from volery.estimators.averages.averaging import weighted_average
from volery.estimators.flying_array.least_squares import centralised_estimate
from volery.estimators.flying_array.metropolis import estimate, initial_pair
from volery.estimators.flying_array.plane import design_row
from volery.estimators.information import InformationPair, pack_pair, unpack_pair
from volery.randomness import stream
from volery.topologies import Position, agents, ball, complete, metropolis, positions, random_hexagonal

SINGULAR = 1e-12
"""Tolerance of the rank test in float64: rounding leaves 1e-15 on a singular matrix, full ones here are above 1e-4."""


def neighbour_weights(graph: nx.Graph) -> dict[str, dict[str, float]]:
    """Metropolis weights of each agent's neighbours, without its own."""
    return {i: {j: w for j, w in row.items() if j != i} for i, row in metropolis(graph).items()}


def averaged(
    own: InformationPair, received: Mapping[str, InformationPair], weights: Mapping[str, float]
) -> InformationPair:
    """One round of weighted averaging of pairs, Kriegleder 2012, (24)-(25)."""
    vectors = {name: pack_pair(pair) for name, pair in received.items()}
    return unpack_pair(weighted_average(pack_pair(own), vectors, weights))


def one_round(
    graph: nx.Graph, pairs: dict[str, InformationPair], weights: dict[str, dict[str, float]]
) -> dict[str, InformationPair]:
    """A round in which all hear all their neighbours."""
    return {i: averaged(pairs[i], {j: pairs[j] for j in graph[i]}, weights[i]) for i in graph}


def told(pair: InformationPair) -> NDArray[np.float64]:
    """The estimate of a pair that has one."""
    state = estimate(pair)
    assert state is not None
    return state


def array(count: int, seed: int) -> tuple[nx.Graph, dict[str, Position], dict[str, float]]:
    """A random array, its positions, and noisy distances."""
    graph = random_hexagonal(count, seed)
    places = positions(graph)
    draws = stream(seed, "test", "distances")
    return graph, places, {name: 0.2 + 0.01 * draws.normal(k) for k, name in enumerate(agents(graph))}


def on_a_line(places: list[Position]) -> bool:
    """Whether all cross products with the first two vanish: spacing² · √3/2 is 0.054 m² where one does not."""
    (x0, y0), (x1, y1) = places[0], places[min(1, len(places) - 1)]
    return all(abs((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)) < 0.01 for x, y in places)


@settings(max_examples=40)
@given(count=st.integers(2, 16), seed=st.integers(0, 10**6))
def test_a_pair_has_full_rank_exactly_when_the_ball_holds_three_modules_off_a_line(count: int, seed: int) -> None:
    """After k rounds, with the default tolerance too: random arrays of this size are not long bent lines."""
    graph, places, measured = array(count, seed)
    weights = neighbour_weights(graph)
    pairs = {name: initial_pair(places[name], measured[name]) for name in graph}
    for k in range(6):
        for name in graph:
            expected = not on_a_line([places[j] for j in ball(graph, name, k)])
            assert (estimate(pairs[name]) is not None) == expected
            assert (estimate(pairs[name], SINGULAR) is not None) == expected
        pairs = one_round(graph, pairs, weights)


def test_one_round_on_the_complete_graph_is_the_centralised_estimate() -> None:
    """Metropolis weights on a complete graph are 1/N each, so that one round averages all."""
    graph = complete(6)
    places = dict(zip(graph, positions(random_hexagonal(6, 4)).values(), strict=True))
    measured = {name: 0.2 + 0.01 * k for k, name in enumerate(graph)}
    pairs = {name: initial_pair(places[name], measured[name]) for name in graph}
    optimum = centralised_estimate(list(places.values()), list(measured.values()))
    for pair in one_round(graph, pairs, neighbour_weights(graph)).values():
        np.testing.assert_allclose(told(pair), optimum, atol=1e-12)


def test_rounds_without_loss_converge_to_the_centralised_estimate() -> None:
    """400 rounds on 16 modules; the slowest mode contracts by less than 0.95 a round here, so 1e-8 is far above it."""
    graph, places, measured = array(16, 11)
    weights = neighbour_weights(graph)
    pairs = {name: initial_pair(places[name], measured[name]) for name in graph}
    for _ in range(400):
        pairs = one_round(graph, pairs, weights)
    optimum = centralised_estimate([places[n] for n in graph], [measured[n] for n in graph])
    for pair in pairs.values():
        np.testing.assert_allclose(told(pair), optimum, atol=1e-8)


@given(seed=st.integers(0, 10**6), loss=st.floats(0.0, 0.9))
def test_without_noise_every_pattern_of_lost_frames_leaves_the_estimate_exact(seed: int, loss: float) -> None:
    """P and q travel in one frame: any mixture is a weighted least squares with positive weights."""
    graph, places, _ = array(8, seed)
    state = np.array([0.2, 0.1, -0.05])
    weights = neighbour_weights(graph)
    pairs = {name: initial_pair(places[name], float(design_row(places[name]) @ state)) for name in graph}
    lost = stream(seed, "test", "loss")
    draw = 0
    for _ in range(5):
        heard: dict[str, dict[str, InformationPair]] = {name: {} for name in graph}
        for i, j in graph.to_directed().edges:
            draw += 1
            if lost.uniform(draw) >= loss:
                heard[j][i] = pairs[i]
        pairs = {name: averaged(pairs[name], heard[name], weights[name]) for name in graph}
    for pair in pairs.values():
        found = estimate(pair)
        if found is not None:  # rounding of 1e-16 over the smallest eigenvalue that passes, 1e-5
            np.testing.assert_allclose(found, state, atol=1e-10)


@given(order=st.permutations(["2", "10", "3", "1a", "1"]), seed=st.integers(0, 100))
def test_a_round_gives_the_same_bits_whatever_the_order_of_arrival(order: list[str], seed: int) -> None:
    """Neighbours are summed in natural order, not in the order of the mapping."""
    draws = stream(seed, "test", "order")
    vectors = {name: np.array([draws.normal(9 * k + i) for i in range(9)]) for k, name in enumerate(sorted(order))}
    weights = dict.fromkeys(order, 1 / 7)
    expected = weighted_average(np.ones(9), vectors, dict.fromkeys(sorted(order), 1 / 7))
    found = weighted_average(np.ones(9), {name: vectors[name] for name in order}, weights)
    assert found.tobytes() == expected.tobytes()


def test_the_weight_of_a_neighbour_that_was_not_heard_stays_with_the_own_state() -> None:
    """With weights 0.25 and 0.5 and only the first heard, three quarters are the own; arguments stay untouched."""
    own, other = np.array([4.0, 0.0]), np.array([0.0, 8.0])
    np.testing.assert_array_equal(weighted_average(own, {"1": other}, {"1": 0.25, "2": 0.5}), [3.0, 2.0])
    np.testing.assert_array_equal(weighted_average(own, {}, {"1": 0.25, "2": 0.5}), own)
    np.testing.assert_array_equal(own, [4.0, 0.0])


@pytest.mark.parametrize(
    ("received", "weights", "message"),
    [
        ({"3": np.ones(1)}, {"1": 0.5}, "'3' is not a neighbour"),
        ({"1": np.ones(1)}, {"1": -0.1}, "at least 0"),
        ({"1": np.ones(1)}, {"1": 0.6, "2": 0.5}, "at most 1"),
    ],
)
def test_bad_weights_are_refused(
    received: dict[str, NDArray[np.float64]], weights: dict[str, float], message: str
) -> None:
    """A neighbour without weight, a negative one, and a sum above one."""
    with pytest.raises(BadInput, match=message):
        weighted_average(np.ones(1), received, weights)


def test_a_pair_packs_into_nine_numbers_and_back() -> None:
    """Upper triangle by rows, then q; unpacking restores the lower triangle exactly."""
    pair = initial_pair((0.3, -0.2), 0.25)
    packed = pack_pair(pair)
    np.testing.assert_array_equal(packed, [1.0, -0.2, -0.3, 0.2**2, 0.2 * 0.3, 0.3**2, 0.25, -0.2 * 0.25, -0.3 * 0.25])
    again = unpack_pair(packed.astype(np.float32))
    np.testing.assert_array_equal(again.P, again.P.T)
    np.testing.assert_array_equal(pack_pair(again), packed.astype(np.float32))
    assert again.P.dtype == np.float64


@pytest.mark.parametrize("vector", [np.ones(8), np.ones((3, 3)), np.full(9, np.inf)])
def test_a_vector_that_is_no_packed_pair_is_refused(vector: NDArray[np.float64]) -> None:
    """Wrong length, wrong shape, not finite."""
    with pytest.raises(BadInput, match="packed information pair"):
        unpack_pair(vector)
