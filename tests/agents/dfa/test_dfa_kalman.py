"""Flying-array modules with rate gyros."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from volery.agents.dfa.kalman import DfaKalman
from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.analysis.metrics import Metrics, compute_metrics
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded
from volery.worlds.plane.plane_world import PlaneWorld, distances, turning

from ...surroundings import build_world as build

PLACES = {"1": (0.0, 0.0), "2": (0.25, 0.0), "3": (0.1, 0.2), "4": (-0.2, 0.15)}
SCENARIO: dict[str, Any] = {
    "name": "gyros",
    "seed": 3,
    "duration": "3 s",
    "topology": {"cells": [[0, 0], [1, 0], [0, 1]]},
    "agents": {"kind": "dfa-kalman", "payload": "float64", "filter": "hybrid", "rounds": 1},
    "world": {
        "kind": "plane",
        "altitude": "30 cm",
        "roll": {"sine": {"amplitude": "10 deg", "frequency": "0.5 Hz"}},
        "pitch": {"sine": {"amplitude": "5 deg", "frequency": "0.3 Hz"}},
        "gyroscope": {"noise": "0.5 deg/s"},
    },
    "links": {"latency": "5 ms"},
}


def plan(*overrides: str) -> Plan:
    """The plan with these overrides."""
    return load_scenario(SCENARIO, overrides).plan


def run(*overrides: str) -> Metrics:
    """The metrics of the scenario."""
    return compute_metrics(recorded(plan(*overrides)))


def plane(**changes: Any) -> PlaneWorld:
    """A plane with gyros."""
    found = build({"kind": "plane", "altitude": "0.3 m", "gyroscope": {"noise": 0}, **changes}, PLACES, 3)
    assert isinstance(found, PlaneWorld)
    return found


def rotation(roll: float, pitch: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Body to inertial, yaw 0."""
    x = np.array([[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]])
    y = np.array([[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]])
    return np.asarray(y @ x, dtype=np.float64)


def test_gyros_say_by_how_much_the_body_turns_about_its_own_axes() -> None:
    """Rᵀ Ṙ of the rotation is the skew matrix of the rates; of a small turn, to second order in it."""
    before, now, period = (0.4, -0.3), (0.4004, -0.3003), 0.01
    middle, turn = rotation(0.4002, -0.30015), (rotation(*now) - rotation(*before)) / period
    skew = middle.T @ turn
    np.testing.assert_allclose(turning(before, now, period), [skew[2, 1], skew[0, 2], skew[1, 0]], atol=1e-6)


def test_the_world_has_gyros_on_request_with_noise_of_their_own() -> None:
    """None at the first sample; what they add up to is the angle; each module has noise of its own, as asked for."""
    assert dict(build({"kind": "plane", "altitude": "0.3 m"}, PLACES, 3).sensors("1")) == {"distance": 20.0}
    still = plane(roll={"sine": {"amplitude": "8 deg", "frequency": "0.5 Hz"}})
    assert still.measure("1", "gyroscope", 0) is None
    told = [still.measure("1", "gyroscope", k) for k in range(1, 8)]
    rolled = sum(float(rates[0]) / 20 for rates in told if rates is not None)
    assert rolled == pytest.approx(still.truth(350_000_000)[1])
    noisy = plane(gyroscope={"noise": "2 deg/s"})
    draws = np.array([noisy.measure(agent, "gyroscope", k) for agent in PLACES for k in range(1, 200)])
    assert np.std(draws) == pytest.approx(math.radians(2), rel=5 / (2 * draws.size) ** 0.5)
    assert len(np.unique(draws)) == draws.size
    with pytest.raises(BadInput, match="agent 1 has no sensor 'compass': it has distance, gyroscope"):
        noisy.measure("1", "compass", 0)


def test_the_model_is_linearised_rightly() -> None:
    """One step and the distances, against the nonlinear ones at a state beside: the rest is of second order."""
    made = plan()
    problem = DfaKalman.problem(made.public)
    mean, beside = np.array([0.3, 0.2, -0.1]), np.array([1e-3, 2e-3, -1e-3])
    reading = {"gyroscope": np.array([0.3, -0.2, 0.1]), "distance": np.array([0.31])}
    step = problem.step([reading], mean)
    exact = problem.step([reading], mean + beside)
    np.testing.assert_allclose(
        step.transition @ (mean + beside) + step.shift,
        exact.transition @ (mean + beside) + exact.shift,
        atol=1e-6,
    )
    measured = problem.measurement("2", reading, mean)
    assert measured is not None
    place = made.agent("2").position
    assert place is not None
    predicted = measured.matrix @ (mean + beside)
    surplus = measured.value - reading["distance"]
    np.testing.assert_allclose(predicted - surplus, distances(mean + beside, [place]), atol=1e-5)


def test_where_all_hear_all_and_gyros_agree_a_module_is_the_centralised_filter() -> None:
    """Three modules that touch each other, gyros without noise: to 1e-9 m and rad."""
    metrics = run("world.gyroscope.noise=0 rad/s")
    assert metrics.quantities["estimate"].oracle_error.steady_rms < 1e-9


def test_gyros_make_the_estimate_better_than_each_sample_by_itself() -> None:
    """Eight modules, three rounds: less than a fifth of the error of consensus on each sample alone."""
    wide = ("duration=2 s", "topology={hexagonal: 8}", "agents.rounds=3", "agents.filter=consensus-on-information")
    fused = run(*wide).quantities["estimate"].truth_error.steady_rms
    alone = run(*wide[:2], "agents={kind: dfa-module, rounds: 3}").quantities["estimate"].truth_error.steady_rms
    assert fused < 0.2 * alone


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("world={kind: plane, altitude: 0.3 m}", "dfa-kalman needs rate gyros"),
        ("world={kind: target}", "dfa-kalman needs a plane"),
        ("world.distance_noise=0 m", "the world does not say the noise of a distance"),
        ("agents.turn=0 rad", "turn is 0"),
        ("world.gyroscope={nose: 1 deg/s}", "did you mean 'noise'"),
        ("world.gyroscope=1", "should be a mapping"),
        ("world.gyroscope.noise=-1 deg/s", "must be at least 0"),
    ],
)
def test_bad_input_is_refused(override: str, message: str) -> None:
    """With the remedy."""
    with pytest.raises(BadInput, match=re.escape(message)):
        plan(override)
