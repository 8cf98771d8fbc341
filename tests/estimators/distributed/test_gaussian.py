"""Gaussian beliefs and information pairs: prediction, correction, running forward, packing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from volery.errors import BadInput
from volery.estimators.distributed.gaussian import (
    Gaussian,
    Measurement,
    Step,
    corrected,
    gaussian,
    information,
    measured_information,
    predict,
    run_forward,
)
from volery.estimators.information import InformationPair, pack_symmetric, packed_size, unpack_symmetric


def spd(draws: np.random.Generator, size: int) -> NDArray[np.float64]:
    """A positive definite matrix, of condition below some thousands."""
    factor = draws.normal(size=(size, size))
    return np.asarray(factor @ factor.T + 0.1 * np.eye(size), dtype=np.float64)


def step(draws: np.random.Generator, size: int) -> Step:
    """A step with an invertible transition and full noise."""
    return Step(np.eye(size) + 0.2 * draws.normal(size=(size, size)), spd(draws, size), draws.normal(size=size))


@given(seed=st.integers(0, 10**6), size=st.integers(1, 5))
def test_information_and_moments_are_one_belief(seed: int, size: int) -> None:
    """There and back."""
    draws = np.random.default_rng(seed)
    belief = Gaussian(draws.normal(size=size), spd(draws, size))
    again = gaussian(information(belief))
    assert again is not None
    np.testing.assert_allclose(again.mean, belief.mean, atol=1e-9)
    np.testing.assert_allclose(again.covariance, belief.covariance, atol=1e-9)


@given(seed=st.integers(0, 10**6))
def test_a_correction_is_the_textbook_kalman_update(seed: int) -> None:
    """K = Σ Hᵀ (H Σ Hᵀ + R)⁻¹, x̂ + K (z − H x̂), (I − K H) Σ."""
    draws = np.random.default_rng(seed)
    belief = Gaussian(draws.normal(size=3), spd(draws, 3))
    H, R, z = draws.normal(size=(2, 3)), spd(draws, 2), draws.normal(size=2)
    K = np.linalg.solve(H @ belief.covariance @ H.T + R, H @ belief.covariance).T
    found = corrected(belief, [measured_information(Measurement(H, R, z), 3)])
    np.testing.assert_allclose(found.mean, belief.mean + K @ (z - H @ belief.mean), atol=1e-8)
    np.testing.assert_allclose(found.covariance, (np.eye(3) - K @ H) @ belief.covariance, atol=1e-8)


@given(seed=st.integers(0, 10**6), steps=st.integers(0, 3))
def test_running_forward_a_belief_is_predicting_it(seed: int, steps: int) -> None:
    """In information form and in moments."""
    draws = np.random.default_rng(seed)
    belief = Gaussian(draws.normal(size=4), spd(draws, 4))
    path = tuple(step(draws, 4) for _ in range(steps))
    found = gaussian(run_forward(information(belief), path))
    for one in path:
        belief = predict(belief, one)
    assert found is not None
    np.testing.assert_allclose(found.mean, belief.mean, atol=1e-6)
    np.testing.assert_allclose(found.covariance, belief.covariance, rtol=1e-6, atol=1e-6)


def test_a_measurement_run_forward_is_the_measurement_of_the_later_state() -> None:
    """Z = H x and x⁺ = A x + u + w: then z + H A⁻¹ u = H A⁻¹ x⁺ with noise R + H A⁻¹ Q A⁻ᵀ Hᵀ; the pair is singular."""
    draws = np.random.default_rng(3)
    one, H, z = step(draws, 4), draws.normal(size=(1, 4)), draws.normal(size=1)
    back = H @ np.linalg.inv(one.transition)
    later = Measurement(back, np.eye(1) + back @ one.noise @ back.T, z + back @ one.shift)
    found = run_forward(measured_information(Measurement(H, np.eye(1), z), 4), [one])
    wanted = measured_information(later, 4)
    np.testing.assert_allclose(found.P, wanted.P, atol=1e-12)
    np.testing.assert_allclose(found.q, wanted.q, atol=1e-12)


def test_what_does_not_tell_all_is_no_belief_and_what_takes_away_is_refused() -> None:
    """A singular pair, and a negative one."""
    assert gaussian(InformationPair(np.diag([1.0, 0.0]), np.zeros(2))) is None
    with pytest.raises(BadInput, match="not positive semidefinite"):
        corrected(Gaussian(np.zeros(1), np.eye(1)), [InformationPair(-2 * np.eye(1), np.zeros(1))])


@pytest.mark.parametrize("size", [1, 2, 3, 4, 7])
def test_symmetric_matrices_pack_into_their_upper_triangle(size: int) -> None:
    """And come back exactly symmetric."""
    matrix = spd(np.random.default_rng(size), size)
    packed = pack_symmetric(matrix)
    assert len(packed) + size == packed_size(size)
    np.testing.assert_array_equal(unpack_symmetric(packed), np.triu(matrix) + np.triu(matrix, 1).T)


def test_shapes_that_do_not_fit_are_refused() -> None:
    """The message names the array."""
    with pytest.raises(BadInput, match="covariance has shape"):
        Gaussian(np.zeros(2), np.eye(3))
    with pytest.raises(BadInput, match="transition has shape"):
        Step(np.eye(3), np.eye(2), np.zeros(2))
    with pytest.raises(BadInput, match="noise has shape"):
        Measurement(np.ones((1, 2)), np.eye(2), np.zeros(1))
    with pytest.raises(BadInput, match="upper triangle of no matrix"):
        unpack_symmetric(np.zeros(4))
