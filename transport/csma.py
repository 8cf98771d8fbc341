"""Carrier sense: the unslotted CSMA-CA of IEEE 802.15.4 (2006, 7.5.1.4), without acknowledgement.

Before each frame a radio waits a random number of backoff periods, then senses the channel for `cca`. If the channel is
clear, it turns from receiving to transmitting, and transmits; else it waits again, up to twice as long, and gives up
after `max_backoffs` more attempts. Two radios collide if one begins to transmit after the other has sensed the channel:
within its turnaround, or because they do not hear each other.
"""

from __future__ import annotations

from ..randomness import Stream
from .events import FOREVER_NS
from .media_settings import ACCESS_ATTEMPTS, Csma


class Contention:
    """One radio's attempts to access the channel: a state machine without a clock.

    While it contends, `sense_ns` is the end of its clear channel assessment; once the channel is clear, `start_ns` is
    the start of its frame.
    """

    __slots__ = ("_attempt", "_draws", "_exponent", "_frames", "access", "sense_ns", "start_ns")

    def __init__(self, access: Csma, draws: Stream) -> None:
        self.access = access
        self.sense_ns: int | None = None
        self.start_ns: int | None = None
        self._draws = draws
        self._frames = 0
        self._attempt = 0
        self._exponent = access.min_be

    @property
    def idle(self) -> bool:
        """Whether it neither contends nor is about to transmit."""
        return self.sense_ns is None and self.start_ns is None

    def earliest_ns(self) -> int:
        """Earliest start of the present frame; FOREVER_NS without one."""
        if self.start_ns is not None:
            return self.start_ns
        return FOREVER_NS if self.sense_ns is None else self.sense_ns + self.access.turnaround

    def begin(self, now_ns: int) -> int:
        """Begin contention for the next frame, and return the end of the clear channel assessment."""
        self._attempt, self._exponent = 0, self.access.min_be
        self._frames += 1
        self.start_ns = None
        return self._wait(now_ns)

    def _wait(self, now_ns: int) -> int:
        draw = self._draws.uniform(self._frames * ACCESS_ATTEMPTS + self._attempt)
        self.sense_ns = now_ns + int(draw * 2**self._exponent) * self.access.period + self.access.cca
        return self.sense_ns

    def sensed(self, now_ns: int, *, busy: bool) -> bool:
        """End a clear channel assessment: set `start_ns` or the next `sense_ns`, or return False to give up."""
        self.sense_ns = None
        if not busy:
            self.start_ns = now_ns + self.access.turnaround
            return True
        self._attempt += 1
        self._exponent = min(self._exponent + 1, self.access.max_be)
        if self._attempt > self.access.max_backoffs:
            return False
        self._wait(now_ns)
        return True

    def started(self) -> None:
        """Note that the frame is on the air."""
        self.start_ns = None
