"""Consensus on SO(3): the step, its bound on graphs, the spread that noise leaves."""

from __future__ import annotations

import math

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm, logm, solve_discrete_lyapunov

from volery import rotations as rot
from volery.errors import BadInput
from volery.estimators.frames.so3_consensus import check_step, consensus_step, disagreement, seen_attitude, step_bound
from volery.topologies import complete, laplacian, line, neighbours

Floats = NDArray[np.float64]

ONE = np.array([1.0, 0.0, 0.0, 0.0])
GRAPHS = {"complete of 3": complete(3), "path of 3": line(3), "path of 5": line(5)}
BOUNDS = {"complete of 3": 2 / 3, "path of 3": 2 / 3, "path of 5": 2 / (2 + 2 * math.cos(math.pi / 5))}


def weights_of(graph: nx.Graph) -> dict[str, dict[str, float]]:
    """Every neighbour counts 1."""
    return {agent: dict.fromkeys(neighbours(graph, agent), 1.0) for agent in graph}


def spread_out(graph: nx.Graph, size: float, seed: int) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Attitudes of bodies all over SO(3), and frames of the agents that differ by `size` about each axis [rad]."""
    random = np.random.default_rng(seed)
    bodies = {agent: rot.normalised(random.normal(size=4)) for agent in graph}
    return bodies, {agent: rot.exp_quaternion(size * random.normal(size=3)) for agent in graph}


def steps(
    graph: nx.Graph, bodies: dict[str, Floats], frames: dict[str, Floats], step: float, count: int, noise: float = 0.0
) -> list[float]:
    """The disagreement of the frames before each of `count` steps, and after the last; changes `frames`."""
    random, weights, seen = np.random.default_rng(1), weights_of(graph), []
    for _ in range(count):
        seen.append(disagreement(np.array(list(frames.values()))))
        attitudes = {agent: rot.quaternion_product(frames[agent], bodies[agent]) for agent in graph}
        heard: dict[str, dict[str, Floats]] = {agent: {} for agent in graph}
        for agent in graph:
            for other in neighbours(graph, agent):
                error = rot.exp_quaternion(noise * random.normal(size=3))
                relative = rot.quaternion_product(rot.conjugate(bodies[other]), bodies[agent])
                heard[agent][other] = seen_attitude(attitudes[other], rot.quaternion_product(relative, error))
        for agent in graph:
            new = consensus_step(attitudes[agent], heard[agent], weights[agent], step)
            frames[agent] = rot.quaternion_product(new, rot.conjugate(bodies[agent]))
    return [*seen, disagreement(np.array(list(frames.values())))]


def test_step_is_the_papers_formula() -> None:
    """R exp(ε Σ a log(Rᵀ Γ)) with SciPy's matrix exponential and logarithm; what was not heard counts nothing."""
    random = np.random.default_rng(3)
    q, *said = (rot.exp_quaternion(0.5 * random.normal(size=3)) for _ in range(3))
    weights = {"2": 0.7, "3": 1.5, "4": 9.0}
    R = rot.to_matrix(q)
    pull = sum(a * logm(R.T @ rot.to_matrix(s)) for a, s in zip((0.7, 1.5), said, strict=True))
    new = consensus_step(q, dict(zip("23", said, strict=True)), weights, 0.3)
    np.testing.assert_allclose(rot.to_matrix(new), R @ expm(0.3 * pull), atol=1e-12)
    np.testing.assert_allclose(consensus_step(q, {}, weights, 0.3), q, atol=1e-15)


@pytest.mark.parametrize("name", GRAPHS)
def test_bound_is_two_over_the_largest_eigenvalue(name: str) -> None:
    """2/3 for three agents that hear each other, in a triangle or in a row; 0.553 for five in a row."""
    weights = weights_of(GRAPHS[name])
    assert step_bound(weights) == pytest.approx(BOUNDS[name], rel=1e-12)
    check_step(0.999 * BOUNDS[name], weights)
    for step in (0.0, BOUNDS[name], -0.1):
        with pytest.raises(BadInput, match=f"above 0 and below {BOUNDS[name]:.6g}"):
            check_step(step, weights)


def test_bound_where_hearing_is_not_mutual_or_anchored() -> None:
    """Three that each hear the next: eigenvalues 1.5 ± i√3/2, bound 1. An anchor κ makes 2/λ into (2 − κ)/λ."""
    ring = {"1": {"2": 1.0}, "2": {"3": 1.0}, "3": {"1": 1.0}}
    assert step_bound(ring) == pytest.approx(1.0, rel=1e-12)
    assert step_bound(weights_of(complete(3)), anchor=0.2) == pytest.approx(1.8 / 3, rel=1e-12)


