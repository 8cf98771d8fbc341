"""Attitude from directions: the constraint, the sequence of projections, and least squares."""

from __future__ import annotations

import math
from itertools import chain

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from volery.errors import BadInput
from volery.estimators.attitude.directions import learned_quaternion, least_squares_attitude, observation_matrix
from volery.randomness import stream
from volery.rotations import (
    angle_between,
    conjugate,
    euler_to_quaternion,
    exp_quaternion,
    mean_quaternion,
    quaternion_product,
    rotate,
)
from volery.worlds.rigid_body.measurement_units import DIRECTIONS

Floats = NDArray[np.float64]

REFERENCES = [np.array(direction) for direction in DIRECTIONS.values()]
ANGLES = st.floats(-math.pi, math.pi)
ATTITUDES = st.builds(euler_to_quaternion, ANGLES, st.floats(-1.5, 1.5), ANGLES)
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
ROUNDING = 1e-13
"""Some dozens of operations on numbers of size 2, at 2.2e-16 each."""


def seen(attitude: Floats, references: list[Floats], noise: float = 0.0, seed: int = 0) -> list[Floats]:
    """The references in the frame with this attitude, with noise in each component, at norm 1."""
    draws = stream(seed, "test")
    found = []
    for number, reference in enumerate(references):
        extra = [noise * draws.normal(3 * number + axis) for axis in range(3)]
        direction = rotate(conjugate(attitude), reference) + extra
        found.append(direction / np.linalg.norm(direction))
    return found


@given(attitude=ATTITUDES, count=st.integers(0, 4))
def test_the_constraint_holds_at_the_true_attitude(attitude: Floats, count: int) -> None:
    """H Q = 0 to rounding, for any number of directions."""
    references = [rotate(exp_quaternion(np.array([0.3, 0.7, -0.5]) * k), REFERENCES[0]) for k in range(count)]
    observed = np.array(seen(attitude, references)).reshape(-1, 3)
    H = observation_matrix(observed, np.array(references).reshape(-1, 3))
    assert H.shape == (4 * count, 4)
    assert np.abs(H @ attitude).max(initial=0.0) < ROUNDING


@given(attitude=ATTITUDES)
def test_one_direction_leaves_a_turn_open_and_two_leave_none(attitude: Floats) -> None:
    """Rank 2 for one direction, 3 for two; with a third one it stays 3."""
    three = [*REFERENCES, np.array([0.6, 0.8, 0.0])]
    observed = seen(attitude, three)
    ranks = [np.linalg.matrix_rank(observation_matrix(observed[:m], three[:m]), tol=1e-9) for m in (1, 2, 3)]
    assert ranks == [2, 3, 3]


@given(
    attitude=ATTITUDES,
    prior=ATTITUDES,
    alpha=st.floats(0.01, 5.0),
    gamma=st.floats(0.01, 1.99),
    count=st.integers(1, 2),
)
def test_projections_never_lead_away_from_the_truth(
    attitude: Floats, prior: Floats, alpha: float, gamma: float, count: int
) -> None:
    """Each one keeps φᵀQ = 0, so that the part along Q stays while the rest shrinks: |cos| of half the error grows."""
    learned = learned_quaternion(prior, seen(attitude, REFERENCES[:count]), REFERENCES[:count], alpha, gamma)
    assert np.linalg.norm(learned) == pytest.approx(1.0, abs=ROUNDING)
    assert abs(learned @ attitude) >= abs(prior @ attitude) - ROUNDING


@given(attitude=ATTITUDES, turn=st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array))
def test_two_directions_lead_to_the_attitude(attitude: Floats, turn: Floats) -> None:
    """From a prior up to 100° off, 60 samples without noise leave less than 10⁻⁹ rad: 0.7 a sample would do."""
    learned = quaternion_product(attitude, exp_quaternion(turn))
    observed = seen(attitude, REFERENCES)
    for _ in range(60):
        learned = learned_quaternion(learned, observed, REFERENCES)
    assert angle_between(learned, attitude) < 1e-9


def test_one_direction_leads_to_the_nearest_attitude_that_it_allows() -> None:
    """Repeated projections end at the prior's own part in the null space of H, which turns b into r."""
    attitude, prior = euler_to_quaternion(0.4, -0.2, 2.0), euler_to_quaternion(0.1, 0.3, -0.5)
    observed = seen(attitude, REFERENCES[:1])
    learned = prior
    for _ in range(100):
        learned = learned_quaternion(learned, observed, REFERENCES[:1], alpha=0.01)
    H = observation_matrix(observed, REFERENCES[:1])
    kept = prior - np.linalg.pinv(H) @ (H @ prior)
    np.testing.assert_allclose(learned, kept / np.linalg.norm(kept), atol=1e-9)
    np.testing.assert_allclose(rotate(learned, observed[0]), REFERENCES[0], atol=1e-9)
    assert angle_between(learned, attitude) > 1.0


