"""Media: who may talk when, and who hears nothing because it talks itself.

On a half-duplex edge each end has one transceiver for the other. A transceiver that transmits cannot receive: a frame
whose airtime overlaps a transmission of its receiver on that edge is lost.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import Literal

from ..errors import BadInput
from ..units import Hertz, Nanoseconds, period_ns


@dataclass(frozen=True)
class Aloha:
    """Send as soon as the transmitter is free."""

    def earliest_start(self, ready_ns: int, airtime_ns: int, slot: int, slots: int) -> int:
        """At once."""
        return ready_ns


@dataclass(frozen=True)
class Tdma:
    """Slots: each cycle is divided evenly, and an end sends in its own slot only, if the frame fits before the guard.

    Cycle k starts at floor(k·10⁹ / cycle); the end with the lower name has the first of an edge's two slots.
    """

    cycle: Hertz
    guard: Nanoseconds = 0

    def __post_init__(self) -> None:
        """Check the bounds."""
        if not self.cycle > 0:
            raise BadInput(f"tdma cycle is {self.cycle:g} Hz, it must be above 0")
        if self.guard < 0:
            raise BadInput(f"tdma guard is {self.guard} ns, it must be at least 0")

    def usable_ns(self, slots: int) -> int:
        """Longest airtime that surely fits into a slot."""
        return int(1e9 / self.cycle) // slots - 1 - self.guard

    def earliest_start(self, ready_ns: int, airtime_ns: int, slot: int, slots: int) -> int:
        """First instant from `ready_ns` on at which a frame of this airtime fits into the own slot.

        Raises:
            BadInput: the frame fits into no slot.
        """
        if airtime_ns > self.usable_ns(slots):
            raise BadInput(
                f"a frame of {airtime_ns / 1e6:.3f} ms airtime does not fit a tdma slot of "
                f"{self.usable_ns(slots) / 1e6:.3f} ms: send less, or make the cycle longer"
            )
        cycle = int(ready_ns * self.cycle / 1e9)
        while True:
            begin, end = period_ns(self.cycle, cycle), period_ns(self.cycle, cycle + 1)
            first = begin + (end - begin) * slot // slots
            last = begin + (end - begin) * (slot + 1) // slots - self.guard - airtime_ns
            if ready_ns <= last and first <= last:
                return max(ready_ns, first)
            cycle += 1


Access = Aloha | Tdma


@dataclass(frozen=True)
class FullDuplex:
    """Both ends may talk and hear at once; each direction is a channel of its own."""


@dataclass(frozen=True)
class HalfDuplex:
    """One transceiver pair per edge, like the infrared side of a flying-array module."""

    per: Literal["edge"] = "edge"
    access: Access = Aloha()


Medium = FullDuplex | HalfDuplex
EDGE_SLOTS = 2


class Transceiver:
    """When one end of an edge has transmitted; answers whether a frame it was to hear met one of those intervals."""

    __slots__ = ("_begins", "_ends")

    def __init__(self) -> None:
        self._begins: list[int] = []
        self._ends: list[int] = []

    def transmit(self, start_ns: int, end_ns: int) -> None:
        """Note a transmission in [start, end); transmissions of one transceiver come in order and never overlap."""
        self._begins.append(start_ns)
        self._ends.append(end_ns)

    def deaf(self, start_ns: int, end_ns: int) -> bool:
        """Whether [start, end) overlaps a transmission of this transceiver."""
        last = bisect_right(self._begins, end_ns - 1) - 1
        return last >= 0 and self._ends[last] > start_ns
