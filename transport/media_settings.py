"""Media as data: who shares a channel with whom, and when a user of it may transmit; `media` decides by them.

A half-duplex medium belongs to an edge, whose ends have a transceiver each for this edge, or to a node, which has one
radio for all its links: every neighbour hears all its transmissions, whatever their target.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from ..errors import BadInput
from ..kinds import Kinds
from ..units import Bounds, Duration, Hertz, Period

_MICROSECOND_NS = 1_000
ACCESS_ATTEMPTS = 16
"""Number of random draws reserved for each frame of `Csma`."""


@dataclass(frozen=True)
class Aloha:
    """Transmit as soon as the transmitter is free."""


@dataclass(frozen=True)
class SlottedAloha:
    """Slotted ALOHA (Roberts 1975): transmit at the start of the next slot; slots of equal length start at time 0.

    slot: length of a slot.
    """

    slot: Period

    def __post_init__(self) -> None:
        """Check the bound."""
        if self.slot < 1:
            raise BadInput(f"slot is {self.slot} ns, it must be above 0")

    def usable_ns(self, slots: int) -> int:
        """Longest airtime that fits into a slot."""
        return self.slot


@dataclass(frozen=True)
class Tdma:
    """Time slots: each cycle is divided evenly; an end transmits only in its slot, if the frame fits before the guard.

    Cycle k starts at floor(k·10⁹ / cycle). An edge has two slots, the first for the end with the lower name. Radios at
    most two hops apart have different slots, by a colouring of the graph at distance 2.

    cycle: rate of the cycles.
    guard: time at the end of each slot in which no frame may be on the air.
    """

    cycle: Hertz
    guard: Duration = 0

    def __post_init__(self) -> None:
        """Check the bounds."""
        if not self.cycle > 0:
            raise BadInput(f"tdma cycle is {self.cycle:g} Hz, it must be above 0")
        if self.guard < 0:
            raise BadInput(f"tdma guard is {self.guard} ns, it must be at least 0")

    def usable_ns(self, slots: int) -> int:
        """Longest airtime that fits into every slot."""
        return int(1e9 / self.cycle) // slots - 1 - self.guard


@dataclass(frozen=True)
class Csma:
    """Parameters of carrier sense, by default those of the standard with the 16 µs symbols of the 2450 MHz band.

    min_be: macMinBE, smallest backoff exponent.
    max_be: macMaxBE, largest backoff exponent.
    max_backoffs: macMaxCSMABackoffs, attempts after the first.
    period: aUnitBackoffPeriod, 20 symbols by default.
    cca: duration of the clear channel assessment, 8 symbols by default.
    turnaround: aTurnaroundTime, 12 symbols by default.
    """

    min_be: Annotated[int, Bounds(0, 30)] = 3
    max_be: Annotated[int, Bounds(0, 30)] = 5
    max_backoffs: Annotated[int, Bounds(0, ACCESS_ATTEMPTS - 1)] = 4
    period: Period = 320 * _MICROSECOND_NS
    cca: Period = 128 * _MICROSECOND_NS
    turnaround: Period = 192 * _MICROSECOND_NS

    def __post_init__(self) -> None:
        """Check the bounds."""
        if not 0 <= self.min_be <= self.max_be <= 30:
            raise BadInput(f"min_be is {self.min_be} and max_be {self.max_be}: write 0 ≤ min_be ≤ max_be ≤ 30")
        if not 0 <= self.max_backoffs < ACCESS_ATTEMPTS:
            raise BadInput(f"max_backoffs is {self.max_backoffs}, it is at least 0 and below {ACCESS_ATTEMPTS}")
        if self.period < 1 or self.cca < 1 or self.turnaround < 1:
            raise BadInput("period, cca and turnaround are above 0")


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