def test_without_directions_the_prior_is_handed_on() -> None:
    """A unit whose sensors are all silent learns nothing and forgets nothing."""
    prior = euler_to_quaternion(0.1, 0.2, 0.3)
    np.testing.assert_array_equal(learned_quaternion(prior, [], []), prior)


def test_the_more_damping_the_less_is_taken_from_one_sample() -> None:
    """From the true attitude on, what a noisy sample does to the error falls with α; 300 samples know it to 4 %."""

    def rms(alpha: float) -> float:
        squares = []
        for trial in range(300):
            learned = learned_quaternion(IDENTITY, seen(IDENTITY, REFERENCES, 0.03, trial), REFERENCES, alpha)
            squares.append(angle_between(learned, IDENTITY) ** 2)
        return math.sqrt(np.mean(squares))

    little, usual, much = rms(0.01), rms(0.2), rms(5.0)
    assert little < 3 * 0.03
    assert much < 0.7 * usual < 0.7 * 1.1 * little


def test_the_sign_of_the_prior_is_kept() -> None:
    """Of q and −q, which are one attitude, the estimate is the one near to its prior: there are no jumps."""
    attitude = euler_to_quaternion(0.3, -0.4, 1.0)
    observed = seen(attitude, REFERENCES, 0.02)
    plus, minus = (learned_quaternion(sign * attitude, observed, REFERENCES) for sign in (1.0, -1.0))
    np.testing.assert_array_equal(plus, -minus)
    assert plus @ attitude > 0.9


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"alpha": -0.1}, "alpha is -0.1"),
        ({"gamma": 2.0}, "gamma 2: give"),
        ({"gamma": 0.0}, "gamma 0: give"),
        ({"alpha": math.nan}, "alpha is nan"),
        ({"prior": 1.01 * IDENTITY}, "the prior: a quaternion has norm 1"),
        ({"references": REFERENCES[:1]}, "2 observed and 1 reference"),
        ({"alpha": 0.0, "observed": [], "references": []}, "alpha is 0 and there is no direction"),
        ({"alpha": 0.0, "observed": REFERENCES}, "alpha is 0 and a constraint is all zeros"),
    ],
)
def test_what_cannot_be_learned_from_is_refused(arguments: dict[str, object], message: str) -> None:
    """Bounds of α and γ, a prior that is no rotation, α = 0 without data or where a row vanishes."""
    given_ = {"prior": IDENTITY, "observed": seen(euler_to_quaternion(0, 0, 0.3), REFERENCES), "references": REFERENCES}
    with pytest.raises(BadInput, match=message):
        learned_quaternion(**(given_ | arguments))  # type: ignore[arg-type]


def test_a_prior_that_the_data_leave_nothing_of_is_refused() -> None:
    """Three directions without damping and a prior half a turn off, which the rows take away altogether."""
    axes = list(np.eye(3))
    with pytest.raises(BadInput, match="leave nothing of the prior"):
        learned_quaternion(np.array([0.0, 0.0, 0.0, 1.0]), [3.0 * axes[0], 3.0 * axes[1]], axes[:2], alpha=1e-320)


@given(attitude=ATTITUDES)
def test_least_squares_solves_wahbas_problem(attitude: Floats) -> None:
    """As SciPy does by singular values; both solve to rounding what differs from the truth by the noise."""
    observed = seen(attitude, REFERENCES, 0.05)
    found = least_squares_attitude(observed, REFERENCES)
    assert found is not None
    rotation, _ = Rotation.align_vectors(np.array(REFERENCES), np.array(observed))
    assert angle_between(found, rotation.as_quat(scalar_first=True)) < 1e-7
    assert 0.0 < angle_between(found, attitude) < 0.3


@pytest.mark.parametrize("parallel", [1.0, -1.0])
def test_least_squares_says_where_a_turn_is_open(parallel: float) -> None:
    """No direction, one direction, or several that are parallel determine no attitude."""
    attitude = euler_to_quaternion(0.3, -0.4, 1.0)
    assert least_squares_attitude(np.empty((0, 3)), np.empty((0, 3))) is None
    references = [REFERENCES[0], parallel * REFERENCES[0]]
    assert least_squares_attitude(seen(attitude, references[:1]), references[:1]) is None
    assert least_squares_attitude(seen(attitude, references, 0.03), references) is None


def test_least_squares_over_all_units_is_their_mean_attitude() -> None:
    """Units that see both directions each: Markley's mean of their own attitudes, up to the square of the noise."""
    attitude, noise = euler_to_quaternion(0.3, -0.4, 1.0), 1e-3
    each = [seen(attitude, REFERENCES, noise, seed) for seed in range(5)]
    own = np.array([least_squares_attitude(observed, REFERENCES) for observed in each])
    together = least_squares_attitude(list(chain(*each)), 5 * REFERENCES)
    assert together is not None
    assert angle_between(mean_quaternion(own), together) < 30 * noise**2
    assert angle_between(own[0], together) > noise / 10
