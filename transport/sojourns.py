"""Exponential sojourn times in nominal time, for channel states that change independently of frames."""

from __future__ import annotations

import math

from ..randomness import Stream


class Sojourns:
    """Successive sojourns of exponential lengths from nominal time 0 on, numbered from 0.

    The n-th length follows from the n-th draw and the n-th mean, which are used cyclically. The number at an instant
    does not depend on earlier queries; queries in ascending order are fast.
    """

    __slots__ = ("_draws", "_means", "_number", "_since", "_until")

    def __init__(self, draws: Stream, *means_ns: float) -> None:
        self._draws = draws
        self._means = means_ns
        self._rewind()

    def _rewind(self) -> None:
        self._number = 0
        self._since = 0
        self._until = self._length(0)

    def _length(self, number: int) -> int:
        return math.ceil(-self._means[number % len(self._means)] * math.log(self._draws.uniform(number)))

    def number(self, time_ns: int) -> int:
        """Number of the sojourn at an instant."""
        if time_ns < self._since:
            self._rewind()
        while time_ns >= self._until:
            self._number += 1
            self._since = self._until
            self._until += self._length(self._number)
        return self._number
