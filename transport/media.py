"""Media at work: medium access, half-duplex and collisions.

A transceiver cannot receive while it transmits: a frame whose airtime overlaps a transmission of its receiver is lost.
Frames of two neighbours whose airtimes overlap at a node collide, and both are lost there.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from functools import lru_cache

from ..errors import BadInput
from ..units import period_ns
from .media_settings import Access, Aloha, SlottedAloha, Tdma


def earliest_start(access: Access, ready_ns: int, airtime_ns: int, slot: int, slots: int) -> int:
    """First instant from `ready_ns` on at which a frame of this airtime may start.

    Aloha: at once. Slotted Aloha: at the start of a slot. Tdma: where it fits into the own slot. Csma: as without
    backoff.

    Raises:
        BadInput: the frame is longer than a slot.
    """
    if isinstance(access, Aloha):
        return ready_ns
    if isinstance(access, Tdma):
        return _in_own_slot(access, ready_ns, airtime_ns, slot, slots)
    if isinstance(access, SlottedAloha):
        if airtime_ns > access.slot:
            raise BadInput(
                f"a frame of {airtime_ns / 1e6:.3f} ms airtime does not fit a slot of {access.slot / 1e6:.3f} ms: "
                "send less, or make the slot longer"
            )
        return -(-ready_ns // access.slot) * access.slot
    return ready_ns + access.cca + access.turnaround


def _in_own_slot(access: Tdma, ready_ns: int, airtime_ns: int, slot: int, slots: int) -> int:
    if airtime_ns > access.usable_ns(slots):
        raise BadInput(
            f"a frame of {airtime_ns / 1e6:.3f} ms airtime does not fit a tdma slot of "
            f"{access.usable_ns(slots) / 1e6:.3f} ms: send less, or make the cycle longer"
        )
    current = int(ready_ns * access.cycle / 1e9)
    for cycle in range(current, current + 3):  # the own slot may be over, and `current` one too low by rounding
        begin, end = _cycle_bounds(access.cycle, cycle)
        first = begin + (end - begin) * slot // slots
        last = begin + (end - begin) * (slot + 1) // slots - access.guard - airtime_ns
        if ready_ns <= last and first <= last:
            return max(ready_ns, first)
    raise AssertionError(f"slot {slot} of {slots} is too short for {airtime_ns} ns ready at {ready_ns} ns")


@lru_cache(maxsize=256)
def _cycle_bounds(cycle_hz: float, cycle: int) -> tuple[int, int]:
    """Start and end of a cycle; cached, as successive frames and neighbours need the same ones."""
    return period_ns(cycle_hz, cycle), period_ns(cycle_hz, cycle + 1)


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
