"""Graphs that change, in the twin: who hears whom, and when."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.agents.plan import Plan
from volery.experiments.record.record import Record
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded

S = 1_000_000_000
TEXT = """\
seed: 4
duration: 10 s
topology: {}
agents: {{kind: beacon, rate: 20 Hz, phase: aligned, talkers: [{}], broadcast: {}}}
world: {}
links: {{medium: {}, rate: 250 kbit/s, latency: 5 ms}}
"""
EDGES = "{edges: {1-2: always, 2-3: [[0 s, 2 s], [6 s, 7 s]]}}"
PATHS = "{kind: moving, paths: {1: {0 s: [0, 0]}, 2: {0 s: [9, 0]}, 3: {0 s: [9, 5], 10 s: [9, 25]}}}"


def run(tmp_path: Path, *fields: str) -> tuple[Plan, Record]:
    """The plan and the record of beacons."""
    path = tmp_path / "changing.yaml"
    path.write_text(TEXT.format(*fields), "utf-8")
    plan = load_scenario(path).plan
    return plan, recorded(plan)


@pytest.mark.parametrize(
    ("broadcast", "medium"), [("false", "full-duplex"), ("true", "{kind: half-duplex, per: node, access: aloha}")]
)
def test_frames_are_heard_only_while_there_is_a_link(tmp_path: Path, broadcast: str, medium: str) -> None:
    """20 beacons a second to each neighbour of then, also of a radio that all share; what is sent in a gap is nobody's.

    A beacon leaves 1 ms after its timer, so of three seconds with a link the 3 · 20 that started in them count.
    """
    plan, record = run(tmp_path, EDGES, "2", broadcast, "null", medium)
    starts = [frame.start_ns for frame in record.batches["2", 0].sent if frame.target == "3"]
    spans = plan.presence["2", "3"]
    inside = [start for start in starts if any(begin <= start < end for begin, end in spans)]
    assert len(inside) == 60
    assert starts == inside or broadcast == "true"
    heard = [frame.due_ns for frame in record.batches["3", 0].heard if frame.fate == "delivered"]
    assert len(heard) == 60
    assert all(any(begin <= due < end for begin, end in spans) for due in heard)
    assert len([frame for frame in record.batches["2", 0].sent if frame.target == "1"]) == 200


def test_agents_that_move_lose_each_other(tmp_path: Path) -> None:
    """Agent 3 walks out of reach of 2 after 2.5 s, and its last beacon that arrives is of then."""
    plan, record = run(tmp_path, "{proximity: {radius: 10 m, every: 200 ms}}", "2, 3", "false", PATHS, "full-duplex")
    assert plan.presence["3", "2"] == ((0, 2_600_000_000),)
    heard = [frame.due_ns for frame in record.batches["2", 0].heard if frame.source == "3"]
    assert len(heard) == 52
    assert max(heard) < 2_600_000_000
    assert [frame.source for frame in record.batches["1", 0].heard].count("2") == 200
