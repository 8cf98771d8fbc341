"""The live display of a sweep: a bar with the time left in a terminal, elsewhere lines."""

from __future__ import annotations

from rich.console import Console

from .display import Display, bar
from .sweep import Advance, SweepOptions, run_sweep
from .sweep_plan import SweepPlan
from .sweep_results import Sweep

_MINUTE, _HOUR = 60, 3600


class SweepProgress(Display):
    """Shows how far a sweep has come."""

    def __init__(self, console: Console, name: str) -> None:
        super().__init__(console)
        self._name = name

    def show(self, advance: Advance) -> None:
        """Show how far it is now, unless that was shown just before."""
        share = advance.finished / advance.total
        if self.due(share, advance.seconds):
            said = words(advance)
            self.show_now(bar(self._name, share, said), said)


def run_shown(plan: SweepPlan, options: SweepOptions, console: Console) -> Sweep:
    """Carry out a sweep as `run_sweep` does, and show how far it is."""
    with SweepProgress(console, plan.name) as progress:
        return run_sweep(plan, options, watch=progress.show)


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
