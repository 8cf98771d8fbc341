"""Dynamic consensus on quaternions, agent by agent and as the matrices of all."""

from __future__ import annotations

import math
from collections.abc import Sequence

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray

from volery import topologies
from volery.errors import BadInput
from volery.estimators.attitude.dynamic_consensus import (
    AttitudeMessage,
    collective_matrices,
    consensus_rate,
    consensus_step,
    largest_step,
)
from volery.randomness import stream
from volery.rotations import angle_between, euler_to_quaternion, exp_quaternion, mean_quaternion, quaternion_product

Floats = NDArray[np.float64]

GRAPHS = [
    topologies.complete(3),
    topologies.line(4),
    topologies.star(5),
    topologies.ring(6),
    topologies.erdos_renyi(7, 0.5, 3),
]
BASE = euler_to_quaternion(0.5, 0.5, 0.0)


def adjacency(graph: nx.Graph) -> Floats:
    """Zeros and ones, rows in natural order."""
    return np.asarray(nx.to_numpy_array(graph, nodelist=topologies.agents(graph)))


def attitudes(count: int, spread: float, purpose: str) -> list[Floats]:
    """Unit quaternions near BASE."""
    draws = stream(3, purpose)
    turns = [np.array([draws.normal(3 * k + axis) for axis in range(3)]) for k in range(count)]
    return [quaternion_product(BASE, exp_quaternion(spread * turn)) for turn in turns]


def heard(graph: nx.Graph, told: Sequence[AttitudeMessage], name: str) -> dict[str, AttitudeMessage]:
    """What an agent's neighbours told it."""
    names = topologies.agents(graph)
    return {other: told[names.index(other)] for other in topologies.neighbours(graph, name)}


def rates(graph: nx.Graph, told: Sequence[AttitudeMessage]) -> Floats:
    """The rates of all agents, (n, 4)."""
    names = topologies.agents(graph)
    return np.array([consensus_rate(told[i], heard(graph, told, name)) for i, name in enumerate(names)])


@pytest.mark.parametrize("graph", GRAPHS)
def test_agents_together_do_what_the_matrices_say(graph: nx.Graph) -> None:
    """The rates of all are −(Ξ ⊗ I₄) Q̄ + (B ⊗ I₄) Q̂, to rounding of some ten terms of size 1."""
    estimates, averages = attitudes(len(graph), 0.2, "estimates"), attitudes(len(graph), 0.2, "averages")
    told = [AttitudeMessage(*pair) for pair in zip(estimates, averages, strict=True)]
    Xi, B = (np.kron(matrix, np.eye(4)) for matrix in collective_matrices(adjacency(graph)))
    together = -Xi @ np.concatenate(averages) + B @ np.concatenate(estimates)
    np.testing.assert_allclose(rates(graph, told).ravel(), together, atol=1e-14)


def test_eigenvalues_on_the_complete_graph_of_three() -> None:
    """Ξ has 3 for what is common to all and 6 twice for what is not."""
    Xi, B = collective_matrices(adjacency(topologies.complete(3)))
    np.testing.assert_allclose(np.linalg.eigvalsh(Xi), [3.0, 6.0, 6.0], atol=1e-14)
    np.testing.assert_array_equal(B, np.ones((3, 3)))


@pytest.mark.parametrize("graph", GRAPHS)
def test_the_largest_step_is_where_convergence_ends(graph: nx.Graph) -> None:
    """Just below it every deviation dies out, just above it one grows: the spectral radius of I − κ dt Ξ about 1."""
    Xi, _ = collective_matrices(adjacency(graph))
    bound = largest_step(adjacency(graph))
    for factor in (0.99, 1.01):
        radius = np.abs(np.linalg.eigvals(np.eye(len(graph)) - factor * bound * Xi)).max()
        assert (radius < 1.0) == (factor < 1.0)


@pytest.mark.parametrize("graph", GRAPHS)
def test_equal_estimates_are_where_everybody_comes_to_rest(graph: nx.Graph) -> None:
    """From averages up to a radian off, on any graph, below the largest step; the slowest mode has rate 1 at least."""
    averages, step = attitudes(len(graph), 0.3, "averages"), 0.9 * largest_step(adjacency(graph))
    for _ in range(400):
        told = [AttitudeMessage(BASE, average) for average in averages]
        names = topologies.agents(graph)
        averages = [consensus_step(told[i], heard(graph, told, name), step) for i, name in enumerate(names)]
    assert max(angle_between(average, BASE) for average in averages) < 1e-9


