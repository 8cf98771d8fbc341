"""The mailbox of a process, which Zenoh's thread fills and the loop empties."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from ..transport.frames import Message


class Mail(NamedTuple):
    """A message, who sent it, and when it arrived by the clock of the pace, if that has one [ns]."""

    source: str
    message: Message
    arrived_ns: int


class Mailbox:
    """Frames that have arrived and that the loop has not taken yet.

    A wake-up of the loop costs more than a frame, so the pacers let it sleep until a frame matters.
    """

    LIMIT = 200_000

    def __init__(self) -> None:
        self._frames: deque[Mail] = deque()
        self.overflowed = 0

    def put(self, source: str, frame: Message, arrived_ns: int = 0) -> None:
        """Keep a frame; called on Zenoh's thread. A frame over the limit is lost, and counted."""
        if len(self._frames) < self.LIMIT:
            self._frames.append(Mail(source, frame, arrived_ns))
        else:
            self.overflowed += 1

    def take(self) -> list[Mail]:
        """Take all frames, in the order of their arrival; called on the loop."""
        return [self._frames.popleft() for _ in range(len(self._frames))]

    def waiting(self) -> list[Mail]:
        """What has not been taken; called on the loop."""
        return list(self._frames)

    def __bool__(self) -> bool:
        """Whether there is mail."""
        return bool(self._frames)
