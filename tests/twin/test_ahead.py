"""Realtime pace puts frames on the wire ahead of their start: what becomes of them is as if it had not."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop
from typing import Any

import numpy as np
import pytest

from volery.agents.plan import Plan
from volery.experiments.record import Collector, Record
from volery.experiments.twin import Twin
from volery.transport.events import HANDLER, NODE, TIME

from .test_lockstep import assert_equal

MS = 1_000_000
SEEDS = range(30)


def ahead_run(plan: Plan, seed: int) -> Record:
    """The twin, whose nodes transmit ahead after each of their events, as far as is drawn."""
    rng = np.random.default_rng(seed)
    collector = Collector()
    twin = Twin(plan, collector)
    nodes = {node.index: node for node in twin.nodes.values()}
    heap = twin.heap
    while heap and heap[0][TIME] < plan.duration_ns:
        event = heappop(heap)
        event[HANDLER](event)
        ahead_ns = int(rng.integers(0, 20 * MS))
        nodes[event[NODE]].transmit_ahead(min(event[TIME] + ahead_ns, plan.duration_ns))
    for node in nodes.values():
        node.finish()
        collector(node.take_journal())
    collector.event({"event": "finished", "time_ns": plan.duration_ns})
    return collector.record(plan)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("who", ["talker", "answerer"])
def test_transmitting_ahead_changes_nothing(
    who: str, seed: int, drawn_plan: Any, twin_run: Callable[[Plan], Record], request: pytest.FixtureRequest
) -> None:
    """Estimates and frame stories are those of a run that transmits each frame at its start."""
    plan = drawn_plan(request.getfixturevalue(who), seed)
    assert_equal(ahead_run(plan, seed), twin_run(plan))
