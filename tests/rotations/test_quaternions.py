"""Unit quaternions: the group, the exponential, the means; SciPy's Rotation is the independent word on conventions.

Tolerances: every result is a handful of products of numbers of size 1, each rounded to 1.1e-16; 1e-14 is a hundred of
those, and 1e-12 leaves room for a condition number of a hundred.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from volery import rotations as rot
from volery.errors import BadInput

from .conftest import Floats, quaternions, vectors

ROUNDING = 1e-14
ONE = np.array([1.0, 0.0, 0.0, 0.0])


def scipys(q: Floats) -> Rotation:
    """SciPy puts the scalar last."""
    return Rotation.from_quat(np.roll(q, -1))


@given(p=quaternions(), q=quaternions(), r=quaternions())
def test_quaternions_form_a_group(p: Floats, q: Floats, r: Floats) -> None:
    """The product is associative, 1 is neutral, the conjugate is the inverse and reverses products."""
    product = rot.quaternion_product
    np.testing.assert_allclose(product(product(p, q), r), product(p, product(q, r)), atol=ROUNDING)
    np.testing.assert_array_equal(product(ONE, q), q)
    np.testing.assert_array_equal(product(q, ONE), q)
    np.testing.assert_allclose(product(q, rot.conjugate(q)), ONE, atol=ROUNDING)
    reverse = product(rot.conjugate(q), rot.conjugate(p))
    np.testing.assert_allclose(rot.conjugate(product(p, q)), reverse, atol=ROUNDING)


def test_convention_is_hamiltons() -> None:
    """Units multiply as i j = k; a quarter turn about z takes body x to inertial y."""
    _, i, j, k = np.eye(4)
    np.testing.assert_array_equal(rot.quaternion_product(i, j), k)
    quarter = rot.exp_quaternion(np.array([0.0, 0.0, math.pi / 2]))
    np.testing.assert_allclose(rot.rotate(quarter, np.array([1.0, 0.0, 0.0])), [0.0, 1.0, 0.0], atol=ROUNDING)


@given(p=quaternions(), q=quaternions(), v=vectors(1.0))
def test_matrices_rotations_and_products_agree_with_scipy(p: Floats, q: Floats, v: Floats) -> None:
    """R(q), R(q) v, R(p) R(q) and the way back from the matrix are SciPy's."""
    np.testing.assert_allclose(rot.to_matrix(q), scipys(q).as_matrix(), atol=ROUNDING)
    np.testing.assert_allclose(rot.rotate(q, v), scipys(q).apply(v), atol=ROUNDING)
    np.testing.assert_allclose(
        rot.to_matrix(rot.quaternion_product(p, q)), rot.to_matrix(p) @ rot.to_matrix(q), atol=ROUNDING
    )
    back = rot.from_matrix(scipys(q).as_matrix())
    np.testing.assert_allclose(rot.same_sign(back, q), q, atol=ROUNDING)
    assert back[0] >= 0.0


@given(v=vectors(3.1), scale=st.sampled_from([1.0, 1e-3, 1e-8, 1e-160]))
def test_exponential_and_logarithm_undo_each_other(v: Floats, scale: float) -> None:
    """To a relative 1e-14 of the angle, down to the smallest angles: nothing is lost by subtraction near 0."""
    small = v * scale
    back = rot.log_quaternion(rot.exp_quaternion(small))
    np.testing.assert_allclose(back, small, rtol=ROUNDING, atol=ROUNDING * float(np.linalg.norm(small)))
    np.testing.assert_allclose(rot.exp_quaternion(small), np.roll(Rotation.from_rotvec(small).as_quat(), 1), atol=1e-15)


@given(axis=quaternions(), gap=st.sampled_from([0.0, 1e-15, 1e-9, 1e-4]))
def test_logarithm_near_a_half_turn(axis: Floats, gap: float) -> None:
    """Just below π the rotation vector comes back; just above it the other way round, π − gap about −axis."""
    about = axis[1:] / np.linalg.norm(axis[1:]) if np.linalg.norm(axis[1:]) > 0.1 else np.array([0.0, 0.0, 1.0])
    below = rot.log_quaternion(rot.exp_quaternion((math.pi - gap) * about))
    np.testing.assert_allclose(np.linalg.norm(below), math.pi - gap, rtol=1e-15)
    np.testing.assert_allclose(abs(below @ about), math.pi - gap, rtol=ROUNDING)
    above = rot.log_quaternion(rot.exp_quaternion((math.pi + 1e-3 + gap) * about))
    np.testing.assert_allclose(above, (gap + 1e-3 - math.pi) * about, atol=1e-14)


@given(p=quaternions(), q=quaternions())
def test_angle_between_attitudes_is_scipys_whatever_the_signs(p: Floats, q: Floats) -> None:
    """A distance: SciPy's magnitude of p⁻¹ q, symmetric, blind to the signs of p and q, from 0 to π."""
    expected = (scipys(p).inv() * scipys(q)).magnitude()
    for first, second in ((p, q), (-p, q), (q, p)):
        assert rot.angle_between(first, second) == pytest.approx(expected, abs=1e-7)  # SciPy's is coarse near π
    assert rot.angle_between(p, p) < ROUNDING


