"""The live display of a run: a panel in a terminal, elsewhere lines."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from rich.console import Console, Group
from rich.text import Text

from ..sweeps.display import Display, bar

_RATE_OVER_S = 2.0


class Progress(Display):
    """Shows status after status, each as `Status.to_dict` gives it.

    Args:
        console: where to show it.
        name: of the run.
        clock: seconds that ascend, for frames per second of the wall clock.
    """

    def __init__(self, console: Console, name: str, clock: Callable[[], float] = time.monotonic) -> None:
        began_s = clock()
        super().__init__(console, began_s)
        self._name = name
        self._clock = clock
        self._seen = deque([(began_s, 0)])

    def show(self, status: Mapping[str, Any]) -> None:
        """Show a status, unless one was shown just before."""
        now_s, share = self._clock(), status["time_s"] / status["duration_s"]
        if not self.due(share, now_s):
            return
        time_, facts = _time(status), _facts(status, self._rate(now_s, status["frames"]))
        panel = Group(bar(self._name, share, time_), Text(facts), Text(_faults(status), style="yellow"))
        self.show_now(panel, f"{time_}: {facts}{_faults(status, '; ')}")

    def _rate(self, now_s: float, frames: int) -> float:
        """Frames per second of the wall clock, of the last seconds."""
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
        f"disagreement {'–' if disagreement is None else format(disagreement, '.3g')}",
    ]
    return ", ".join(parts)


def _faults(status: Mapping[str, Any], start: str = "") -> str:
    named = [f"{name}: {label}" for name, label in status["faults"].items()]
    return f"{start}in force: {', '.join(named)}" if named else ""
