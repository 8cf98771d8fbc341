"""The twin's event loop: one heap of events for all nodes, without a clock."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from heapq import heappop

from .events import HANDLER, TIME, Event

_OLD_NEVER = 1_000_000


def run(heap: list[Event], until_ns: int, every_ns: int = 0, go_on: Callable[[int], bool] | None = None) -> int:
    """Handle all events before `until_ns` in the order of their keys, and return the time reached.

    Between events, `go_on` is called with the time every `every_ns`; the run ends there if it returns False.
    """
    report_at = every_ns
    with _collecting_young_garbage_only():
        while heap and heap[0][TIME] < until_ns:
            time_ns = heap[0][TIME]
            if go_on is not None and time_ns >= report_at:
                if not go_on(time_ns):
                    return time_ns
                report_at = time_ns + every_ns
            event = heappop(heap)
            event[HANDLER](event)
    return until_ns


@contextmanager
def _collecting_young_garbage_only() -> Iterator[None]:
    """Limit garbage collection to young objects: nodes and their heap live as long as the run."""
    before = gc.get_threshold()
    gc.set_threshold(before[0], before[1], _OLD_NEVER)
    try:
        yield
    finally:
        gc.set_threshold(*before)
