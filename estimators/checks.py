"""Checks of arguments: arrays and names of neighbours."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import BadInput


def as_array(values: ArrayLike, shape: tuple[int | None, ...], name: str) -> NDArray[np.float64]:
    """The values as a fresh, finite, C-contiguous float64 array of this shape; None stands for any length.

    Raises:
        BadInput: another shape, or a value that is not finite; the message gives `name`.
    """
    array = np.array(values, dtype=np.float64, order="C")
    if array.shape != shape and not _fits(array.shape, shape):
        wanted = ", ".join("any" if want is None else str(want) for want in shape)
        raise BadInput(f"{name} has shape {array.shape}: give ({wanted})")
    flat = array.ravel()
    if not math.isfinite(flat.dot(flat)) and not np.isfinite(array).all():  # the first is faster, and may overflow
        raise BadInput(f"{name} holds a value that is not finite: {array.tolist()}")
    return array


def _fits(shape: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    return len(shape) == len(wanted) and all(want in (None, size) for want, size in zip(wanted, shape, strict=True))


def check_neighbour(name: str, neighbours: Collection[str]) -> None:
    """Refuse a name that is not among the neighbours.

    Raises:
        BadInput: with the name and the neighbours.
    """
    if name not in neighbours:
        raise BadInput(f"{name!r} is not a neighbour: the neighbours are {', '.join(neighbours) or 'none'}")
