"""The live display, with a clock of its own."""

from __future__ import annotations

import io
from collections.abc import Iterator

from rich.console import Console

from volery.experiments.cli.progress_display import Progress

STEP_S = 0.5
FRAMES = 100


def shown(console: Console, clock: Iterator[float]) -> str:
    """What twenty statuses of a run of 10 s look like, one each half second of the run."""
    with Progress(console, "mine", lambda: next(clock)) as progress:
        for step in range(1, 21):
            progress.show(
                {
                    "time_s": step * STEP_S,
                    "duration_s": 10.0,
                    "agents": 16,
                    "alive": ["1"] * 15,
                    "frames": FRAMES * step,
                    "lost": step,
                    "discarded": {"queue": 2000} if step > 10 else {},
                    "late": 0,
                    "behind_s": 0.26 if step > 10 else 0.04,
                    "disagreement": 0.01234 if step > 1 else None,
                    "faults": {"t1": "cut 4–7"} if step > 10 else {},
                }
            )
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_lines_where_the_output_is_no_terminal() -> None:
    """A line at each tenth of the run; frames per second are those of the wall clock, of the last two seconds."""
    ticks = (0.25 * tick for tick in range(100))
    lines = shown(Console(file=io.StringIO(), width=200), ticks).splitlines()
    assert len(lines) == 10
    rate = f"{FRAMES / 0.25:.0f}/s"
    assert lines[4] == (
        f"5.0 of 10 s: 15 of 16 agents alive, 1,000 frames ({rate}), 10 lost, 0 late, disagreement 0.0123"
    )
    assert lines[5].endswith("12 lost, queue 2,000, 0 late, 0.3 s behind, disagreement 0.0123; in force: t1: cut 4–7")


def test_no_minute_of_a_slow_run_is_silent() -> None:
    """Statuses that come 70 s apart, two to each tenth of the run: each has a line."""
    ticks = (70.0 * tick for tick in range(100))
    assert shown(Console(file=io.StringIO(), width=200), ticks).count("agents alive") == 20


def test_panel_in_a_terminal() -> None:
    """In a terminal the panel is drawn in place, at most ten times a second, and removed in the end.

    One more drawing is the last one, made again when the display stops.
    """
    calm = shown(Console(file=io.StringIO(), force_terminal=True, width=120), (0.25 * tick for tick in range(100)))
    assert calm.count("agents alive") == 20 + 1
    assert "in force: t1: cut 4–7" in calm
    assert calm.rstrip().endswith("\x1b[2K")
    busy = shown(Console(file=io.StringIO(), force_terminal=True, width=120), (0.03 * tick for tick in range(100)))
    assert busy.count("agents alive") == 5 + 1
