"""An agent's own clock: true time, and what the faults in force do to its reading.

reading(t) = t + Σ (offset + (t − at) · drift // 10⁹) over the clock faults in force, t in nominal nanoseconds.
"""

from __future__ import annotations

from collections.abc import Iterable

from ..errors import BadInput
from .faults import ClockFault

_BILLION = 1_000_000_000


class Clock:
    """A reading between two changes of the clock faults in force; without any it is nominal time itself.

    Raises:
        BadInput: drifts that add up to a clock that stands still or goes back.
    """

    __slots__ = ("_drift_ppb", "_faults", "true")

    def __init__(self, faults: Iterable[ClockFault] = ()) -> None:
        self._faults = tuple((fault.at_ns, fault.offset_ns, fault.drift_ppb) for fault in faults)
        self._drift_ppb = sum(drift for _, _, drift in self._faults)
        self.true = not self._faults
        if self._drift_ppb <= -_BILLION:
            raise BadInput(f"the drifts of one clock add up to {self._drift_ppb} ppb: it would not go forward")

    def reading(self, time_ns: int) -> int:
        """What the clock shows at a nominal instant."""
        if self.true:
            return time_ns
        return time_ns + sum(offset + (time_ns - at) * drift // _BILLION for at, offset, drift in self._faults)

    def first_reading(self, time_ns: int) -> int:
        """The least reading that is not reached before an instant: a fast clock shows several within a nanosecond."""
        return self.reading(time_ns - 1) + 1

    def when(self, reading_ns: int, from_ns: int) -> int:
        """The first nominal instant from `from_ns` on at which the clock shows at least `reading_ns`."""
        if self.true or self.reading(from_ns) >= reading_ns:
            return max(reading_ns, from_ns) if self.true else from_ns
        missing = reading_ns - self.reading(from_ns)
        guess = from_ns + missing * _BILLION // (_BILLION + self._drift_ppb)
        while self.reading(guess) >= reading_ns:
            guess -= 1
        while self.reading(guess) < reading_ns:
            guess += 1
        return guess