@given(
    roll=st.floats(-math.pi, math.pi),
    pitch=st.sampled_from([0.0, 1.0, -1.0, math.pi / 2, -math.pi / 2, math.pi / 2 - 1e-9]),
    yaw=st.floats(-math.pi, math.pi),
)
def test_euler_angles_there_and_back(roll: float, pitch: float, yaw: float) -> None:
    """Angles to quaternion as SciPy's ZYX; back to angles of the same attitude, looking straight up included."""
    q = rot.euler_to_quaternion(roll, pitch, yaw)
    expected = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    np.testing.assert_allclose(rot.to_matrix(q), expected.as_matrix(), atol=ROUNDING)
    angles = rot.quaternion_to_euler(q)
    assert (np.abs(angles) <= (math.pi, math.pi / 2 + ROUNDING, math.pi)).all()
    assert angles[1] == pytest.approx(pitch, abs=ROUNDING)
    assert rot.angle_between(rot.euler_to_quaternion(*angles.tolist()), q) < ROUNDING


@given(q=quaternions(), omega=vectors(20.0), dt_s=st.floats(1e-4, 0.1), steps=st.integers(1, 20))
def test_integration_is_exact_at_constant_rates(q: Floats, omega: Floats, dt_s: float, steps: int) -> None:
    """Any number of steps is one rotation about ω in the body, by SciPy; at most 40 rad have passed: 1e-13."""
    now = q
    for _ in range(steps):
        now = rot.integrate(now, omega, dt_s)
    expected = scipys(q) * Rotation.from_rotvec(omega * dt_s * steps)
    np.testing.assert_allclose(rot.to_matrix(now), expected.as_matrix(), atol=1e-13)


@given(q=quaternions(), omega=vectors(2.0))
def test_rate_is_the_derivative_of_the_integral(q: Floats, omega: Floats) -> None:
    """Central differences of `integrate`, step 1e-5: third derivative at most ω³/8 = 5.2, so an error below 1e-10."""
    step = 1e-5
    numeric = (rot.integrate(q, omega, step) - rot.integrate(q, omega, -step)) / (2 * step)
    np.testing.assert_allclose(rot.quaternion_rate(q, omega), numeric, atol=1e-10)


@given(q=quaternions(), weights=st.lists(st.floats(0.1, 2.0), min_size=4, max_size=4), seed=st.integers(0, 1000))
def test_mean_has_the_smallest_weighted_distance(q: Floats, weights: list[float], seed: int) -> None:
    """None of 200 rotations of the mean comes closer in Σ w ‖R − R_i‖²; signs do not count."""
    random = np.random.default_rng(seed)
    around = np.array([rot.quaternion_product(q, rot.exp_quaternion(0.8 * random.normal(size=3))) for _ in range(4)])
    around *= random.choice([-1.0, 1.0], size=(4, 1))
    w = np.array(weights)

    def distance(mean: Floats) -> float:
        R = rot.to_matrix(mean)
        return float(sum(w_i * ((R - rot.to_matrix(q_i)) ** 2).sum() for w_i, q_i in zip(w, around, strict=True)))

    mean = rot.mean_quaternion(around, w)
    assert mean @ around[0] >= 0.0
    best = distance(mean)
    for size in (1e-3, 1e-1):
        for turn in random.normal(size=(100, 3)) * size:
            assert distance(rot.quaternion_product(mean, rot.exp_quaternion(turn))) >= best - 1e-12


def test_mean_of_one_and_of_two() -> None:
    """Of one it is that one; of two equally weighted, halfway; of weights 1 and 0, the first."""
    turned = rot.exp_quaternion(np.array([0.0, 0.6, 0.0]))
    both = np.array([ONE, -turned])
    np.testing.assert_allclose(rot.mean_quaternion(both[1:]), -turned, atol=ROUNDING)
    halfway = rot.exp_quaternion(np.array([0.0, 0.3, 0.0]))
    np.testing.assert_allclose(rot.mean_quaternion(both), halfway, atol=ROUNDING)
    np.testing.assert_allclose(rot.mean_quaternion(both, np.array([1.0, 0.0])), ONE, atol=ROUNDING)


@pytest.mark.parametrize("weights", [[-1.0, 2.0], [0.0, 0.0], [1.0]])
def test_mean_refuses_weights_that_are_none(weights: list[float]) -> None:
    """Negative, all zero, or too few."""
    with pytest.raises(BadInput, match="weights of a mean are 2 numbers"):
        rot.mean_quaternion(np.array([ONE, ONE]), np.array(weights))


def test_mean_refuses_nothing() -> None:
    """No quaternions have no mean."""
    with pytest.raises(BadInput, match=r"N ≥ 1"):
        rot.mean_quaternion(np.zeros((0, 4)))


@pytest.mark.parametrize("q", [[0.0] * 4, [math.nan, 0.0, 0.0, 0.0], [math.inf, 0.0, 0.0, 0.0]])
def test_what_has_no_direction_is_not_normalised(q: list[float]) -> None:
    """Zero and what is not finite."""
    with pytest.raises(BadInput, match="no direction"):
        rot.normalised(np.array(q))


def test_normalised_and_unit() -> None:
    """Any norm becomes 1; `unit` takes only rounding away and refuses the rest, naming whose quaternion it is."""
    q = np.array([3.0, 0.0, 4.0, 0.0])
    np.testing.assert_allclose(rot.normalised(q), q / 5.0, atol=1e-16)
    np.testing.assert_allclose(rot.unit(q / 5.0 * (1 + 9e-7), "mount of unit 1"), q / 5.0, atol=1e-15)
    for wrong in (q, q / 5.0 * (1 + 2e-6), np.full(4, math.nan)):
        with pytest.raises(BadInput, match=r"mount of unit 1: .* norm"):
            rot.unit(wrong, "mount of unit 1")
