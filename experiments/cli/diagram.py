"""The options of `volery plot` for what is drawn of a window of a run: a space-time diagram, a film, stills."""

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

_AGENTS = "Agents between which frames are shown, with commas; all by default."
_SPACE_TIME = "Draw the space-time diagram of a window, by default of the frames about the first fault."
_ANIMATE = "Film the run in plan view, as MP4 where ffmpeg is found and else as GIF; --format mp4 or gif says which."
_STILL = "Draw one instant of that film, e.g. 2.5s; may be given several times."
_FPS = "Pictures in a second of the film."
_SPEED = "Seconds of the run in a second of the film."
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
    """Which of them are wanted, and of what."""

    space_time: SpaceTime = False
    animate: Animate = False
    still: Still = ()
    fps: Fps = _FPS_DEFAULT
    speed: Speed = _SPEED_DEFAULT
    span: SpanOptions = WHOLE
    agents: Agents = ()

    def draw(self, record: Record, into: Path, formats: Sequence[str]) -> list[Path]:
        """Draw those that are wanted; the paths of the files.

        Raises:
            BadInput: an option of what is not wanted, or a window that does not fit the run.
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
        """Nothing silently has no effect."""
        if self.agents and not self.space_time:
            raise BadInput("--agents is of the space-time diagram: add --space-time")
        if self.span != WHOLE and not (self.space_time or self.animate):
            raise BadInput("--from and --until are of the diagram and of the film: add --space-time or --animate")
        if (self.fps, self.speed) != (_FPS_DEFAULT, _SPEED_DEFAULT) and not self.animate:
            raise BadInput("--fps and --speed are of the film: add --animate")

    def _film(self, record: Record, out: Path, formats: Sequence[str]) -> Path:
        """The film, in the first format that is asked for."""
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
    """Shows how far a film is: a bar in a terminal, elsewhere a line at each tenth."""
    console = output()
    if not console.is_terminal:
        yield _say
        return
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("film", total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def _say(done: int, total: int) -> None:
    if done * _LINES // total > (done - 1) * _LINES // total:
        print_plain(f"film: {done} of {total} pictures")


NO_DIAGRAM = Diagram()
