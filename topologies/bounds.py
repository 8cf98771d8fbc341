"""Checks that several generators share."""

from __future__ import annotations

from ..errors import BadInput


def at_least(value: int, bound: int, what: str) -> int:
    """Return the value if it reaches the bound.

    Raises:
        BadInput: it does not.
    """
    if value < bound:
        raise BadInput(f"{what} is {value}, it must be at least {bound}")
    return value
