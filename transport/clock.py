"""An agent's local clock: its reading as a function of nominal time and of the active clock faults.

reading(t) = t + Σ offset + (Σ (t − at) · drift) // 10⁹ over the active clock faults, t in nominal nanoseconds. It is
rounded once, so that it never goes back as long as Σ drift > −10⁹ ppb.
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

    __slots__ = ("_drift_ppb", "_offset_ns", "_origin", "true")

    def __init__(self, faults: Iterable[ClockFault] = ()) -> None:
        active = tuple(faults)
        self._offset_ns = sum(fault.offset_ns for fault in active)
        self._drift_ppb = sum(fault.drift_ppb for fault in active)
        self._origin = sum(fault.at_ns * fault.drift_ppb for fault in active)
        self.true = not active
        if self._drift_ppb <= -_BILLION:
            raise BadInput(f"the drifts of one clock add up to {self._drift_ppb} ppb: it would not go forward")

    def reading(self, time_ns: int) -> int:
        """Reading of the clock at a nominal instant."""
        if self.true:
            return time_ns
        return time_ns + self._offset_ns + (time_ns * self._drift_ppb - self._origin) // _BILLION

    def first_reading(self, time_ns: int) -> int:
        """The smallest reading that is not reached before an instant; a fast clock has several within a nanosecond."""
        return self.reading(time_ns - 1) + 1

    def when(self, reading_ns: int, from_ns: int) -> int:
        """The first nominal instant from `from_ns` on at which the reading is at least `reading_ns`.

        reading(t) ≥ r  ⇔  t · (10⁹ + Σ drift) ≥ (r − Σ offset) · 10⁹ + Σ at · drift, and t is a whole number.
        """
        if self.true:
            return max(reading_ns, from_ns)
        needed = (reading_ns - self._offset_ns) * _BILLION + self._origin
        return max(from_ns, -(-needed // (_BILLION + self._drift_ppb)))
