"""Indices of samples as messages carry them: modulo 2¹⁶."""

from __future__ import annotations

COUNTS = 2**16


def age(count: int, tag: int) -> int:
    """Number of samples by which the tag of a message is behind a count, negative if it is ahead.

    Both are taken modulo COUNTS, so the result is the one of smallest magnitude, from −COUNTS/2 to COUNTS/2 − 1.
    """
    return (count - tag + COUNTS // 2) % COUNTS - COUNTS // 2
