"""Recorded values as piecewise constant functions of time."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from typing import Generic, TypeVar

from ..errors import BadInput

V = TypeVar("V", int, float)


def first_disorder(times_ns: tuple[int, ...]) -> int | None:
    """Index of the first time that is not later than the one before it; None if times ascend."""
    return next((index for index, (before, after) in enumerate(pairwise(times_ns), 1) if after <= before), None)


@dataclass(frozen=True, slots=True)
class Steps(Generic[V]):
    """A piecewise constant function of time; the last value is valid for ever, or all repeat after `repeat_ns`."""

    times_ns: tuple[int, ...]
    values: tuple[V, ...]
    repeat_ns: int | None = None

    def check(self, what: str) -> None:
        """Refuse incomplete or unordered values.

        Raises:
            BadInput: no values, not one per time, a first time that is not 0, times that do not ascend, or a repetition
                before the last time.
        """
        times = self.times_ns
        if len(times) != len(self.values) or not times:
            raise BadInput(f"a trace of {len(times)} times and {len(self.values)} {what}: give one for each time")
        if times[0] != 0:
            raise BadInput(f"a trace starts at 0, and this one at {times[0] / 1e9:g} s: say what holds before")
        if (index := first_disorder(times)) is not None:
            before, after = times[index - 1] / 1e9, times[index] / 1e9
            raise BadInput(f"time {index + 1} of the trace is {after:g} s after {before:g} s: put them in order")
        if self.repeat_ns is not None and self.repeat_ns <= times[-1]:
            raise BadInput(
                f"repeat is {self.repeat_ns / 1e9:g} s and the trace's last time {times[-1] / 1e9:g} s: repeat later"
            )

    def at(self, time_ns: int) -> V:
        """The value at an instant from 0 on."""
        if self.repeat_ns is not None:
            time_ns %= self.repeat_ns
        return self.values[bisect_right(self.times_ns, time_ns) - 1]

    @property
    def mean(self) -> float:
        """Long-run mean over time."""
        if self.repeat_ns is None:
            return float(self.values[-1])
        lasting = (after - before for before, after in pairwise((*self.times_ns, self.repeat_ns)))
        return sum(value * span for value, span in zip(self.values, lasting, strict=True)) / self.repeat_ns
