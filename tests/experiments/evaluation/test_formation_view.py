"""What a vehicle's estimate says of where all are, for pictures in plan view."""

from __future__ import annotations

import numpy as np

from volery.experiments.evaluation.mav_evaluation import formation_view

APART = np.array([[1.0, -2.0, 0.5], [3.0, 0.0, 0.1]])


def state(apart: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Relative positions with velocities of 9 m/s between them."""
    return np.concatenate([np.concatenate([each, np.full(3, 9.0)]) for each in apart])


def test_places_are_the_relative_positions_about_their_centre() -> None:
    """r_i = p_i − p_{i+1}, in x and y; where the centre is nobody knows."""
    view = formation_view(["1", "2", "3"], state(APART), None)
    assert view.relative
    assert view.covariances == {}
    np.testing.assert_allclose(view.places["1"] - view.places["2"], [1.0, -2.0], atol=1e-15)
    np.testing.assert_allclose(view.places["2"] - view.places["3"], [3.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(sum(view.places.values()), [0.0, 0.0], atol=1e-15)


def test_covariances_are_those_of_the_places_about_the_centre() -> None:
    """Of 200,000 drawn states, whose sample covariances are off by 1/√100,000 = 0.3 %: five times that."""
    random = np.random.default_rng(4)
    factor = random.normal(size=(12, 12))
    drawn = random.normal(size=(200_000, 12)) @ factor.T + state(APART)
    first, second = drawn[:, 0:2], drawn[:, 6:8]
    places = {"1": (2 * first + second) / 3, "2": (second - first) / 3, "3": -(first + 2 * second) / 3}
    view = formation_view(["1", "2", "3"], state(APART), (factor @ factor.T).ravel())
    for name, where in places.items():
        expected = np.cov(where.T)
        np.testing.assert_allclose(view.covariances[name], expected, atol=0.015 * np.trace(expected))
