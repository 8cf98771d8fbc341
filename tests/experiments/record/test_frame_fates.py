"""What became of frames: the classes of fates, and when frames were due, held, came and were handed over."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from volery.agents.journal import Arrived, Batch, Late, Released
from volery.agents.plan import Plan
from volery.experiments.figures.space_time import LOOKS
from volery.experiments.record.frame_fates import FATES, frame_fates, is_lost, is_transmitted
from volery.experiments.record.record import Record
from volery.transport.faults import LinkFault
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings

MS = 1_000_000
LINK = ("1", "2")
Make = Callable[..., Any]


def test_classes_of_fates() -> None:
    """What was on the air, what is a loss, and what is neither; all of it can be drawn."""
    on_air = {"cut", "half-duplex", "collision", "loss", "corrupt", "receiver-down"}
    assert {fate for fate in FATES if is_transmitted(fate)} == {"delivered", *on_air}
    assert {fate for fate in FATES if is_lost(fate)} == {*on_air, "access", "sender-down"}
    assert set(FATES) - on_air == {
        *("delivered", "access", "sender-down", "refused", "queue", "in-flight", "unknown", "missing")
    }
    assert set(LOOKS) == set(FATES)


def times(record: Record, field: str) -> list[float | None]:
    """A time of each frame of the link [ms]."""
    values = [getattr(frame, field) for frame in frame_fates(record)[LINK]]
    return [None if value is None else value / MS for value in values]


@pytest.fixture
def record(record_of: Make, sent: Make, heard: Make) -> Record:
    """Frames due at 5, 15, 25, 35 and 45 ms: in time, late, held, held and late, never heard."""
    sender = Batch("1", 0, sent=[sent(number, 10 * number) for number in range(5)])
    receiver = Batch("2", 0, heard=[heard(number, 10 * number) for number in range(4)])
    came = ((4, 6), (18, 19), (20, 101), (103, 104))
    receiver.arrived += [
        Arrived("1", 0, number, arrived * MS, handed * MS) for number, (arrived, handed) in enumerate(came)
    ]
    receiver.released += [Released("1", 0, number, 100 * MS) for number in (2, 3)]
    receiver.late.append(Late("1", 0, 1, 15 * MS, 2 * MS))
    made: Record = record_of(sender, receiver)
    return made


def test_times_of_a_frame_by_the_wall_clock(record: Record) -> None:
    """Late is what came after it was due, or after its link let it go; latency is without the time it was held."""
    assert times(record, "arrived_ns") == [4, 18, 20, 103, None]
    assert times(record, "handed_ns") == [6, 19, 101, 104, None]
    assert times(record, "held_until_ns") == [None, None, 100, 100, None]
    assert times(record, "late_ns") == [0, 3, 0, 3, None]
    assert times(record, "behind_ns") == [None, 2, None, None, None]
    assert times(record, "latency_ns") == [3, 6, 3, 6, 3]


def test_frames_are_handed_over_when_they_are_due_or_let_go(plan_of: Make, twin_run: Callable[[Plan], Record]) -> None:
    """Where no wall clock counts nothing arrives but by nominal time; what is still held at the end is in flight."""
    holds = (
        LinkFault("t1", 100 * MS, 300 * MS, (LINK,), {"hold": True}),
        LinkFault("t2", 900 * MS, None, (LINK,), {"hold": True}),
    )
    record = twin_run(plan_of([LINK], 1000, settings=LinkSettings(latency=Constant(5 * MS)), faults=holds))
    frames = frame_fates(record)[LINK]
    assert len(frames) == 19
    for frame in frames:
        assert frame.due_ns is not None
        held = 100 * MS <= frame.due_ns < 300 * MS
        never = frame.due_ns >= 900 * MS
        assert frame.held_until_ns == (300 * MS if held else None)
        assert frame.handed_ns == (None if never else 300 * MS if held else frame.due_ns)
        assert (frame.arrived_ns, frame.late_ns) == (None, None if never else 0)
        assert frame.fate == ("in-flight" if never else "delivered")