@pytest.mark.parametrize(("graph", "is_mean"), [(topologies.complete(3), True), (topologies.line(3), False)])
def test_the_average_is_that_of_all_where_all_have_as_many_neighbours(graph: nx.Graph, is_mean: bool) -> None:
    """On the complete graph it is the mean of the estimates, of which Markley's differs in third order; on a line not.

    There the weights are Ξ⁻¹B: the middle one counts more.
    """
    estimates = attitudes(3, 0.03, "estimates")
    averages = list(estimates)
    names = topologies.agents(graph)
    for _ in range(300):
        told = [AttitudeMessage(*pair) for pair in zip(estimates, averages, strict=True)]
        averages = [consensus_step(told[i], heard(graph, told, name), 0.2) for i, name in enumerate(names)]
    mean = mean_quaternion(np.array(estimates))
    worst = max(angle_between(average, mean) for average in averages)
    assert (worst < 0.03**3) if is_mean else (worst > 0.03 / 10)
    Xi, B = collective_matrices(adjacency(graph))
    weighted = np.linalg.solve(Xi, B) @ np.array(estimates)
    for average, expected in zip(averages, weighted, strict=True):
        assert angle_between(average, expected / np.linalg.norm(expected)) < 0.03**3


def test_signs_of_neighbours_make_no_difference() -> None:
    """Both q and −q are one attitude, whoever says it: the result has the same bits."""
    own = AttitudeMessage(*attitudes(2, 0.2, "own"))
    told = {str(k): AttitudeMessage(*attitudes(2, 0.2, f"told {k}")) for k in range(3)}
    turned = {name: AttitudeMessage(-each.estimate, -each.average) for name, each in told.items()}
    expected = consensus_step(own, told, 0.1)
    np.testing.assert_array_equal(consensus_step(own, turned, 0.1), expected)
    np.testing.assert_array_equal(consensus_step(AttitudeMessage(-own.estimate, own.average), told, 0.1), expected)
    assert np.linalg.norm(expected) == pytest.approx(1.0, abs=1e-15)


def test_the_order_in_which_neighbours_are_held_makes_no_difference() -> None:
    """The bits of the sum follow from the names."""
    own = AttitudeMessage(*attitudes(2, 0.2, "own"))
    told = {str(k): AttitudeMessage(*attitudes(2, 0.2, f"told {k}")) for k in range(9, 12)}
    backwards = dict(reversed(told.items()))
    np.testing.assert_array_equal(consensus_step(own, backwards, 0.1), consensus_step(own, told, 0.1))


def test_a_neighbour_that_was_not_heard_is_left_out() -> None:
    """Both of its terms go, and nothing else changes; alone, an average follows the own estimate at rate 1."""
    own = AttitudeMessage(*attitudes(2, 0.2, "own"))
    one, two = (AttitudeMessage(*attitudes(2, 0.2, f"told {k}")) for k in range(2))
    missing = consensus_rate(own, {"1": one, "2": two}) - consensus_rate(own, {"1": one})
    np.testing.assert_allclose(missing, two.estimate + two.average - 2 * own.average, atol=1e-14)
    np.testing.assert_allclose(consensus_rate(own, {}), own.estimate - own.average, atol=1e-15)


@pytest.mark.parametrize("gain", [1.0, 2.0])
def test_three_that_hear_each_other_lag_by_a_third_of_a_second_over_the_gain(gain: float) -> None:
    """Estimates that turn at ω leave ω / 3κ: a step shrinks the lag by 1 − 3 κ dt and adds ω dt.

    Angles of 0.02 rad differ from their sines by 10⁻⁶.
    """
    turning, step = 0.06, 0.05
    averages, graph = [BASE] * 3, topologies.complete(3)
    for count in range(120):
        estimate = quaternion_product(BASE, exp_quaternion(np.array([0.0, 0.0, turning * step * count])))
        told = [AttitudeMessage(estimate, average) for average in averages]
        averages = [consensus_step(told[i], heard(graph, told, name), gain * step) for i, name in enumerate("123")]
    following = quaternion_product(BASE, exp_quaternion(np.array([0.0, 0.0, turning * step * 120])))
    assert angle_between(averages[0], following) == pytest.approx(turning / (3 * gain), rel=1e-3)


@pytest.mark.parametrize("step", [0.0, -0.1, math.nan])
def test_a_step_that_goes_nowhere_is_refused(step: float) -> None:
    """A gain or a period that is not above 0."""
    with pytest.raises(BadInput, match="must be above 0"):
        consensus_step(AttitudeMessage(BASE, BASE), {}, step)


@pytest.mark.parametrize("matrix", [[[0, 1], [0, 0]], [[1, 0], [0, 0]], [[0, 2], [2, 0]], [[0, 1, 0], [1, 0, 0]]])
def test_what_is_no_graph_is_refused(matrix: list[list[int]]) -> None:
    """Directed, with a loop, weighted, not square."""
    with pytest.raises(BadInput, match="must be symmetric"):
        collective_matrices(matrix)
