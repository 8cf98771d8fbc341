"""Rotations of many bodies, a column each, are those of `rotations` and of `rotation_stacks`."""

from __future__ import annotations

import numpy as np

from volery import rotation_columns as columns
from volery import rotation_stacks as stacks
from volery import rotations
from volery.randomness import stream

DRAWS = stream(3, "columns")
VECTORS = np.array([DRAWS.normal(index) for index in range(60)]).reshape(20, 3)
TURNS = stacks.exp_quaternions(VECTORS)


def test_columns_are_rows_turned() -> None:
    """Products, inverses and exponentials, to rounding."""
    others = TURNS[::-1]
    np.testing.assert_allclose(columns.exponentials(VECTORS.T), TURNS.T, atol=1e-15)
    np.testing.assert_allclose(
        columns.products(TURNS.T, others.T), stacks.quaternion_products(TURNS, others).T, atol=1e-15
    )
    np.testing.assert_array_equal(columns.conjugates(TURNS.T), stacks.conjugates(TURNS).T)


def test_matrices_and_vectors_are_those_of_one_rotation() -> None:
    """R(q) and Rᵀ v, against the scalar functions."""
    matrices = columns.matrices(TURNS.T)
    turned = columns.turned_back(matrices, VECTORS[::-1].T)
    for number, (q, v) in enumerate(zip(TURNS, VECTORS[::-1], strict=True)):
        np.testing.assert_allclose(matrices[:, :, number], rotations.to_matrix(q), atol=1e-15)
        np.testing.assert_allclose(turned[:, number], rotations.rotate(rotations.conjugate(q), v), atol=1e-14)


def test_no_rotation_is_no_division_by_zero() -> None:
    """The exponential of nothing is the identity."""
    np.testing.assert_array_equal(columns.exponentials(np.zeros((3, 2))), [[1.0, 1.0], *[[0.0, 0.0]] * 3])
