"""The live display of a sweep: a bar with the time left in a terminal, elsewhere a line at each tenth."""

from __future__ import annotations

from typing import Self

from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from .sweep import Advance

_LINES = 10
_BAR = 40
_MINUTE, _HOUR = 60, 3600


class SweepProgress:
    """Shows how far a sweep has come."""

    def __init__(self, console: Console, name: str) -> None:
        self._console = console
        self._name = name
        self._live = Live(console=console, auto_refresh=False, transient=True) if console.is_terminal else None
        self._line: int | None = None

    def __enter__(self) -> Self:
        """Begin to show."""
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the terminal as it was."""
        if self._live is not None:
            self._live.stop()

    def show(self, advance: Advance) -> None:
        """Show how far it is now."""
        if self._live is not None:
            head = Table.grid(padding=(0, 2))
            bar = ProgressBar(total=advance.total, completed=advance.finished, width=_BAR)
            head.add_row(self._name, bar, words(advance))
            self._live.update(head, refresh=True)
            return
        line = _LINES * advance.finished // advance.total
        if line != self._line:
            self._line = line
            self._console.print(words(advance), markup=False, soft_wrap=True)


def words(advance: Advance) -> str:
    """An advance as "412 of 1,000 runs, 11.3 runs/s, 52 s left"."""
    said = f"{advance.finished:,} of {advance.total:,} runs"
    if advance.left_s is None or not advance.seconds or advance.finished == advance.total:
        return said
    return f"{said}, {advance.fresh / advance.seconds:.3g} runs/s, {duration(advance.left_s)} left"


def duration(seconds: float) -> str:
    """A time as "52 s", "3 min 20 s" or "2 h 05 min"."""
    whole = round(seconds)
    if whole < _MINUTE:
        return f"{whole} s"
    if whole < _HOUR:
        return f"{whole // _MINUTE} min {whole % _MINUTE:02} s"
    return f"{whole // _HOUR} h {whole % _HOUR // _MINUTE:02} min"
