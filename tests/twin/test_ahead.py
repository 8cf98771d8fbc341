"""Realtime pace puts frames on the wire ahead of their start: what becomes of them is as if it had not."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop
from typing import Any

import numpy as np
import pytest

from volery.agents.agent import Agent
from volery.agents.plan import Plan, World
from volery.experiments.record.record import Collector, Record
from volery.experiments.twin import Twin
from volery.transport.events import HANDLER, NODE, TIME
from volery.transport.faults import ClockFault
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings, Queue
from volery.transport.media_settings import HalfDuplex, SlottedAloha

from ..surroundings import seeds
from .test_exact_pace import assert_equal

MS = 1_000_000
SEEDS = range(30)


def ahead_run(plan: Plan, seed: int) -> Record:
    """The twin, whose nodes transmit ahead after each of their events, as far as is drawn."""
    rng = np.random.default_rng(seed)
    collector = Collector()
    twin = Twin(plan, collector)
    nodes = {node.state.index: node for node in twin.nodes.values()}
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


@pytest.mark.parametrize("seed", seeds(8, 30))
def test_transmitting_ahead_changes_nothing(
    who: type[Agent], seed: int, drawn_plan: Any, twin_run: Callable[[Plan], Record]
) -> None:
    """Estimates and frame stories are those of a run that transmits each frame at its start."""
    plan = drawn_plan(who, seed)
    assert_equal(ahead_run(plan, seed), twin_run(plan))


@pytest.mark.parametrize("seed", seeds(8, 30))
def test_transmitting_ahead_changes_nothing_where_much_changes(
    any_plan: Callable[..., Plan],
    who: type[Agent],
    seed: int,
    come_and_go: Callable[[Plan, int], Plan],
    with_buckets: Callable[[Plan, int], Plan],
    twin_run: Callable[[Plan], Record],
) -> None:
    """Nor where radios share the air, clocks jump, links come, go and hold frames back, and buckets fill up."""
    plan = come_and_go(any_plan(who, seed), seed)
    plan = with_buckets(plan, seed)
    assert_equal(ahead_run(plan, seed), twin_run(plan))


def test_a_clock_set_back_puts_off_what_waits_for_its_slot(
    plan_of: Any, talker: type[Agent], parameters_of: Any, probe: World, twin_run: Callable[[Plan], Record]
) -> None:
    """A frame that waits for its slot is not put on the wire for the slot that the clock had before it was set back."""
    medium = HalfDuplex(access=SlottedAloha(50 * MS))
    settings = LinkSettings(medium=medium, rate=1e6, latency=Constant(MS))
    back = ClockFault("t1", 30 * MS, None, "1", -20 * MS)
    parameters = {name: parameters_of(rate=40.0) for name in "12"}
    plan = plan_of([("1", "2")], talker, settings, [back], 200, parameters=parameters, world=probe)
    expected = twin_run(plan)
    assert next(sent.start_ns for sent in expected.batches["1", 0].sent) == 70 * MS
    for seed in SEEDS:
        assert_equal(ahead_run(plan, seed), expected)


def test_room_in_the_queue_is_that_of_the_nominal_start(
    plan_of: Any, talker: type[Agent], parameters_of: Callable[..., Any], twin_run: Callable[[Plan], Record]
) -> None:
    """What is offered at the instant at which a frame starts finds it in the queue still: agent 1 loses each second."""
    medium = HalfDuplex(access=SlottedAloha(50 * MS))
    settings = LinkSettings(medium=medium, rate=1e6, latency=Constant(MS), queue=Queue(1))
    parameters = {name: parameters_of(rate=40.0, phase_ns=-MS) for name in "12"}
    plan = plan_of([("1", "2")], talker, settings, (), 300, parameters=parameters)
    expected = twin_run(plan)
    assert [dropped.time_ns for dropped in expected.batches["1", 0].dropped] == list(range(50 * MS, 300 * MS, 50 * MS))
    for seed in SEEDS:
        assert_equal(ahead_run(plan, seed), expected)
