"""Rotation matrices: exponential, logarithm, the nearest rotation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from volery import rotations as rot
from volery.errors import BadInput

from .conftest import Floats, quaternions, vectors

ROUNDING = 1e-14


@given(v=vectors(3.0), u=vectors(1.0))
def test_skew_is_the_cross_product_and_vee_undoes_it(v: Floats, u: Floats) -> None:
    """The matrix times u is v × u; vee gives the vector back."""
    np.testing.assert_allclose(rot.skew(v) @ u, np.cross(v, u), atol=ROUNDING)
    np.testing.assert_array_equal(rot.vee(rot.skew(v)), v)


@given(v=vectors(3.0))
def test_exponential_is_that_of_the_skew_matrix(v: Floats) -> None:
    """SciPy's general matrix exponential (good to some 1e-15 ‖v‖) and its Rotation say the same."""
    np.testing.assert_allclose(rot.exp_so3(v), expm(rot.skew(v)), atol=ROUNDING)
    np.testing.assert_allclose(rot.exp_so3(v), Rotation.from_rotvec(v).as_matrix(), atol=ROUNDING)


@given(v=vectors(3.1), scale=st.sampled_from([1.0, 1e-3, 1e-9]))
def test_logarithm_undoes_the_exponential_near_zero(v: Floats, scale: float) -> None:
    """Entries of the matrix are rounded to 1e-16, and so, absolutely, is the vector; also where the angle is 1e-9."""
    np.testing.assert_allclose(rot.log_quaternion(rot.from_matrix(rot.exp_so3(v * scale))), v * scale, atol=ROUNDING)


@given(q=quaternions(), gap=st.sampled_from([0.0, 1e-15, 1e-8, 1e-3]))
def test_exponential_undoes_the_logarithm_near_a_half_turn(q: Floats, gap: float) -> None:
    """The formula with tr R divides by sin θ there; this one keeps all digits, whichever axis it finds."""
    axis = rot.rotate(q, np.array([1.0, 0.0, 0.0]))
    R = rot.exp_so3((math.pi - gap) * axis)
    found = rot.log_quaternion(rot.from_matrix(R))
    assert np.linalg.norm(found) == pytest.approx(math.pi - gap, abs=ROUNDING)
    np.testing.assert_allclose(rot.exp_so3(found), R, atol=ROUNDING)


@given(q=quaternions(), seed=st.integers(0, 1000), reflect=st.booleans())
def test_nearest_rotation_beats_those_around_it(q: Floats, seed: int, reflect: bool) -> None:
    """A rotation, and no turn of it by 0.01 or 0.3 rad is nearer to the matrix; also at a negative determinant."""
    random = np.random.default_rng(seed)
    M = rot.to_matrix(q) + 0.2 * random.normal(size=(3, 3))
    if reflect:
        M = M @ np.diag([1.0, 1.0, -0.3])
    R = rot.project_so3(M)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=ROUNDING)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=ROUNDING)
    best = ((R - M) ** 2).sum()
    for size in (0.01, 0.3):
        for turn in random.normal(size=(50, 3)) * size:
            assert ((R @ rot.exp_so3(turn) - M) ** 2).sum() >= best - 1e-12


@given(q=quaternions(), scale=st.floats(0.1, 10.0))
def test_nearest_rotation_to_a_scaled_one_is_that_one(q: Floats, scale: float) -> None:
    """Size does not matter, direction does."""
    R = rot.to_matrix(q)
    np.testing.assert_allclose(rot.project_so3(scale * R), R, atol=ROUNDING)


@pytest.mark.parametrize("M", [np.zeros((3, 3)), np.diag([1.0, 0.0, 0.0]), -np.eye(3)], ids=["zero", "line", "mirror"])
def test_no_nearest_rotation_is_refused(M: Floats) -> None:
    """Where many rotations are equally near, none is given."""
    with pytest.raises(BadInput, match="more than one rotation"):
        rot.project_so3(M)
    with pytest.raises(BadInput, match="finite"):
        rot.project_so3(M + np.nan)


@pytest.mark.parametrize(
    "M",
    [np.diag([1.0, 1.0, -1.0]), 1.01 * np.eye(3), np.eye(3) + 1e-4, np.full((3, 3), np.nan), np.zeros((3, 3))],
    ids=["mirror", "scaled", "sheared", "nan", "zero"],
)
def test_what_is_no_rotation_has_no_quaternion(M: Floats) -> None:
    """A matrix that has drifted off SO(3) is not silently taken for another rotation."""
    with pytest.raises(BadInput):
        rot.from_matrix(M)


def test_what_is_not_skew_has_no_vector() -> None:
    """Symmetric parts are not dropped silently; the message gives their size."""
    with pytest.raises(BadInput, match=r"entry of 2; take ½ \(S − Sᵀ\)"):
        rot.vee(np.eye(3))
