"""Stacks of rotations say what the functions for one say, row by row."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery import rotation_stacks as stacks
from volery import rotations as rot

from .conftest import Floats, quaternions, vectors

Rows = st.lists(vectors(3.0), min_size=1, max_size=4).map(np.array)
Units = st.lists(quaternions(), min_size=1, max_size=4).map(np.array)
ROUNDING = 1e-14
"""A handful of products of numbers of size 1."""


@pytest.mark.parametrize(
    ("many", "one"),
    [
        (stacks.exp_quaternions, rot.exp_quaternion),
        (stacks.skews, rot.skew),
    ],
)
@given(Rows, st.floats(0.0, 1.0))
def test_of_vectors(many: Callable[[Floats], Floats], one: Callable[[Floats], Floats], v: Floats, scale: float) -> None:
    """Of any length, tiny ones included."""
    v = v * scale**6
    expected = np.array([one(row) for row in v])
    assert many(v) == pytest.approx(expected, abs=ROUNDING)


@given(vectors(3.0), vectors(1.0), st.floats(0.0, 1.0))
def test_the_right_jacobian_is_the_derivative_of_the_exponential(v: Floats, direction: Floats, scale: float) -> None:
    """Central differences of log(exp(v)* ⊙ exp(v ± h δ)) with h = 1e-4: h² times a third derivative of size 1."""
    v, h = v * scale**4, 1e-4
    inverse = rot.exp_quaternion(-v)
    ahead, back = (
        rot.log_quaternion(rot.quaternion_product(inverse, rot.exp_quaternion(v + side * h * direction)))
        for side in (1.0, -1.0)
    )
    J = stacks.right_jacobians(np.array([np.zeros(3), v]))[1]
    assert J @ direction == pytest.approx((ahead - back) / (2.0 * h), abs=1e-8)


@pytest.mark.parametrize(
    ("many", "one"),
    [
        (stacks.to_matrices, rot.to_matrix),
        (stacks.conjugates, rot.conjugate),
        (stacks.log_quaternions, rot.log_quaternion),
        (lambda q: stacks.normalised_rows(1.7 * q), lambda q: q),
    ],
)
@given(Units)
def test_of_quaternions(many: Callable[[Floats], Floats], one: Callable[[Floats], Floats], q: Floats) -> None:
    """Both signs, the identity and half turns."""
    assert many(q) == pytest.approx(np.array([one(row) for row in q]), abs=ROUNDING)


@given(quaternions(), quaternions(), quaternions())
def test_products(p: Floats, q: Floats, r: Floats) -> None:
    """Row by row, in the order written."""
    expected = np.array([rot.quaternion_product(p, q), rot.quaternion_product(q, r)])
    assert stacks.quaternion_products(np.array([p, q]), np.array([q, r])) == pytest.approx(expected, abs=ROUNDING)
