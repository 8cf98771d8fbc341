"""The order of events: one key for everything that happens to an agent.

An event is a tuple (time, rank, source, sequence, copy, node, handler, data): the first five are the key, `node` is the
index of the node in a common heap, and `handler` is called with the event.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

FAULT = 0
FRAME = SENSE = 1
TIMER = 2
OFFER = 4
TRANSMIT = 5
"""Ranks: at one instant faults come first, then frames and samples, then timers, and the agent's own sending last."""

Event = tuple[int, int, str, int, int, int, Callable[[Any], None], Any]
TIME: Final = 0
RANK: Final = 1
SOURCE: Final = 2
NODE: Final = 5
HANDLER: Final = 6
DATA: Final = 7

FOREVER_NS = 2**62
"""Later than every run."""
OVER_NS = 2 * FOREVER_NS
"""Promise of a dead agent: valid until it restarts, even across interventions."""
