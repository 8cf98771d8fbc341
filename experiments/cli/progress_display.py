"""Live displays of a run and of a sweep: drawn in place in a terminal, elsewhere a line now and then."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Self

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from ..sweeps.sweep import Advance, SweepOptions, run_sweep
from ..sweeps.sweep_plan import SweepPlan
from ..sweeps.sweep_results import Sweep

_TENTHS = 10
_REDRAW_S = 0.1
_SILENT_S = 60.0
_BAR = 40
_RATE_OVER_S = 2.0
_MINUTE, _HOUR = 60, 3600
_BEHIND_S = 0.05
"""From here on it is worth saying how far a swarm is behind the wall clock."""


class Display:
    """Shows the progress of some work; times are passed in.

    Args:
        console: the console to draw on.
        since_s: start of the work [s], on the clock of `due`; without it the first state is always shown.
    """

    def __init__(self, console: Console, since_s: float = -math.inf) -> None:
        self._console = console
        self._live = Live(console=console, auto_refresh=False, transient=True) if console.is_terminal else None
        self._shown_s = since_s
        self._tenth = 0

    def __enter__(self) -> Self:
        """Start the display."""
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Remove the display from the terminal."""
        if self._live is not None:
            self._live.stop()

    def due(self, share: float, now_s: float) -> bool:
        """Whether to show the present state: ten times a second in a terminal, elsewhere at each tenth and each minute.

        Args:
            share: fraction of the work that is done, 0 to 1.
            now_s: present time [s]; a minute counts from the last update.
        """
        tenth, silent_s = int(_TENTHS * share), now_s - self._shown_s
        is_due = silent_s >= _REDRAW_S if self._live is not None else tenth > self._tenth or silent_s >= _SILENT_S
        if is_due:
            self._tenth, self._shown_s = tenth, now_s
        return is_due

    def show_now(self, picture: RenderableType, line: str) -> None:
        """Draw the picture in a terminal, print the line elsewhere."""
        if self._live is not None:
            self._live.update(picture, refresh=True)
        else:
            self._console.print(line, markup=False, soft_wrap=True)


def bar(name: str, share: float, words: str) -> Table:
    """Name, bar and text in a row."""
    row = Table.grid(padding=(0, 2))
    row.add_row(Text(name, style="bold"), ProgressBar(total=1.0, completed=share, width=_BAR), Text(words))
    return row


# -- a run -----------------------------------------------------------------------------------------------------------


class Progress(Display):
    """Shows the states of a run, each as `Status.to_dict` gives it.

    Args:
        console: the console to draw on.
        name: name of the run.
        clock: wall clock [s], for frames per second.
    """

    def __init__(self, console: Console, name: str, clock: Callable[[], float] = time.monotonic) -> None:
        began_s = clock()
        super().__init__(console, began_s)
        self._name = name
        self._clock = clock
        self._seen = deque([(began_s, 0)])

    def show(self, status: Mapping[str, Any]) -> None:
        """Show a state, unless one was shown just before."""
        now_s, share = self._clock(), status["time_s"] / status["duration_s"]
        if not self.due(share, now_s):
            return
        time_, facts = _time(status), _facts(status, self._rate(now_s, status["frames"]))
        panel = Group(bar(self._name, share, time_), Text(facts), Text(_faults(status), style="yellow"))
        self.show_now(panel, f"{time_}: {facts}{_faults(status, '; ')}")

    def _rate(self, now_s: float, frames: int) -> float:
        """Frames per second of the wall clock, over the last seconds."""
        while len(self._seen) > 1 and now_s - self._seen[1][0] > _RATE_OVER_S:
            self._seen.popleft()
        self._seen.append((now_s, frames))
        (before_s, before) = self._seen[0]
        return (frames - before) / (now_s - before_s) if now_s > before_s else 0.0


def _time(status: Mapping[str, Any]) -> str:
    return f"{status['time_s']:.1f} of {status['duration_s']:g} s"


def _facts(status: Mapping[str, Any], rate: float) -> str:
    frames, lost, disagreement = status["frames"], status["lost"], status["disagreement"]
    parts = [
        f"{len(status['alive'])} of {status['agents']} agents alive",
        f"{frames:,} frames ({rate:,.0f}/s)",
        f"{lost:,} lost",
        *(f"{fate} {count:,}" for fate, count in status["discarded"].items()),
        f"{status['late']:,} late",
        *([f"{status['behind_s']:.1f} s behind"] if status["behind_s"] >= _BEHIND_S else []),
        f"disagreement {'–' if disagreement is None else format(disagreement, '.3g')}",
    ]
    return ", ".join(parts)


def _faults(status: Mapping[str, Any], start: str = "") -> str:
    named = [f"{name}: {label}" for name, label in status["faults"].items()]
    return f"{start}in force: {', '.join(named)}" if named else ""


# -- a sweep ---------------------------------------------------------------------------------------------------------


class SweepProgress(Display):
    """Shows the progress of a sweep."""

    def __init__(self, console: Console, name: str) -> None:
        super().__init__(console)
        self._name = name

    def show(self, advance: Advance) -> None:
        """Show the progress, unless it was shown just before."""
        share = advance.finished / advance.total
        if self.due(share, advance.seconds):
            text = words(advance)
            self.show_now(bar(self._name, share, text), text)


def run_shown(plan: SweepPlan, options: SweepOptions, console: Console) -> Sweep:
    """Run a sweep as `run_sweep` does, and show its progress."""
    with SweepProgress(console, plan.name) as progress:
        return run_sweep(plan, options, watch=progress.show)


def words(advance: Advance) -> str:
    """An advance as "412 of 1,000 runs, 11.3 runs/s, 52 s left"."""
    text = f"{advance.finished:,} of {advance.total:,} runs"
    if advance.left_s is None or not advance.seconds or advance.finished == advance.total:
        return text
    return f"{text}, {advance.fresh / advance.seconds:.3g} runs/s, {duration(advance.left_s)} left"


def duration(seconds: float) -> str:
    """A time as "52 s", "3 min 20 s" or "2 h 05 min"."""
    whole = round(seconds)
    if whole < _MINUTE:
        return f"{whole} s"
    if whole < _HOUR:
        return f"{whole // _MINUTE} min {whole % _MINUTE:02} s"
    return f"{whole // _HOUR} h {whole % _HOUR // _MINUTE:02} min"
