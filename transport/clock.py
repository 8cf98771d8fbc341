"""An agent's local clock: its reading as a function of nominal time and of the active clock faults.

reading(t) = t + Σ (offset + (t − at) · drift // 10⁹) over the active clock faults, t in nominal nanoseconds.
"""

from __future__ import annotations

from collections.abc import Iterable

from ..errors import BadInput
from .faults import ClockFault

_BILLION = 1_000_000_000


class Clock:
    """A clock between two changes of the active clock faults; without faults it shows nominal time.

    Raises:
        BadInput: the sum of the drifts makes the clock stand still or run backwards.
    """

    __slots__ = ("_drift_ppb", "_faults", "true")

    def __init__(self, faults: Iterable[ClockFault] = ()) -> None:
        self._faults = tuple((fault.at_ns, fault.offset_ns, fault.drift_ppb) for fault in faults)
        self._drift_ppb = sum(drift for _, _, drift in self._faults)
        self.true = not self._faults
        if self._drift_ppb <= -_BILLION:
            raise BadInput(f"the drifts of one clock add up to {self._drift_ppb} ppb: it would not go forward")

    def reading(self, time_ns: int) -> int:
        """Reading of the clock at a nominal instant."""
        if self.true:
            return time_ns
        return time_ns + sum(offset + (time_ns - at) * drift // _BILLION for at, offset, drift in self._faults)

    def first_reading(self, time_ns: int) -> int:
        """The smallest reading that is not reached before an instant; a fast clock has several within a nanosecond."""
        return self.reading(time_ns - 1) + 1

    def when(self, reading_ns: int, from_ns: int) -> int:
        """The first nominal instant from `from_ns` on at which the reading is at least `reading_ns`."""
        if self.true or self.reading(from_ns) >= reading_ns:
            return max(reading_ns, from_ns) if self.true else from_ns
        missing = reading_ns - self.reading(from_ns)
        guess = from_ns + missing * _BILLION // (_BILLION + self._drift_ppb)
        while self.reading(guess) >= reading_ns:
            guess -= 1
        while self.reading(guess) < reading_ns:
            guess += 1
        return guess
