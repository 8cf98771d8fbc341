"""A one-shot timer on the monotonic clock that wakes an asyncio loop: Linux timerfd, with a finer resolution."""

from __future__ import annotations

import asyncio
import ctypes
import os
import threading
import time
from collections.abc import Callable

_NONBLOCK_CLOEXEC = os.O_NONBLOCK | os.O_CLOEXEC
_ABSOLUTE = 1
_BILLION = 1_000_000_000
_libc = ctypes.CDLL(None, use_errno=True)


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class _Itimerspec(ctypes.Structure):
    _fields_ = (("interval", _Timespec), ("value", _Timespec))


class TimerFd:
    """Calls `wake` when the monotonic clock reaches the instant that was set; a later `set` replaces it."""

    def __init__(self, loop: asyncio.AbstractEventLoop, wake: Callable[[], None]) -> None:
        self._loop = loop
        self._wake = wake
        spec = _Itimerspec()
        self._value, self._pointer = spec.value, ctypes.byref(spec)
        self._lock = threading.Lock()
        self._fd = _libc.timerfd_create(time.CLOCK_MONOTONIC, _NONBLOCK_CLOEXEC)
        if self._fd < 0:
            raise OSError(ctypes.get_errno(), "timerfd_create")
        loop.add_reader(self._fd, self._fired)

    def set(self, monotonic_ns: int) -> None:
        """Fire at this instant, or at once if it has passed; may be called on any thread."""
        with self._lock:
            self._value.seconds, self._value.nanoseconds = divmod(max(monotonic_ns, 1), _BILLION)
            _libc.timerfd_settime(self._fd, _ABSOLUTE, self._pointer, None)

    def _fired(self) -> None:
        try:
            os.read(self._fd, 8)
        except BlockingIOError:
            return
        self._wake()

    def close(self) -> None:
        """Close the file descriptor."""
        self._loop.remove_reader(self._fd)
        with self._lock:
            os.close(self._fd)
            self._fd = -1
