"""The twin's fabric: one heap for all nodes, and no clock but the events themselves."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop

from .events import HANDLER, TIME, Event


def run(heap: list[Event], until_ns: int, every_ns: int = 0, progress: Callable[[int], None] | None = None) -> None:
    """Handle every event before `until_ns` in the order of their keys; tell `progress` the time every `every_ns`."""
    report_at = every_ns
    while heap and heap[0][TIME] < until_ns:
        event = heappop(heap)
        if progress is not None and event[TIME] >= report_at:
            progress(event[TIME])
            report_at = event[TIME] + every_ns
        event[HANDLER](event)
