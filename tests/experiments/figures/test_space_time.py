"""The space-time diagram: what lies in its window, and where each frame is drawn."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from volery.agents.journal import Arrived, Batch, Dropped, Late, Released
from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.figures.space_time import MOST_FRAMES, Window, choose_window, draw_space_time, plot_space_time
from volery.experiments.record.frame_fates import frame_fates
from volery.experiments.record.record import Record
from volery.transport.faults import Kill, LinkFault
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings

MS = 1_000_000
LINK = ("1", "2")
Make = Callable[..., Any]


def drawn(record: Record, until_ms: int = 100) -> tuple[Axes, list[Line2D]]:
    """The axes of the diagram of the first so many milliseconds, and the marks of its legend."""
    axes = Figure().subplots()
    return axes, draw_space_time(axes, record, Window(0, until_ms * MS, ("1", "2")))


def marks(axes: Axes, shape: str) -> list[tuple[float, float]]:
    """Where the marks of a shape stand: time in ms, lane."""
    found = (line for line in axes.lines if line.get_marker() == shape)
    return [(float(np.asarray(line.get_xdata())[0]), float(np.asarray(line.get_ydata())[0])) for line in found]


def test_frames_go_from_lane_to_lane(record_of: Make, sent: Make, heard: Make) -> None:
    """A bar from start to last bit beside the lane of the sender, a line to the lane of the receiver at due."""
    axes, legend = drawn(record_of(Batch("1", 0, sent=[sent(0, 10)]), Batch("2", 0, heard=[heard(0, 10)])))
    bar, way = axes.lines[2:4]  # after the two lanes
    assert np.asarray(bar.get_xdata()).tolist() == [10.0, 12.0]
    assert np.asarray(way.get_xdata()).tolist() == [12.0, 15.0]
    assert np.asarray(way.get_ydata()).tolist() == [np.asarray(bar.get_ydata())[0], -1.0]
    assert marks(axes, "o") == [(15.0, -1.0)]
    assert [mark.get_label() for mark in legend] == ["on the air", "delivered"]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["1", "2"]
    assert axes.get_xlabel() == "time (ms)"


@pytest.mark.parametrize(
    ("verdict", "fate", "shape", "arrives"),
    [
        ("loss", "loss", "x", False),
        ("cut", "cut", "|", False),
        ("corrupt", "corrupt", "P", True),
        ("delivered", "half-duplex", "s", True),
        ("delivered", "collision", "D", True),
    ],
)
def test_lost_frames_end_with_the_mark_of_their_cause(
    record_of: Make, sent: Make, heard: Make, verdict: str, fate: str, shape: str, arrives: bool
) -> None:
    """What the link lost ends on the way, what was lost at the receiver ends there."""
    record = record_of(Batch("1", 0, sent=[sent(0, 10, verdict)]), Batch("2", 0, heard=[heard(0, 10, fate)]))
    axes, legend = drawn(record)
    ((time, lane),) = marks(axes, shape)
    assert ((time, lane) == (15.0, -1.0)) == arrives
    assert 12.0 < time <= 15.0
    assert legend[-1].get_marker() == shape


def test_dropped_late_held_and_doubled_frames(record_of: Make, sent: Make, heard: Make) -> None:
    """A full queue at the sender's lane; a late frame and a held one end when they came; a duplicate is dotted."""
    sender = Batch("1", 0, sent=[sent(0, 0), sent(2, 20), sent(3, 44), sent(0, 0)._replace(copy=1, due_ns=9 * MS)])
    sender.dropped.append(Dropped("2", 1, 15 * MS, "queue"))
    receiver = Batch("2", 0, heard=[heard(0, 0), heard(2, 20), heard(3, 44)], late=[Late("1", 0, 2, 25 * MS, 6 * MS)])
    receiver.heard.append(heard(0, 0)._replace(copy=1, due_ns=9 * MS))
    receiver.arrived.append(Arrived("1", 0, 2, 30 * MS, 31 * MS))
    receiver.released.append(Released("1", 0, 3, 70 * MS))
    axes, legend = drawn(record_of(sender, receiver))
    assert [time for time, _ in marks(axes, "1")] == [15.0]
    assert [time for time, _ in marks(axes, "o")] == [5.0, 9.0, 31.0, 70.0]
    assert [mark.get_label() for mark in legend] == ["on the air", "delivered", "queue full", "duplicate", "late"]
    bars = [line for line in axes.lines if line.get_linewidth() > 2]
    assert len(bars) == 3  # a duplicate was on the air with its original


