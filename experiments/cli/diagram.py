"""Options of `volery plot` for a window of a run: space-time diagram, animation, stills."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.progress import Progress

from ...errors import BadInput
from ..analysis.frame_trace import agents_of
from ..figures.animation import FILMS, Advance, animate, still
from ..figures.space_time import plot_space_time
from ..record.record import Record
from .output import output, print_plain
from .window import WHOLE, SpanOptions, instant, known

_AGENTS = "Agents of the space-time diagram, separated by commas; by default all."
_SPACE_TIME = "Draw the space-time diagram of a window; by default of the frames around the first fault."
_ANIMATE = "Animate the run in plan view, as MP4 if ffmpeg is found, else as GIF; or choose with --format mp4 or gif."
_STILL = "Draw one instant of the animation, e.g. 2.5s; repeatable."
_FPS = "Frames per second of the animation."
_SPEED = "Nominal seconds per second of the animation."
SpaceTime = Annotated[bool, Parameter("--space-time", help=_SPACE_TIME)]
Agents = Annotated[tuple[str, ...], Parameter("--agents", help=_AGENTS)]
Animate = Annotated[bool, Parameter("--animate", help=_ANIMATE)]
Still = Annotated[tuple[str, ...], Parameter("--still", help=_STILL)]
Fps = Annotated[float, Parameter("--fps", help=_FPS)]
Speed = Annotated[float, Parameter("--speed", help=_SPEED)]
_LINES, _FPS_DEFAULT, _SPEED_DEFAULT = 10, 10.0, 1.0


@Parameter(name="*")
@dataclass(frozen=True)
class Diagram:
    """The diagrams to draw and their window."""

    space_time: SpaceTime = False
    animate: Animate = False
    still: Still = ()
    fps: Fps = _FPS_DEFAULT
    speed: Speed = _SPEED_DEFAULT
    span: SpanOptions = WHOLE
    agents: Agents = ()

    def draw(self, record: Record, into: Path, formats: Sequence[str]) -> list[Path]:
        """Draw the diagrams; the paths of the files.

        Raises:
            BadInput: an option of a diagram that is not drawn, or a window outside of the run.
        """
        self._check()
        if not (self.space_time or self.animate or self.still):
            return []
        films = [each for each in formats if each in FILMS] if self.animate else []
        pictures = [each for each in formats if each not in films]
        if not pictures and (self.space_time or self.still):
            raise BadInput(f"--format {films[0]} is for the film alone: name one for the pictures too, such as png")
        paths = []
        if self.space_time:
            agents = known("--agents", self.agents, agents_of(record))
            paths += plot_space_time(record, into, self.span.bounds(record), agents, pictures)
        for text in self.still:
            paths += still(record, into, instant("--still", text), pictures)
        if self.animate:
            paths.append(self._film(record, into, films))
        return paths

    def _check(self) -> None:
        """Check that every option has an effect."""
        if self.agents and not self.space_time:
            raise BadInput("--agents is of the space-time diagram: add --space-time")
        if self.span != WHOLE and not (self.space_time or self.animate):
            raise BadInput("--from and --until are of the diagram and of the film: add --space-time or --animate")
        if (self.fps, self.speed) != (_FPS_DEFAULT, _SPEED_DEFAULT) and not self.animate:
            raise BadInput("--fps and --speed are of the film: add --animate")

    def _film(self, record: Record, out: Path, formats: Sequence[str]) -> Path:
        """The path of the animation."""
        if len(formats) > 1:
            raise BadInput(f"--format {' and '.join(formats)}: a film is made in one of them at a time")
        film = formats[0] if formats else None
        with _shown() as progress:
            return animate(
                record,
                out,
                self.span.bounds(record),
                per_second=self.fps,
                speed=self.speed,
                film=film,
                progress=progress,
            )


@contextmanager
def _shown() -> Iterator[Advance]:
    """Progress of an animation: a bar in a terminal, elsewhere a line at each tenth."""
    console = output()
    if not console.is_terminal:
        yield _print_tenth
        return
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("film", total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def _print_tenth(done: int, total: int) -> None:
    if done * _LINES // total > (done - 1) * _LINES // total:
        print_plain(f"film: {done} of {total} pictures")


NO_DIAGRAM = Diagram()
