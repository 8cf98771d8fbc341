"""The wall clock as nominal time, and an alarm at a nominal instant."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from ..transport.timerfd import TimerFd


class WallClock:
    """Nominal time = (monotonic clock − epoch) · speed.

    Args:
        loop: where `wake` is called.
        wake: called when an alarm is due.
        speed: nominal seconds per second of the wall clock.

    `epoch_ns` is nominal time 0 on the monotonic clock; it is set once all agents have agreed on it.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, wake: Callable[[], None], speed: float) -> None:
        self.epoch_ns = 0
        self.speed = speed
        self._timer = TimerFd(loop, wake)

    def now_ns(self) -> int:
        """Nominal time now."""
        return self.nominal_ns(time.monotonic_ns())

    def nominal_ns(self, monotonic_ns: int) -> int:
        """Nominal time at an instant of the monotonic clock."""
        return int((monotonic_ns - self.epoch_ns) * self.speed)

    def monotonic_ns(self, time_ns: int) -> int:
        """The instant of the monotonic clock at a nominal time."""
        return self.epoch_ns + int(time_ns / self.speed)

    def wake_at(self, time_ns: int) -> None:
        """Set the alarm to a nominal instant, at once if it has passed, in the place of the last one; on any thread."""
        self._timer.set(self.monotonic_ns(time_ns))

    def close(self) -> None:
        """Close the timer."""
        self._timer.close()
