"""Information pairs (P, q): what is known of a state, in the form in which independent knowledge adds up.

Letters: x state of n components, P information matrix (the inverse of a covariance, or singular where not all of x is
known), q = P x̂ information vector.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import isqrt
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import BadInput
from .checks import as_array


@dataclass(frozen=True, eq=False)
class InformationPair:
    """Information matrix P, shape (n, n), and vector q, shape (n,); of a flying array [1, m, m²] and [m, m²].

    Raises:
        BadInput: shapes that do not fit, or not finite.
    """

    P: NDArray[np.float64]
    q: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Check shapes and make both float64."""
        object.__setattr__(self, "q", as_array(self.q, (None,), "q"))
        object.__setattr__(self, "P", as_array(self.P, (len(self.q), len(self.q)), "P"))

    @classmethod
    def trusted(cls, P: NDArray[np.float64], q: NDArray[np.float64]) -> Self:
        """The pair of arrays that this package has made of checked ones, unchecked and not copied."""
        pair = cls.__new__(cls)
        pair.__dict__.update(P=P, q=q)
        return pair


def packed_size(dimension: int) -> int:
    """Numbers of a packed pair about a state of so many components: n (n + 3) / 2."""
    return dimension * (dimension + 3) // 2


def pack_symmetric(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The upper triangle of a symmetric matrix (n, n) by rows, shape (n (n + 1) / 2,)."""
    packed: NDArray[np.float64] = matrix.take(_places(len(matrix))[0])
    return packed


def unpack_symmetric(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """The matrix (n, n) that `pack_symmetric` packed, exactly symmetric.

    Raises:
        BadInput: a length that no such matrix has.
    """
    dimension = (isqrt(8 * len(vector) + 1) - 1) // 2
    if dimension * (dimension + 1) // 2 != len(vector):
        raise BadInput(f"{len(vector)} numbers are the upper triangle of no matrix: it has n (n + 1) / 2")
    matrix: NDArray[np.float64] = vector.take(_places(dimension)[1])
    return matrix


def mirrored(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The symmetric matrix (n, n) that has this upper triangle, whatever stands below it."""
    whole: NDArray[np.float64] = matrix.take(_places(len(matrix))[2])
    return whole


def pack_pair(pair: InformationPair) -> NDArray[np.float64]:
    """The pair as n (n + 3) / 2 numbers: the upper triangle of P by rows, then q."""
    return np.concatenate([pack_symmetric(pair.P), pair.q])


def unpack_pair(vector: ArrayLike) -> InformationPair:
    """The pair that `pack_pair` packed; P comes out exactly symmetric.

    Raises:
        BadInput: a length that no packed pair has, or not finite.
    """
    return unpack_trusted(as_array(vector, (None,), "packed information pair"))


def unpack_trusted(packed: NDArray[np.float64]) -> InformationPair:
    """As `unpack_pair`, of what this package has made itself: whether it is finite is not looked at.

    Raises:
        BadInput: a length that no packed pair has.
    """
    dimension = (isqrt(8 * len(packed) + 9) - 3) // 2
    if dimension < 1 or packed_size(dimension) != len(packed):
        raise BadInput(f"packed information pair has {len(packed)} numbers: it has n (n + 3) / 2, as in 5, 9, 14")
    return InformationPair.trusted(unpack_symmetric(packed[:-dimension]), packed[-dimension:])


@cache
def _places(dimension: int) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Where in a matrix, row after row, its upper triangle stands; for each entry which of these it is, and where."""
    rows, columns = np.triu_indices(dimension)
    which = np.empty((dimension, dimension), dtype=np.intp)
    which[rows, columns] = which[columns, rows] = np.arange(len(rows))
    upper = rows * dimension + columns
    return upper, which, upper[which]