@pytest.mark.parametrize("name", GRAPHS)
@pytest.mark.parametrize("part", [0.5, 0.95, 1.05])
def test_converges_below_the_bound_and_not_above(name: str, part: float) -> None:
    """Frames a degree apart come together, or part, by max |1 − ε λ| a step, as the linear law has it.

    Fitted over the last 10 of 30 steps; slower modes fall behind by then, and curvature adds (1°)² = 3e-4: 1 %.
    """
    graph, step = GRAPHS[name], part * BOUNDS[name]
    bodies, frames = spread_out(graph, math.radians(0.1), 2)
    seen = steps(graph, bodies, frames, step, 30)
    modes = np.linalg.eigvalsh(laplacian(graph))[1:]
    predicted = np.abs(1 - step * modes).max()
    per_step = (seen[-1] / seen[-11]) ** 0.1 if seen[-1] > 1e-12 else 0.0
    assert (seen[-1] < seen[0]) == (part < 1)
    assert per_step == pytest.approx(predicted, rel=0.01)


@pytest.mark.parametrize("name", GRAPHS)
def test_frames_that_are_far_apart_agree_too(name: str) -> None:
    """From 40° about each axis to rounding, at half the bound."""
    bodies, frames = spread_out(GRAPHS[name], math.radians(40.0), 4)
    seen = steps(GRAPHS[name], bodies, frames, 0.5 * BOUNDS[name], 300)
    assert seen[0] > math.radians(30.0)
    assert seen[-1] < 1e-7


def test_equal_weights_keep_the_mean_frame() -> None:
    """Pulls cancel, so that frames 1° apart meet where their mean was; curvature moves it by (1°)² or less."""
    bodies, frames = spread_out(complete(3), math.radians(1.0), 6)
    before = rot.mean_quaternion(np.array(list(frames.values())))
    steps(complete(3), bodies, frames, 1 / 3, 20)
    assert rot.angle_between(before, frames["1"]) < math.radians(1.0) ** 2


@pytest.mark.parametrize("name", GRAPHS)
def test_noise_leaves_the_spread_that_is_expected(name: str) -> None:
    """1° about each axis on ξ: the steady spread is that of x⁺ = (1 − ε L) x + ε n, n_i the sum of a degree's noises.

    Of 1000 steps the first 100 are left out. The mode that forgets slowest, after 1/(ε λ_2) < 10 steps, leaves 45
    independent values of each axis, and so a relative error of the rms of 1/√270 = 6 %: twice that.
    """
    graph, step, noise = GRAPHS[name], 0.5 * BOUNDS[name], math.radians(1.0)
    bodies, frames = spread_out(graph, noise, 8)
    seen = steps(graph, bodies, frames, step, 1000, noise)
    L, centre = laplacian(graph), np.eye(len(graph)) - 1 / len(graph)
    covariance = solve_discrete_lyapunov(
        centre - step * L, centre @ (step**2 * noise**2 * np.diag(np.diag(L))) @ centre
    )
    expected = math.sqrt(3 * np.trace(covariance) / len(graph))
    assert 0.5 * noise < expected < 2 * noise
    assert math.sqrt(np.mean(np.square(seen[100:]))) == pytest.approx(expected, rel=0.12)


def test_disagreement_is_the_rms_angle_to_the_mean() -> None:
    """Two frames 2° apart are 1° from their mean, whatever the signs."""
    apart = rot.exp_quaternion(np.array([0.0, 0.0, math.radians(2.0)]))
    assert disagreement(np.array([ONE, -apart])) == pytest.approx(math.radians(1.0), rel=1e-9)


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ({"1": {"2": -1.0}, "2": {}}, "weight -1 of 2 at 1"),
        ({"1": {"1": 1.0}}, "weight 1 of 1 at 1"),
        ({"1": {"7": 1.0}}, "weight 1 of 7 at 1"),
        ({"1": {"2": math.nan}, "2": {}}, "weight nan of 2 at 1"),
        ({"1": {}, "2": {}}, "nobody hears anybody"),
    ],
)
def test_weights_that_are_none_have_no_bound(weights: dict[str, dict[str, float]], message: str) -> None:
    """Negative, of oneself, of strangers, not a number, or of nobody."""
    with pytest.raises(BadInput, match=message):
        step_bound(weights)


def test_anchors_and_strangers_are_refused() -> None:
    """An anchor is a fraction below 1; who has no weight is not heard."""
    for anchor in (-0.1, 1.0, math.nan):
        with pytest.raises(BadInput, match="anchor is"):
            step_bound(weights_of(complete(3)), anchor)
    with pytest.raises(BadInput, match="'9' is not a neighbour"):
        consensus_step(ONE, {"9": ONE}, {"2": 1.0}, 0.3)
