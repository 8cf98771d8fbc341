"""A target in the plane."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from volery.errors import BadInput
from volery.worlds.target.target_world import TargetWorld, process_noise, transition

from ...surroundings import build_world as build

AGENTS = ("1", "2", "3", "4")


def world(agents: tuple[str, ...] = AGENTS, seed: int = 1, **changes: Any) -> TargetWorld:
    """The world of a mapping."""
    found = build({"kind": "target", **changes}, {}, seed, agents)
    assert isinstance(found, TargetWorld)
    return found


def test_agents_see_what_the_list_says_round_and_round() -> None:
    """By default x, y, nothing; a mapping names those that see."""
    assert [dict(world().sensors(agent)) for agent in AGENTS] == [{"x": 2.0}, {"y": 2.0}, {}, {"x": 2.0}]
    named = world(sees={3: "y"}, rate="4 Hz")
    assert [dict(named.sensors(agent)) for agent in AGENTS] == [{}, {}, {"y": 4.0}, {}]


def test_the_path_has_the_law_that_filters_take_it_to_have() -> None:
    """Over 400 seeds the first state and the first noise have their covariances, within 5 standard errors (35 %)."""
    worlds = [world(seed=seed, position="3 m", velocity="2 m/s", manoeuvre="0.5 m/s/√s") for seed in range(400)]
    first = np.array([one.state(0) for one in worlds])
    noise = np.array([one.state(1) - transition(0.5) @ one.state(0) for one in worlds])
    for found, wanted in ((first, np.diag([9.0, 9.0, 4.0, 4.0])), (noise, process_noise(0.5, 0.5))):
        scale = np.sqrt(np.diag(wanted))
        np.testing.assert_allclose(np.cov(found.T) / np.outer(scale, scale), wanted / np.outer(scale, scale), atol=0.35)


def test_process_noise_adds_up_over_half_steps() -> None:
    """A(Δ/2) Q(Δ/2) A(Δ/2)ᵀ + Q(Δ/2) = Q(Δ), as of white acceleration."""
    half, A = process_noise(0.5, 0.7), transition(0.5)
    np.testing.assert_allclose(A @ half @ A.T + half, process_noise(1.0, 0.7), atol=1e-15)


def test_all_is_a_function_of_seed_and_index() -> None:
    """The order of questions does not matter, other agents' noise does not depend on who there is, seeds differ."""
    early, late = world(), world(agents=("1", "2"))
    assert early.measure("1", "x", 7) == late.measure("1", "x", 7)
    np.testing.assert_array_equal(early.state(3), late.state(3))
    assert world(seed=2).measure("1", "x", 7) != early.measure("1", "x", 7)
    assert world(seed=2).state(0)[0] != early.state(0)[0]


def test_measurements_are_the_coordinate_with_noise() -> None:
    """Over 500 samples mean and standard deviation, within 5 standard errors."""
    one = world(noise="0.5 m")
    for sensor, agent, place in (("x", "1", 0), ("y", "2", 1)):
        errors = [float((one.measure(agent, sensor, k) or np.zeros(1))[0]) - one.state(k)[place] for k in range(500)]
        assert abs(np.mean(errors)) < 5 * 0.5 / 500**0.5
        assert np.std(errors) == pytest.approx(0.5, rel=5 / 1000**0.5)


def test_between_samples_the_target_keeps_its_velocity() -> None:
    """At the samples it is where the state says, in between on the straight line."""
    one = world(rate="2 Hz")
    np.testing.assert_array_equal(one.truth(1_500_000_000), one.state(3))
    between = one.truth(1_600_000_000)
    np.testing.assert_allclose(between[:2], one.state(3)[:2] + 0.1 * one.state(3)[2:])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"noise": "0 m"}, "noise is 0 m, it must be above 0"),
        ({"rate": "0 Hz"}, "rate is 0 Hz"),
        ({"manoeuvre": "-1 m/s/√s"}, "manoeuvre is -1"),
        ({"sees": ["nothing"]}, "nobody sees anything"),
        ({"sees": ["x", "z"]}, "world.sees.1: 'z' is none of x, y, nothing"),
        ({"sees": {"7": "x"}}, "there is no agent '7'"),
        ({"sees": "x"}, "world.sees: should be a list, not 'x'"),
        ({"nose": "1 m"}, "did you mean 'noise'"),
    ],
)
def test_bad_input_is_refused(changes: dict[str, Any], message: str) -> None:
    """With the place and the remedy."""
    with pytest.raises(BadInput, match=message):
        world(**changes)
    with pytest.raises(BadInput, match="agent 3 has no sensor 'x': it sees nothing"):
        world().measure("3", "x", 0)
