"""Films and stills of a run in plan view: true and estimated places, links, faults in force."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...transport.links import NANOSECONDS
from ...units import check_above_zero, quantity
from ..record.record import Record
from .plan_view import Carries, Picture, PlanView
from .run_figures import BLACK, BLUE, DARK_GREY, GREEN, PURPLE, SKY, STYLE, VERMILION, check_formats, save

if TYPE_CHECKING:
    from matplotlib.animation import AbstractMovieWriter
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
Advance = Callable[[int, int], None]
"""Called with the number of pictures drawn so far, and that of all."""

FILMS = ("mp4", "gif")
MOST_PICTURES = 3000
_WIDTH_IN, _HEIGHT_IN, _DPI = 5.6, 5.6, 100
_COLOURS = (BLUE, VERMILION, GREEN, PURPLE, SKY, DARK_GREY)
_NAMED_AGENTS = 40
_TRAIL_NS = 2 * NANOSECONDS
_MARGIN, _LEAST_M = 0.12, 0.5
_TURNS = np.linspace(0.0, 2.0 * math.pi, 33)
_CIRCLE = np.stack([np.cos(_TURNS), np.sin(_TURNS)])
_DEVIATIONS = 2.0
_FAULTS_SHOWN = 3
_LIGHTEST = 0.3
_MARGINS = {"left": 0.11, "right": 0.97, "bottom": 0.19, "top": 0.95}


def animate(
    record: Record,
    out: Path,
    span: tuple[int | None, int | None] = (None, None),
    *,
    per_second: float = 10.0,
    speed: float = 1.0,
    film: str | None = None,
    progress: Advance | None = None,
) -> Path:
    """Draw a run, or a span of it, as a film; the path of the file.

    Args:
        record: the run.
        out: folder of the file, `animation.mp4` or `animation.gif`.
        span: beginning and end in nanoseconds; None for those of the run.
        per_second: pictures in a second of the film.
        speed: seconds of the run in a second of the film.
        film: of FILMS; by default mp4 where ffmpeg is found, else gif.
        progress: called after every picture.
    Raises:
        BadInput: no places to draw, no such film here, or more than MOST_PICTURES.
    """
    for name, value in (("pictures per second", per_second), ("speed", speed)):
        check_above_zero(name, value)
    writer, ending = _writer(film, per_second)
    from_ns, until_ns = span[0] or 0, record.last_ns if span[1] is None else min(span[1], record.last_ns)
    step_ns = round(speed * NANOSECONDS / per_second)
    times = range(from_ns, until_ns + 1, max(1, step_ns))
    if len(times) > MOST_PICTURES:
        raise BadInput(
            f"{len(times):,} pictures, more than {MOST_PICTURES:,}: film a part with --from and --until, "
            "or faster with --speed"
        )
    view = PlanView(record)
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"animation.{ending}"
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE):
        figure = Figure(figsize=(_WIDTH_IN, _HEIGHT_IN))
        scene = _Scene(figure, view, from_ns, until_ns)
        with writer.saving(figure, str(path), _DPI):
            for number, time_ns in enumerate(times, start=1):
                scene.show(view.picture(time_ns))
                writer.grab_frame()
                if progress is not None:
                    progress(number, len(times))
    return path


def still(record: Record, out: Path, time_ns: int, formats: Sequence[str] = ("png",)) -> list[Path]:
    """Draw one instant [ns] of a run; the paths of the files, such as `still-2.5s.png`.

    Raises:
        BadInput: no places to draw, no such format, or an instant that the run does not have.
    """
    check_formats(formats)
    if not 0 <= time_ns <= record.last_ns:
        raise BadInput(f"a still at {quantity(time_ns, 'ns')}: the run ends at {quantity(record.last_ns, 'ns')}")
    view, name = PlanView(record), f"still-{time_ns / NANOSECONDS:g}s"
    return save(lambda figure: draw_picture(figure, view, view.picture(time_ns)), name, out, formats)


def draw_picture(figure: Figure, view: PlanView, picture: Picture) -> None:
    """Draw a picture into a figure, in the frame of the whole run."""
    figure.set_size_inches(_WIDTH_IN, _HEIGHT_IN)
    _Scene(figure, view, 0, view.last_ns).show(picture)


def _writer(film: str | None, per_second: float) -> tuple[AbstractMovieWriter, str]:
    """What writes such a film, and how its file ends."""
    from matplotlib.animation import FFMpegWriter, PillowWriter

    if film not in (None, *FILMS):
        raise BadInput(f"a film of format {film!r}: one of {', '.join(FILMS)}")
    if film == "mp4" and not FFMpegWriter.isAvailable():
        raise BadInput("an MP4 needs ffmpeg, which is not found here: install it, or take --format gif")
    if film == "mp4" or (film is None and FFMpegWriter.isAvailable()):
        return FFMpegWriter(fps=per_second, codec="h264"), "mp4"  # type: ignore[arg-type]
    return PillowWriter(fps=per_second), "gif"  # type: ignore[arg-type]


class _Scene:
    """What is drawn once, and the artists that each picture moves."""

    def __init__(self, figure: Figure, view: PlanView, from_ns: int, until_ns: int) -> None:
        from matplotlib.collections import LineCollection, PolyCollection

        self._view = view
        figure.set_layout_engine("none")  # so that nothing jumps from picture to picture
        self._axes = axes = figure.subplots(gridspec_kw=_MARGINS)
        few = len(view.agents) <= len(_COLOURS)
        light = 1.0 if few else max(_LIGHTEST, len(_COLOURS) / len(view.agents))
        self._trails = LineCollection([], colors=[(DARK_GREY, 0.35)], linewidths=0.8, zorder=1)
        self._links = {
            Carries.THROUGH: LineCollection([], colors=[(BLUE, 0.45 * light)], linewidths=light, zorder=2),
            Carries.LOST: LineCollection([], colors=VERMILION, linewidths=light, linestyles="--", zorder=2),
        }
        self._colours = dict(zip(view.agents, _COLOURS if few else [SKY] * len(view.agents), strict=False))
        self._ellipses = {
            agent: PolyCollection([], facecolors=(colour, 0.04), edgecolors=(colour, 0.5), linewidths=0.6, zorder=0.5)
            for agent, colour in self._colours.items()
        }
        self._believed = {
            agent: axes.scatter([], [], s=26 * light, facecolors="none", edgecolors=colour, linewidths=light, zorder=5)
            for agent, colour in self._colours.items()
        }
        for collection in (self._trails, *self._links.values(), *self._ellipses.values()):
            axes.add_collection(collection)
        self._true = axes.scatter([], [], s=18, color=BLACK, zorder=4)
        self._followed = axes.scatter([], [], s=70, color=BLACK, marker="*", zorder=4)
        self._down = axes.scatter([], [], s=40, color=DARK_GREY, marker="x", zorder=4)
        named = view.agents if len(view.agents) <= _NAMED_AGENTS else ()
        self._names = {
            agent: axes.annotate(agent, (0, 0), (4, 4), textcoords="offset points", fontsize=7, zorder=6)
            for agent in named
        }
        self._time = axes.set_title(" ", loc="left", fontsize=9)
        self._faults = axes.set_title(" ", loc="right", fontsize=8, color=VERMILION)
        self._frame(from_ns, until_ns)
        self._legend(figure)

    def _frame(self, from_ns: int, until_ns: int) -> None:
        low, high = self._view.extent(from_ns, until_ns)
        around = max(_LEAST_M, _MARGIN * float((high - low).max()))
        self._axes.set(
            xlim=(low[0] - around, high[0] + around),
            ylim=(low[1] - around, high[1] + around),
            xlabel="x from the centre (m)" if self._view.follows else "x (m)",
            ylabel="y from the centre (m)" if self._view.follows else "y (m)",
            aspect="equal",
        )

    def _legend(self, figure: Figure) -> None:
        from matplotlib.lines import Line2D

        def key(label: str, **look: Any) -> Line2D:
            return Line2D([], [], label=label, **look)

        keys = [key("true place", marker="o", color=BLACK, ls="", ms=4)]
        last = self._view.picture(self._view.last_ns)
        views = last.views
        keys += [key(name, marker="*", color=BLACK, ls="", ms=8) for name in last.followed]
        believers = [agent for agent, view in views.items() if view.places]
        look = {"marker": "o", "mfc": "none", "ls": "", "ms": 5}
        if len(self._colours) <= len(_COLOURS):
            keys += [key(f"as {agent} has it", mec=self._colours[agent], **look) for agent in believers]
        elif believers:
            keys.append(key(f"as agents have it ({len(believers)})", mec=SKY, **look))
        if any(view.covariances for view in views.values()):
            keys.append(key("two standard deviations", marker="o", mfc=(SKY, 0.05), mec=(SKY, 0.5), ls="", ms=9))
        keys.append(key(Carries.THROUGH.value, color=BLUE, alpha=0.45))
        keys.append(key(Carries.LOST.value, color=VERMILION, ls="--"))
        figure.legend(handles=keys, loc="lower center", ncols=3)

    def show(self, picture: Picture) -> None:
        """Move everything to where it is in a picture."""
        for state, lines in self._links.items():
            lines.set_segments(list(_half_edges(picture, state)))
        self._trails.set_segments(
            list(self._view.path(picture.time_ns - _TRAIL_NS, picture.time_ns).transpose(1, 0, 2))
        )
        alive = [place for agent, place in picture.true.items() if agent not in picture.down]
        self._true.set_offsets(_points(alive))
        self._followed.set_offsets(_points(list(picture.followed.values())))
        self._down.set_offsets(_points([picture.true[agent] for agent in picture.down]))
        for agent, text in self._names.items():
            text.xy = tuple(picture.true[agent].tolist())
        for agent, rings in self._believed.items():
            view = picture.views.get(agent)
            places, covariances = (view.places, view.covariances) if view is not None else ({}, {})
            rings.set_offsets(_points([place[:2] for place in places.values()]))
            self._ellipses[agent].set_verts(
                [_ellipse(places[name][:2], covariance) for name, covariance in covariances.items()]
            )
        x, y = (f"{each:.1f}".replace("-", "−") for each in picture.centre.tolist())
        at = f", centre at ({x}, {y}) m" if self._view.follows else ""
        self._time.set_text(f"{picture.time_ns / NANOSECONDS:.1f} s{at}")
        self._faults.set_text(_in_force(picture.faults))


def _half_edges(picture: Picture, state: Carries) -> Iterator[Floats]:
    """The links in a state, each from its source to the middle: the other half is that of the way back."""
    for (source, target), carries in picture.links.items():
        if carries is state:
            here, there = picture.true[source], picture.true[target]
            yield np.array([here, 0.5 * (here + there)])


def _points(places: Sequence[Floats]) -> Floats:
    return np.array(places).reshape(-1, 2)


def _ellipse(place: Floats, covariance: Floats) -> Floats:
    """The outline of two standard deviations about a place, (33, 2)."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(place + (_DEVIATIONS * vectors * np.sqrt(np.maximum(values, 0.0)) @ _CIRCLE).T)


def _in_force(faults: Iterable[str]) -> str:
    """The faults in force on one line, the last of them where they are many."""
    named = list(faults)
    more = f"{len(named) - _FAULTS_SHOWN} more, " if len(named) > _FAULTS_SHOWN else ""
    return more + ", ".join(named[-_FAULTS_SHOWN:])
