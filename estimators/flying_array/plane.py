"""The plane under a rigid body: linear map from state to distances, and the exact inverse of the nonlinear model.

Letters: x = (z, γ, β) altitude [m], roll and pitch [rad]; (r_X, r_Y) position of a module on the body [m].
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import as_array


def design_row(position: ArrayLike) -> NDArray[np.float64]:
    """The row c = (1, r_Y, −r_X) that maps the state to the distance at one module, linearised about hover.

    m = c x = z + r_Y γ − r_X β            Kriegleder 2012, (7)-(8)

    Args:
        position: (r_X, r_Y), shape (2,) [m].
    Returns:
        c, shape (3,) [1, m, m].
    Raises:
        BadInput: wrong shape or not finite.
    """
    x, y = as_array(position, (2,), "position")
    return np.array([1.0, y, -x])


def design_matrix(positions: ArrayLike) -> NDArray[np.float64]:
    """The rows of all modules: C x are their distances, linearised about hover.

    Kriegleder 2012, (11)

    Args:
        positions: one row (r_X, r_Y) per module, shape (N, 2) [m].
    Returns:
        C, shape (N, 3) [1, m, m].
    Raises:
        BadInput: wrong shape or not finite.
    """
    places = as_array(positions, (None, 2), "positions")
    return np.column_stack([np.ones(len(places)), places[:, 1], -places[:, 0]])


def exact_state(plane: ArrayLike) -> NDArray[np.float64]:
    """The state of the nonlinear model for a fitted plane, at any tilt below 90°.

    m = a + r_Y b − r_X c;  γ = atan b,  β = atan(c cos γ),  z = a cos β cos γ      inverse of Kriegleder 2012, (6)
    Linear least squares, centralised or by consensus, gives the coefficients (a, b, c). The linearised estimate takes
    them as (z, γ, β); this function inverts the nonlinear model instead.

    Args:
        plane: (a, b, c), shape (3,) [m, 1, 1].
    Returns:
        (z, γ, β), shape (3,) [m, rad, rad].
    Raises:
        BadInput: wrong shape or not finite.
    """
    a, b, c = as_array(plane, (3,), "plane")
    roll = math.atan(b)
    pitch = math.atan(c * math.cos(roll))
    return np.array([a * math.cos(pitch) * math.cos(roll), roll, pitch])
