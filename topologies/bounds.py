"""Checks of arguments for several generators."""

from __future__ import annotations

from ..errors import BadInput


def at_least(value: int, bound: int, what: str) -> int:
    """Return the value if it is at least the bound.

    Raises:
        BadInput: the value is below the bound.
    """
    if value < bound:
        raise BadInput(f"{what} is {value}, it must be at least {bound}")
    return value