def test_faults_are_shaded(record_of: Make) -> None:
    """Of links over all lanes, of an agent over its own lane; what lies outside of the window is not."""
    faults = (
        LinkFault("t1", 10 * MS, 20 * MS, (LINK,), {"cut": True}),
        Kill("t2", 50 * MS, None, "2"),
        LinkFault("t3", 150 * MS, 160 * MS, (LINK,), {"cut": True}),
    )
    axes, _ = drawn(record_of(faults=faults))
    (span,) = axes.patches
    assert span.get_extents().transformed(axes.transData.inverted()).intervalx.tolist() == pytest.approx([10, 20])
    (lane,) = axes.collections
    (path,) = lane.get_paths()
    assert path.get_extents().intervalx.tolist() == [50.0, 100.0]
    assert -1.5 < path.get_extents().y0 < -1 < path.get_extents().y1 < -0.5
    assert [text.get_text() for text in axes.texts] == ["cut 1→2", "kill 2"]


@pytest.fixture
def record(plan_of: Make, twin_run: Callable[[Plan], Record]) -> Record:
    """Three agents in a line, four frames each 50 ms for ten seconds, and a cut from 5 s on."""
    cut = LinkFault("t1", 5000 * MS, 6000 * MS, (LINK,), {"cut": True})
    links = LinkSettings(latency=Constant(5 * MS))
    return twin_run(plan_of([LINK, ("2", "3")], 10_000, settings=links, faults=(cut,)))


def frames_in(record: Record, window: Window) -> int:
    """How many frames a window shows."""
    return sum(window.shows(frame) for frames in frame_fates(record).values() for frame in frames)


def test_window_is_chosen_about_the_first_fault(record: Record) -> None:
    """Some forty frames, most of them after its start."""
    window = choose_window(record, (None, None))
    assert window.from_ns < 5000 * MS < window.until_ns
    assert 5000 * MS - window.from_ns < window.until_ns - 5000 * MS
    assert 36 <= frames_in(record, window) <= 44
    assert window.agents == ("1", "2", "3")


def test_open_ends_of_a_window_are_chosen(record: Record) -> None:
    """What is given holds; some forty frames after the beginning, or before the end."""
    later = choose_window(record, (2000 * MS, None))
    assert later.from_ns == 2000 * MS
    assert 36 <= frames_in(record, later) <= 44
    earlier = choose_window(record, (None, 2000 * MS))
    assert earlier.until_ns == 2000 * MS
    assert 36 <= frames_in(record, earlier) <= 44
    both = choose_window(record, (2000 * MS, 2050 * MS), ["2", "1"])
    assert both == Window(2000 * MS, 2050 * MS, ("1", "2"))
    assert frames_in(record, both) == 2


def test_more_frames_than_can_be_told_apart(plan_of: Make, twin_run: Callable[[Plan], Record]) -> None:
    """The message says how many there are, and how to narrow the window."""
    record = twin_run(plan_of([LINK], 80_000))
    count = sum(map(len, frame_fates(record).values()))
    assert count > MOST_FRAMES
    with pytest.raises(BadInput, match=rf"{count:,} frames are in the window.*narrow it with --from"):
        choose_window(record, (0, record.last_ns))


def test_files_with_fonts_that_journals_take(tmp_path: Path, record: Record) -> None:
    """PNG and PDF, fonts as TrueType; also for a run without any frame."""
    png, pdf = plot_space_time(record, tmp_path)
    assert (png.name, pdf.name) == ("space-time.png", "space-time.pdf")
    assert b"/Type3" not in pdf.read_bytes()
    assert b"/FontFile2" in pdf.read_bytes()


def test_run_without_frames(tmp_path: Path, record_of: Make) -> None:
    """Lanes without anything."""
    assert plot_space_time(record_of(), tmp_path, formats=("svg",))[0].stat().st_size > 1000
