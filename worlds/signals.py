"""Signals of time: constant, stepped, ramped, sinusoidal. Times are nanoseconds since the epoch of the run."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated, Protocol

from ..errors import BadInput
from ..kinds import Kinds
from ..units import OWNERS, Duration, Hertz, Period, Radians, Unit

OwnersUnit = Annotated[float, OWNERS]


class Signal(Protocol):
    """A quantity as a function of time; the owner knows its unit."""

    def value(self, time_ns: int) -> float:
        """The value at an instant."""

    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value."""


@dataclass(frozen=True)
class Constant:
    """A constant value.

    level: the value.
    """

    level: OwnersUnit

    def value(self, time_ns: int) -> float:
        """The level."""
        return self.level

    def bounds(self) -> tuple[float, float]:
        """The level, twice."""
        return self.level, self.level


@dataclass(frozen=True)
class Steps:
    """The n-th level from the n-th time on, until the next time; times ascend from 0.

    Raises:
        BadInput: times that do not begin at 0, do not ascend, or are not as many as the levels.
    """

    times_ns: tuple[int, ...]
    levels: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the times."""
        times = self.times_ns
        if len(times) != len(self.levels):
            raise BadInput(f"{len(times)} times and {len(self.levels)} levels: give one level for each time")
        if not times or times[0] != 0 or any(late <= early for early, late in pairwise(times)):
            raise BadInput(f"steps at {list(times)} ns must begin at 0 and ascend")

    def value(self, time_ns: int) -> float:
        """The level of the last step that is not after `time_ns`; the first one before 0."""
        return self.levels[max(bisect_right(self.times_ns, time_ns) - 1, 0)]

    def bounds(self) -> tuple[float, float]:
        """The lowest and the highest level."""
        return min(self.levels), max(self.levels)


@dataclass(frozen=True)
class Ramp:
    """Linear from the first level to the last within `over_ns`, constant before and after.

    from: the first level.
    to: the last level.
    at: start.
    over: duration.

    Raises:
        BadInput: it begins before 0, or lasts no time.
    """

    first: OwnersUnit = field(metadata={"name": "from"})
    last: OwnersUnit = field(metadata={"name": "to"})
    at_ns: Duration
    over_ns: Period

    def __post_init__(self) -> None:
        """Check the times."""
        if self.at_ns < 0:
            raise BadInput(f"a ramp at {self.at_ns} ns must begin at 0 or later")
        if self.over_ns < 1:
            raise BadInput(f"a ramp over {self.over_ns} ns must last for some time: for a jump write steps")

    def value(self, time_ns: int) -> float:
        """The level on the line, or at the end that is nearer."""
        share = min(max((time_ns - self.at_ns) / self.over_ns, 0.0), 1.0)
        return self.first + share * (self.last - self.first)

    def bounds(self) -> tuple[float, float]:
        """The lower and the higher level."""
        return min(self.first, self.last), max(self.first, self.last)


@dataclass(frozen=True)
class Sine:
    """mean + amplitude · sin(2π · frequency · t + phase); frequency in Hz, phase in rad.

    amplitude: of the sine.
    frequency: periods per second.
    mean: value about which it oscillates.
    phase: at time 0.

    Raises:
        BadInput: frequency not above 0.
    """

    amplitude: OwnersUnit
    frequency: Hertz
    mean: OwnersUnit = 0.0
    phase: Radians = 0.0

    def __post_init__(self) -> None:
        """Check the frequency."""
        if self.frequency <= 0.0:
            raise BadInput(f"frequency {self.frequency} Hz must be above 0: for no change write the value alone")

    def value(self, time_ns: int) -> float:
        """The value at an instant."""
        return self.mean + self.amplitude * math.sin(math.tau * self.frequency * (time_ns * 1e-9) + self.phase)

    def bounds(self) -> tuple[float, float]:
        """Mean less and plus amplitude."""
        return self.mean - abs(self.amplitude), self.mean + abs(self.amplitude)


SIGNALS = Kinds("signal", {"constant": Constant, "steps": Steps, "ramp": Ramp, "sine": Sine}, scalar="constant")
Lengths = Annotated[Signal, SIGNALS, Unit("m")]
Angles = Annotated[Signal, SIGNALS, Unit("rad")]
Torques = Annotated[Signal, SIGNALS, Unit("N m")]
