"""Media: who may talk when, who hears nothing because it talks itself, and which frames destroy each other.

A half-duplex medium is that of an edge, whose ends have one transceiver each for the other, or that of a node, which
has one radio for all its links: every neighbour hears all that it transmits, whomever it is for. A transceiver that
transmits cannot receive: a frame whose airtime overlaps a transmission of its receiver is lost. Frames of two
neighbours that overlap at a node destroy each other there.
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
    """Send as soon as the transmitter is free."""

    def earliest_start(self, ready_ns: int, airtime_ns: int, slot: int, slots: int) -> int:
        """At once."""
        return ready_ns


@dataclass(frozen=True)
class SlottedAloha:
    """Send at the beginning of the next slot; slots of one length, a whole number of them since time 0.

    slot: its length.

    Roberts 1975: slotted ALOHA.
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
        """The first beginning of a slot from `ready_ns` on.

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
    """Slots: each cycle is divided evenly, and an end sends in its own slot only, if the frame fits before the guard.

    Cycle k starts at floor(k·10⁹ / cycle). An edge has two slots, the first for the end with the lower name; of radios,
    two that can be heard at one place have different slots: a colouring of the graph at distance 2.

    cycle: how often all slots come round.
    guard: at the end of each slot, in which no frame may be on the air.
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
    """Begin and end of a cycle; neighbours in time and place ask for the same ones again and again."""
    return period_ns(cycle_hz, cycle), period_ns(cycle_hz, cycle + 1)


Access = Aloha | SlottedAloha | Tdma | Csma
ACCESSES = Kinds("medium access", {"aloha": Aloha, "slotted-aloha": SlottedAloha, "tdma": Tdma, "csma": Csma})


@dataclass(frozen=True)
class FullDuplex:
    """Both ends may talk and hear at once; each direction is a channel of its own."""


@dataclass(frozen=True)
class HalfDuplex:
    """One transceiver pair per edge, like the infrared side of a flying-array module, or one radio per node.

    per: whether each edge has a medium of its own, or each node a radio.
    access: when an end may send.
    """

    per: Literal["edge", "node"] = "edge"
    access: Annotated[Access, ACCESSES] = Aloha()

    def __post_init__(self) -> None:
        """Carrier sense is for radios."""
        if self.per == "edge" and isinstance(self.access, Csma):
            raise BadInput("csma listens for all that a radio hears: write per: node, or take aloha or tdma on edges")


Medium = FullDuplex | HalfDuplex
MEDIA = Kinds("medium", {"full-duplex": FullDuplex, "half-duplex": HalfDuplex}, tag="kind")
EDGE_SLOTS = 2
AIR = "*"
"""Name of the outlet that all links of a node's radio share; no agent is called so."""


def on_air(medium: Medium) -> bool:
    """Whether a link goes over the radio of its source."""
    return isinstance(medium, HalfDuplex) and medium.per == "node"


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

    def forget(self, before_ns: int) -> None:
        """Forget what had ended by an instant: no frame that starts then or later meets it."""
        ended = bisect_right(self._ends, before_ns)
        del self._begins[:ended], self._ends[:ended]

    def __len__(self) -> int:
        """How many transmissions it remembers."""
        return len(self._begins)


class Ether:
    """What a node's radio has heard on the air; answers whether a frame met a transmission of somebody else."""

    __slots__ = ("_heard", "_longest")

    def __init__(self) -> None:
        self._heard: list[tuple[int, int, str]] = []
        self._longest = 0

    def hear(self, start_ns: int, end_ns: int, source: str) -> None:
        """Note a transmission in [start, end)."""
        insort(self._heard, (start_ns, end_ns, source))
        self._longest = max(self._longest, end_ns - start_ns)

    def busy(self, start_ns: int, end_ns: int) -> bool:
        """Whether anybody was heard in [start, end)."""
        return self.collided(start_ns, end_ns, "")

    def collided(self, start_ns: int, end_ns: int, source: str) -> bool:
        """Whether [start, end) overlaps a transmission of another source."""
        first = bisect_left(self._heard, (start_ns - self._longest, 0, ""))
        last = bisect_left(self._heard, (end_ns, 0, ""))
        return any(end > start_ns and other != source for _, end, other in self._heard[first:last])

    def forget(self, before_ns: int) -> None:
        """Forget what had ended by an instant: no frame that starts then or later meets it."""
        self._heard = [interval for interval in self._heard if interval[1] > before_ns]

    def __len__(self) -> int:
        """How many transmissions it remembers."""
        return len(self._heard)
