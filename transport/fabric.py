"""The twin's fabric: one heap for all nodes, and no clock but the events themselves."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop

from .events import HANDLER, TIME, Event


def run(heap: list[Event], until_ns: int, every_ns: int = 0, go_on: Callable[[int], bool] | None = None) -> int:
    """Handle every event before `until_ns`, in the order of their keys; the instant that was reached.

    `go_on` is told the time every `every_ns`, between two events, and ends it there by saying no.
    """
    report_at = every_ns
    while heap and heap[0][TIME] < until_ns:
        time_ns = heap[0][TIME]
        if go_on is not None and time_ns >= report_at:
            if not go_on(time_ns):
                return time_ns
            report_at = time_ns + every_ns
        event = heappop(heap)
        event[HANDLER](event)
    return until_ns
