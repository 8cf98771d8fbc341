"""Checks that several generators share."""

from __future__ import annotations

import math

from ..errors import BadInput


def at_least(value: int, bound: int, what: str) -> int:
    """Return the value if it reaches the bound.

    Raises:
        BadInput: it does not.
    """
    if value < bound:
        raise BadInput(f"{what} is {value}, it must be at least {bound}")
    return value


def positive(value: float, what: str) -> float:
    """Return the length in metres if it is finite and above zero.

    Raises:
        BadInput: it is not.
    """
    if not 0 < value < math.inf:
        raise BadInput(f"{what} is {value:g} m, it must be above 0 and finite")
    return value
