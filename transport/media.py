"""Media: medium access, half-duplex and collisions.

A half-duplex medium belongs to an edge, whose ends have a transceiver each for this edge, or to a node, which has one
radio for all its links: every neighbour hears all its transmissions, whatever their target. A transceiver cannot
receive while it transmits: a frame whose airtime overlaps a transmission of its receiver is lost. Frames of two
neighbours whose airtimes overlap at a node collide, and both are lost there.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Literal

from ..errors import BadInput
from ..kinds import Kinds
from ..units import Hertz, Nanoseconds, period_ns
from .csma import Csma


@dataclass(frozen=True)
class Aloha:
    """Transmit as soon as the transmitter is free."""

    def earliest_start(self, ready_ns: int, airtime_ns: int, slot: int, slots: int) -> int:
        """Start at once."""
        return ready_ns


@dataclass(frozen=True)
class SlottedAloha:
    """Slotted ALOHA (Roberts 1975): transmit at the start of the next slot; slots of equal length start at time 0.

    slot: length of a slot.
    """

    slot: Nanoseconds

    def __post_init__(self) -> None:
        """Check the bound."""
        if self.slot < 1:
            raise BadInput(f"slot is {self.slot} ns, it must be above 0")

    def usable_ns(self, slots: int) -> int:
        """Longest airtime that fits into a slot."""
        return self.slot

    def earliest_start(self, ready_ns: int, airtime_ns: int, slot: int, slots: int) -> int:
        """Start of the first slot from `ready_ns` on.

        Raises:
            BadInput: the frame is longer than a slot.
        """
        if airtime_ns > self.slot:
            raise BadInput(
                f"a frame of {airtime_ns / 1e6:.3f} ms airtime does not fit a slot of {self.slot / 1e6:.3f} ms: "
                "send less, or make the slot longer"
            )
        return -(-ready_ns // self.slot) * self.slot


@dataclass(frozen=True)
class Tdma:
    """Time slots: each cycle is divided evenly; an end transmits only in its slot, if the frame fits before the guard.

    Cycle k starts at floor(k·10⁹ / cycle). An edge has two slots, the first for the end with the lower name. Radios at
    most two hops apart have different slots, by a colouring of the graph at distance 2.

    cycle: rate of the cycles.
    guard: time at the end of each slot in which no frame may be on the air.
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
        """Longest airtime that fits into every slot."""
        return int(1e9 / self.cycle) // slots - 1 - self.guard

    def earliest_start(self, ready_ns: int, airtime_ns: int, slot: int, slots: int) -> int:
        """First instant from `ready_ns` on at which a frame of this airtime fits into the own slot.

        Raises:
            BadInput: the frame is longer than a slot.
        """
        if airtime_ns > self.usable_ns(slots):
            raise BadInput(
                f"a frame of {airtime_ns / 1e6:.3f} ms airtime does not fit a tdma slot of "
                f"{self.usable_ns(slots) / 1e6:.3f} ms: send less, or make the cycle longer"
            )
        current = int(ready_ns * self.cycle / 1e9)
        for cycle in range(current, current + 3):  # the own slot may be over, and `current` one too low by rounding
            begin, end = _cycle_bounds(self.cycle, cycle)
            first = begin + (end - begin) * slot // slots
            last = begin + (end - begin) * (slot + 1) // slots - self.guard - airtime_ns
            if ready_ns <= last and first <= last:
                return max(ready_ns, first)
        raise AssertionError(f"slot {slot} of {slots} is too short for {airtime_ns} ns ready at {ready_ns} ns")


@lru_cache(maxsize=256)
def _cycle_bounds(cycle_hz: float, cycle: int) -> tuple[int, int]:
    """Start and end of a cycle; cached, as successive frames and neighbours need the same ones."""
    return period_ns(cycle_hz, cycle), period_ns(cycle_hz, cycle + 1)


Access = Aloha | SlottedAloha | Tdma | Csma
ACCESSES = Kinds("medium access", {"aloha": Aloha, "slotted-aloha": SlottedAloha, "tdma": Tdma, "csma": Csma})


@dataclass(frozen=True)
class FullDuplex:
    """Both ends may transmit and receive at once; each direction is a separate channel."""


@dataclass(frozen=True)
class HalfDuplex:
    """One pair of transceivers per edge, as in the infrared sides of a flying-array module, or one radio per node.

    per: whether each edge has a medium, or each node a radio.
    access: medium access, which determines when an end may transmit.
    """

    per: Literal["edge", "node"] = "edge"
    access: Annotated[Access, ACCESSES] = Aloha()

    def __post_init__(self) -> None:
        """Refuse carrier sense on edges."""
        if self.per == "edge" and isinstance(self.access, Csma):
            raise BadInput("csma listens for all that a radio hears: write per: node, or take aloha or tdma on edges")


Medium = FullDuplex | HalfDuplex
MEDIA = Kinds("medium", {"full-duplex": FullDuplex, "half-duplex": HalfDuplex}, tag="kind")
EDGE_SLOTS = 2
AIR = "*"
"""Name of the outlet that all links of a node's radio share; not a valid name of an agent."""


def on_air(medium: Medium) -> bool:
    """Whether a link uses the radio of its source."""
    return isinstance(medium, HalfDuplex) and medium.per == "node"


class Transceiver:
    """Transmissions of one end of an edge, to decide whether it could receive a frame."""

    __slots__ = ("_begins", "_ends")

    def __init__(self) -> None:
        self._begins: list[int] = []
        self._ends: list[int] = []

    def transmit(self, start_ns: int, end_ns: int) -> None:
        """Record a transmission in [start, end); those of one transceiver are in order and never overlap."""
        self._begins.append(start_ns)
        self._ends.append(end_ns)

    def deaf(self, start_ns: int, end_ns: int) -> bool:
        """Whether [start, end) overlaps a transmission of this transceiver."""
        last = bisect_right(self._begins, end_ns - 1) - 1
        return last >= 0 and self._ends[last] > start_ns

    def forget(self, before_ns: int) -> None:
        """Forget transmissions that had ended by an instant; frames that start later do not overlap them."""
        ended = bisect_right(self._ends, before_ns)
        del self._begins[:ended], self._ends[:ended]

    def __len__(self) -> int:
        """Number of transmissions kept."""
        return len(self._begins)


class Ether:
    """Transmissions that a node's radio can hear, to decide whether a frame collided or the channel is busy."""

    __slots__ = ("_heard", "_longest")

    def __init__(self) -> None:
        self._heard: list[tuple[int, int, str]] = []
        self._longest = 0

    def hear(self, start_ns: int, end_ns: int, source: str) -> None:
        """Record a transmission in [start, end)."""
        insort(self._heard, (start_ns, end_ns, source))
        self._longest = max(self._longest, end_ns - start_ns)

    def busy(self, start_ns: int, end_ns: int) -> bool:
        """Whether any transmission was on the air in [start, end)."""
        return self.collided(start_ns, end_ns, "")

    def collided(self, start_ns: int, end_ns: int, source: str) -> bool:
        """Whether [start, end) overlaps a transmission of another source."""
        first = bisect_left(self._heard, (start_ns - self._longest, 0, ""))
        last = bisect_left(self._heard, (end_ns, 0, ""))
        return any(end > start_ns and other != source for _, end, other in self._heard[first:last])

    def forget(self, before_ns: int) -> None:
        """Forget transmissions that had ended by an instant; frames that start later do not overlap them."""
        self._heard = [interval for interval in self._heard if interval[1] > before_ns]

    def __len__(self) -> int:
        """Number of transmissions kept."""
        return len(self._heard)
