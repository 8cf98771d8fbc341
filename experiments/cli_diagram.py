"""The options of `volery plot` for a space-time diagram."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..errors import BadInput
from .cli_window import WHOLE, SpanOptions, known
from .record import load
from .space_time import plot_space_time
from .trace import agents_of

_AGENTS = "Agents between which frames are shown, with commas; all by default."
_SPACE_TIME = "Draw the space-time diagram of a window, by default of the frames about the first fault."
SpaceTime = Annotated[bool, Parameter("--space-time", help=_SPACE_TIME)]
Agents = Annotated[tuple[str, ...], Parameter("--agents", help=_AGENTS)]


@Parameter(name="*")
@dataclass(frozen=True)
class Diagram:
    """Whether a space-time diagram is wanted, and of what."""

    space_time: SpaceTime = False
    span: SpanOptions = WHOLE
    agents: Agents = ()

    def draw(self, folder: Path, out: Path | None, formats: Sequence[str]) -> list[Path]:
        """Draw it if it is wanted; the paths of the files.

        Raises:
            BadInput: a window without a diagram, or one that does not fit the run.
        """
        if not self.space_time:
            if self.span != WHOLE or self.agents:
                raise BadInput("--from, --until and --agents are of the space-time diagram: add --space-time")
            return []
        record = load(folder)
        agents = known("--agents", self.agents, agents_of(record))
        return plot_space_time(record, out or folder / "figures", self.span.bounds(record), agents, formats)


NO_DIAGRAM = Diagram()
