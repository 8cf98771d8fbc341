"""What the displays of a run and of a sweep share: drawn in place in a terminal, elsewhere a line now and then."""

from __future__ import annotations

import math
from typing import Self

from rich.console import Console, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

_TENTHS = 10
_REDRAW_S = 0.1
_SILENT_S = 60.0
_BAR = 40


class Display:
    """Shows how far some work is; it knows no clock, times are handed in.

    Args:
        console: where to show it.
        since_s: when the work began [s], on the clock of `due`; without it the very first state is shown too.
    """

    def __init__(self, console: Console, since_s: float = -math.inf) -> None:
        self._console = console
        self._live = Live(console=console, auto_refresh=False, transient=True) if console.is_terminal else None
        self._shown_s = since_s
        self._tenth = 0

    def __enter__(self) -> Self:
        """Begin to show."""
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the terminal as it was."""
        if self._live is not None:
            self._live.stop()

    def due(self, share: float, now_s: float) -> bool:
        """Whether to show what is so now: ten times a second in a terminal, elsewhere at each tenth and each minute.

        Args:
            share: of the work that is done, 0 to 1.
            now_s: seconds that ascend; a minute counts from the last time that something was due.
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
    """Name, bar and words in a row."""
    row = Table.grid(padding=(0, 2))
    row.add_row(Text(name, style="bold"), ProgressBar(total=1.0, completed=share, width=_BAR), Text(words))
    return row
