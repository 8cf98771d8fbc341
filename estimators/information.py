"""Information pairs (P, q): beliefs in information form, in which independent information is added.

Letters: x state of n components, P information matrix (the inverse of a covariance, or singular if not all of x is
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
    """Information matrix P, shape (n, n), and vector q, shape (n,); for a flying array [1, m, m²] and [m, m²].

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
        """The pair with these arrays, without checks and copies; for arrays computed from checked ones."""
        pair = cls.__new__(cls)
        pair.__dict__.update(P=P, q=q)
        return pair


def packed_size(dimension: int) -> int:
    """Length of a packed pair about a state of n components: n (n + 3) / 2."""
    return dimension * (dimension + 3) // 2


def pack_symmetric(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The upper triangle of a symmetric matrix (n, n) by rows, shape (n (n + 1) / 2,)."""
    packed: NDArray[np.float64] = matrix.take(_places(len(matrix))[0])
    return packed


def unpack_symmetric(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of `pack_symmetric`; the matrix (n, n) is exactly symmetric.

    Raises:
        BadInput: the length is not n (n + 1) / 2.
    """
    dimension = (isqrt(8 * len(vector) + 1) - 1) // 2
    if dimension * (dimension + 1) // 2 != len(vector):
        raise BadInput(f"{len(vector)} numbers are the upper triangle of no matrix: it has n (n + 1) / 2")
    matrix: NDArray[np.float64] = vector.take(_places(dimension)[1])
    return matrix


def unpack_covariance(numbers: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
    """The matrix (n, n) of all its numbers by rows, or of those of its upper triangle.

    Raises:
        BadInput: another length.
    """
    whole, triangle = dimension * dimension, dimension * (dimension + 1) // 2
    if len(numbers) == triangle:
        return unpack_symmetric(numbers)
    if len(numbers) != whole:
        raise BadInput(
            f"a covariance has {len(numbers)} numbers: for {dimension} components give all {whole}, "
            f"or the {triangle} of the upper triangle"
        )
    return numbers.reshape(dimension, dimension)


def mirrored(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The symmetric matrix (n, n) with the upper triangle of this one."""
    whole: NDArray[np.float64] = matrix.take(_places(len(matrix))[2])
    return whole


def pack_pair(pair: InformationPair) -> NDArray[np.float64]:
    """The pair as n (n + 3) / 2 numbers: the upper triangle of P by rows, then q."""
    return np.concatenate([pack_symmetric(pair.P), pair.q])


def unpack_pair(vector: ArrayLike) -> InformationPair:
    """Inverse of `pack_pair`; P is exactly symmetric.

    Raises:
        BadInput: a length that no packed pair has, or not finite.
    """
    return unpack_trusted(as_array(vector, (None,), "packed information pair"))


def unpack_trusted(packed: NDArray[np.float64]) -> InformationPair:
    """As `unpack_pair`, without the check for finite numbers; for pairs packed by this package.

    Raises:
        BadInput: a length that no packed pair has.
    """
    dimension = (isqrt(8 * len(packed) + 9) - 3) // 2
    if dimension < 1 or packed_size(dimension) != len(packed):
        raise BadInput(f"packed information pair has {len(packed)} numbers: it has n (n + 3) / 2, as in 5, 9, 14")
    return InformationPair.trusted(unpack_symmetric(packed[:-dimension]), packed[-dimension:])


@cache
def _places(dimension: int) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Index maps of a symmetric matrix (n, n), flattened by rows.

    Upper triangle → matrix, matrix → upper triangle, and matrix → the same entry of the upper half of the matrix.
    """
    rows, columns = np.triu_indices(dimension)
    which = np.empty((dimension, dimension), dtype=np.intp)
    which[rows, columns] = which[columns, rows] = np.arange(len(rows))
    upper = rows * dimension + columns
    return upper, which, upper[which]
