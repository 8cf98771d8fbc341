"""What both pacers of a process are given, and share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..transport.frames import Message

AHEAD_NS = 8_000_000
"""How long before its start, on the clock, a frame is put on the wire.

Far less than live faults are announced ahead, and short, so that frames that start later do not delay earlier ones.
"""
LATENESS_KEPT = 50_000
"""How many of the times by which events were handled late are kept for their quantiles."""

Write = Callable[[str, Message], None]
Guard = Callable[[Callable[[], None]], Callable[[], None]]
"""Makes a function report what it raises."""


@dataclass(frozen=True)
class RunStart:
    """What an agent is told of the run that it joins.

    epoch_ns: nominal time 0 on the monotonic clock. end_ns: nominal end. interventions: instants of the live
    faults so far.
    external_kills: agents and incarnations that were killed externally.
    """

    epoch_ns: int
    end_ns: int
    interventions: tuple[int, ...] = ()
    external_kills: tuple[tuple[str, int], ...] = ()
