"""What both pacers of a process are given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..transport.frames import Message

Write = Callable[[str, Message], None]
Guard = Callable[[Callable[[], None]], Callable[[], None]]
"""Makes a function report what it raises."""


@dataclass(frozen=True)
class RunStart:
    """What an agent is told of the run that it joins.

    epoch_ns: nominal time 0 on the monotonic clock. end_ns: nominal end. interventions: their number so far.
    external_kills: agents and incarnations that were killed externally.
    """

    epoch_ns: int
    end_ns: int
    interventions: int = 0
    external_kills: tuple[tuple[str, int], ...] = ()
