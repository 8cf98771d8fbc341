"""The order of events: one key for everything that happens to an agent.

An event is a tuple (time, rank, source, sequence, copy, node, handler, data): the first five are the key, `node` tells
the nodes of one heap apart, and `handler` is called with the event when its turn comes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

FAULT = 0
FRAME = SENSE = ACT = 1
TIMER = 2
WORLD = 3
OFFER = 4
TRANSMIT = 5
"""Ranks: at one instant faults come first, then what comes in, then timers; the agent's own link comes last."""

Event = tuple[int, int, str, int, int, int, Callable[[Any], None], Any]
TIME, RANK, SOURCE, SEQUENCE, COPY, NODE, HANDLER, DATA = range(8)

FOREVER_NS = 2**62
"""Later than every run."""
