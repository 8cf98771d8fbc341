"""Rotation matrices: exponential and logarithm."""

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
def test_skew_is_the_cross_product(v: Floats, u: Floats) -> None:
    """The matrix times u is v × u."""
    np.testing.assert_allclose(rot.skew(v) @ u, np.cross(v, u), atol=ROUNDING)


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


@pytest.mark.parametrize(
    "M",
    [np.diag([1.0, 1.0, -1.0]), 1.01 * np.eye(3), np.eye(3) + 1e-4, np.full((3, 3), np.nan), np.zeros((3, 3))],
    ids=["mirror", "scaled", "sheared", "nan", "zero"],
)
def test_what_is_no_rotation_has_no_quaternion(M: Floats) -> None:
    """A matrix that has drifted off SO(3) is not silently taken for another rotation."""
    with pytest.raises(BadInput):
        rot.from_matrix(M)
