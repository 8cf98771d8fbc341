"""The trace shows every frame once, in the order of time, and what faults and deaths came in between."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from volery.agents.journal import Batch, Dropped, Late, Released
from volery.experiments.analysis.frame_trace import SELECTABLE, Selection, trace
from volery.experiments.record.record import Record
from volery.transport.faults import Kill, LinkFault

MS = 1_000_000
Make = Callable[..., Any]


@pytest.fixture
def record(record_of: Make, sent: Make, heard: Make) -> Record:
    """Frames of "1" to "2": delivered late, lost, refused, never told of, delivered; a cut of 2→1, and 2 dies."""
    sender = Batch("1", 0, sent=[sent(0, 0), sent(1, 10, "loss"), sent(4, 40)])
    sender.dropped.append(Dropped("2", 2, 20 * MS, "refused"))
    receiver = Batch("2", 0, heard=[heard(0, 0), heard(1, 10, "loss"), heard(4, 40)])
    receiver.late.append(Late("1", 0, 0, 5 * MS, 2 * MS))
    receiver.released.append(Released("1", 0, 4, 60 * MS))
    died = {"event": "died", "agent": "2", "incarnation": 0, "time_ns": 900 * MS, "cause": "injected"}
    faults = (LinkFault("t1", 10 * MS, 30 * MS, (("2", "1"),), {"cut": True}), Kill("t2", 900 * MS, None, "2"))
    made: Record = record_of(sender, receiver, events=[died], faults=faults)
    return made


def texts(record: Record, **selection: Any) -> list[str]:
    """The lines without their columns."""
    return [" ".join(str(entry).split()) for entry in trace(record, Selection(**selection))]


def test_lines_in_the_order_of_time(record: Record) -> None:
    """Start, link, number, size, airtime, due, fate; the frame of which nobody tells stands after the one before it."""
    assert texts(record) == [
        "0.000000 s 1→2 #0 10 B on air 2.000 ms due 0.005000 s delivered, 2.000 ms late",
        "0.010000 s fault t1 begins: cut 2→1",
        "0.010000 s 1→2 #1 10 B on air 2.000 ms due 0.015000 s loss",
        "0.020000 s 1→2 #2 refused",
        "0.020000 s 1→2 #3 missing",
        "0.030000 s fault t1 ends: cut 2→1",
        "0.040000 s 1→2 #4 10 B on air 2.000 ms due 0.045000 s delivered, held until 0.060000 s",
        "0.900000 s fault t2 begins: kill 2",
        "0.900000 s agent 2 died: injected, life 0",
    ]


@pytest.mark.parametrize(
    ("selection", "frames", "others"),
    [
        ({"links": frozenset({("2", "1")})}, [], 4),
        ({"links": frozenset({("1", "2")})}, [0, 1, 2, 3, 4], 2),
        ({"agents": frozenset({"1"})}, [0, 1, 2, 3, 4], 2),
        ({"agents": frozenset({"2"})}, [0, 1, 2, 3, 4], 4),
        ({"fates": frozenset({"loss", "missing"})}, [1, 3], 0),
        ({"fates": frozenset({"lost"})}, [1], 0),
        ({"from_ns": 10 * MS, "until_ns": 40 * MS}, [1, 2, 3], 2),
    ],
)
def test_what_is_selected(record: Record, selection: dict[str, Any], frames: list[int], others: int) -> None:
    """By link, by agent, by fate, by a half-open span; faults and deaths only where they concern what is selected."""
    values = [entry.values for entry in trace(record, Selection(**selection))]
    assert [value["sequence"] for value in values if value["what"] == "frame"] == frames
    assert sum(value["what"] != "frame" for value in values) == others


def test_every_fate_of_a_record_can_be_asked_for(record: Record) -> None:
    """SELECTABLE has all that frames become."""
    seen = {entry.values["fate"] for entry in trace(record, Selection()) if entry.values["what"] == "frame"}
    assert seen == {"delivered", "loss", "refused", "missing"}
    assert seen <= set(SELECTABLE)
