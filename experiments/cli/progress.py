"""The live display of a run: a panel in a terminal, elsewhere a line at each tenth of the run."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Self

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

_LINES = 10
_REDRAW_S = 0.1
_RATE_OVER_S = 2.0
_BAR = 40


class Progress:
    """Shows status after status, each as `Status.to_dict` gives it.

    Args:
        console: where to show it.
        name: of the run.
        clock: seconds that ascend, for frames per second of the wall clock.
    """

    def __init__(self, console: Console, name: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._console = console
        self._name = name
        self._clock = clock
        self._seen: deque[tuple[float, int]] = deque()
        self._live = Live(console=console, auto_refresh=False, transient=True) if console.is_terminal else None
        self._drawn_s = -_REDRAW_S
        self._line = 0

    def __enter__(self) -> Self:
        """Begin to show."""
        self._seen.append((self._clock(), 0))
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the terminal as it was."""
        if self._live is not None:
            self._live.stop()

    def show(self, status: Mapping[str, Any]) -> None:
        """Show a status, unless one was shown just before."""
        now_s = self._clock()
        line = int(_LINES * status["time_s"] / status["duration_s"])
        if self._live is not None and now_s - self._drawn_s >= _REDRAW_S:
            self._drawn_s = now_s
            self._live.update(self._panel(status, self._rate(now_s, status["frames"])), refresh=True)
        elif self._live is None and line > self._line:
            self._line = line
            text = f"{_time(status)}: {_facts(status, self._rate(now_s, status['frames']))}{_faults(status, '; ')}"
            self._console.print(text, markup=False, soft_wrap=True)

    def _rate(self, now_s: float, frames: int) -> float:
        """Frames per second of the wall clock, of the last seconds."""
        while len(self._seen) > 1 and now_s - self._seen[1][0] > _RATE_OVER_S:
            self._seen.popleft()
        self._seen.append((now_s, frames))
        (before_s, before) = self._seen[0]
        return (frames - before) / (now_s - before_s) if now_s > before_s else 0.0

    def _panel(self, status: Mapping[str, Any], rate: float) -> Group:
        head = Table.grid(padding=(0, 2))
        bar = ProgressBar(total=status["duration_s"], completed=status["time_s"], width=_BAR)
        head.add_row(Text(self._name, style="bold"), bar, _time(status))
        return Group(head, Text(_facts(status, rate)), Text(_faults(status), style="yellow"))


def _time(status: Mapping[str, Any]) -> str:
    return f"{status['time_s']:.1f} of {status['duration_s']:g} s"


def _facts(status: Mapping[str, Any], rate: float) -> str:
    frames, lost, disagreement = status["frames"], status["lost"], status["disagreement"]
    parts = [
        f"{len(status['alive'])} of {status['agents']} agents alive",
        f"{frames:,} frames ({rate:,.0f}/s)",
        f"{lost:,} lost",
        f"{status['late']:,} late",
        f"disagreement {'–' if disagreement is None else format(disagreement, '.3g')}",
    ]
    return ", ".join(parts)


def _faults(status: Mapping[str, Any], start: str = "") -> str:
    named = [f"{name}: {label}" for name, label in status["faults"].items()]
    return f"{start}in force: {', '.join(named)}" if named else ""
