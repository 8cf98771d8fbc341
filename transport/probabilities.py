"""Checks of arguments of loss and latency models."""

from __future__ import annotations

from ..errors import BadInput


def check_probability(name: str, value: float) -> None:
    """Refuse a number that is not a probability.

    Raises:
        BadInput: below 0, above 1, or not a number.
    """
    if not 0.0 <= value <= 1.0:
        raise BadInput(f"{name} is {value:g}, a probability lies between 0 and 1")
