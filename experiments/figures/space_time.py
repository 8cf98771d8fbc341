"""Space-time diagrams: agents as lanes, a bar while a frame is on the air, a line on its way, a mark at its end."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ...errors import BadInput
from ...topologies import natural_key
from ...transport.faults import Fault, LinkFault
from ...transport.links import ACCESS, COLLISION, CORRUPT, CUT, DELIVERED, HALF_DUPLEX, LOST, NANOSECONDS
from ..record.frame_fates import (
    IN_FLIGHT,
    MISSING,
    QUEUE,
    RECEIVER_DOWN,
    REFUSED,
    SENDER_DOWN,
    UNKNOWN,
    FrameFate,
    frame_fates,
)
from ..record.record import Record
from ..scenario.fault_labels import fault_label
from .run_figures import BLACK, BLUE, DARK_GREY, GREEN, GREY, PAGE_IN, PURPLE, SKY, VERMILION, check_formats, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

NAME = "space-time"
MOST_FRAMES = 3000
_FIRST_FRAMES, _FRAMES_PER_AGENT, _BEFORE = 40, 6, 0.3
_LANE_IN, _AROUND_IN, _LEAST_IN = 0.3, 1.1, 2.4
_BAR, _APART, _BAND = 2.6, 0.09, 0.42
_ENDS_ON_THE_WAY = 0.4
_MILLISECONDS = 2 * NANOSECONDS
_LEVELS, _CLOSE, _LEGEND_COLUMNS = 3, 0.12, 7
_STROKES = "x|12"


class Look(NamedTuple):
    """How a fate is drawn: colour, mark at the end, and its name in the legend; `reach`: where its line ends."""

    colour: str
    mark: str
    name: str
    reach: float = 1.0


LOOKS = {
    DELIVERED: Look(BLUE, "o", "delivered"),
    LOST: Look(VERMILION, "x", "lost", _ENDS_ON_THE_WAY),
    CUT: Look(BLACK, "|", "cut", _ENDS_ON_THE_WAY),
    HALF_DUPLEX: Look(GREEN, "s", "receiver was sending"),
    COLLISION: Look(PURPLE, "D", "collision"),
    CORRUPT: Look(VERMILION, "P", "corrupt"),
    RECEIVER_DOWN: Look(BLACK, "v", "receiver down"),
    SENDER_DOWN: Look(BLACK, "^", "sender down", 0.0),
    ACCESS: Look(PURPLE, "X", "gave up access", 0.0),
    QUEUE: Look(GREEN, "1", "queue full", 0.0),
    REFUSED: Look(GREEN, "2", "too long", 0.0),
    IN_FLIGHT: Look(BLUE, "", "in flight at the end"),
    UNKNOWN: Look(DARK_GREY, "$?$", "unknown"),
    MISSING: Look(DARK_GREY, "$!$", "missing"),
}


@dataclass(frozen=True)
class Window:
    """A span [from, until) of nominal time, and the agents between which frames are shown, in the order of lanes."""

    from_ns: int
    until_ns: int
    agents: tuple[str, ...]

    def shows(self, frame: FrameFate) -> bool:
        """Whether any of a frame lies in it."""
        begin = frame.start_ns if frame.start_ns is not None else frame.dropped_ns
        end = frame.due_ns if frame.due_ns is not None else begin
        if begin is None or end is None:
            return False
        inside = begin < self.until_ns and end >= self.from_ns
        return inside and frame.source in self.agents and frame.target in self.agents


def plot_space_time(
    record: Record,
    out: Path,
    span: tuple[int | None, int | None] = (None, None),
    agents: Collection[str] = (),
    formats: Sequence[str] = ("png", "pdf"),
) -> list[Path]:
    """Draw the space-time diagram of a window of a run; the paths of the files.

    Args:
        record: the run.
        out: the folder of the files.
        span: beginning and end of the window in nanoseconds; what is None is chosen, see `choose_window`.
        agents: between whom; all by default.
        formats: of the files.
    Raises:
        BadInput: no such format, or more frames than can be told apart.
    """
    check_formats(formats)
    window = choose_window(record, span, agents)

    def draw(figure: Figure) -> None:
        figure.set_size_inches(PAGE_IN, max(_LEAST_IN, _AROUND_IN + _LANE_IN * len(window.agents)))
        marks = draw_space_time(figure.subplots(), record, window)
        if marks:
            figure.legend(handles=marks, loc="outside lower center", ncols=min(len(marks), _LEGEND_COLUMNS))

    return save(draw, NAME, out, formats)


def choose_window(
    record: Record,
    span: tuple[int | None, int | None],
    agents: Collection[str] = (),
) -> Window:
    """The window that is asked for; what is left open is chosen so that some frames about the first fault are seen.

    Raises:
        BadInput: more frames than can be told apart.
    """
    from_ns, until_ns = span
    names = sorted(agents or {agent.name for agent in record.plan.agents}, key=natural_key)
    everything = Window(0, record.last_ns, tuple(names))
    everybodys = [frame for frames in frame_fates(record).values() for frame in frames]
    starts = sorted(frame.start_ns for frame in everybodys if frame.start_ns is not None and everything.shows(frame))
    first, last = _about(starts, record, max(_FIRST_FRAMES, _FRAMES_PER_AGENT * len(names)), span)
    begin, end = first if from_ns is None else from_ns, last if until_ns is None else until_ns
    window = Window(begin, max(end, begin + 1), tuple(names))
    count = sum(map(window.shows, everybodys))
    if count > MOST_FRAMES:
        raise BadInput(
            f"{count:,} frames are in the window, more than {MOST_FRAMES:,} cannot be told apart: "
            "narrow it with --from, --until or --agents"
        )
    return window


def _about(starts: Sequence[int], record: Record, count: int, span: tuple[int | None, int | None]) -> tuple[int, int]:
    """A span with so many frames: from its beginning on, or before its end, or about the first fault."""
    from_ns, until_ns = span
    if not starts:
        return 0, record.last_ns
    if from_ns is not None:
        begin = sum(start < from_ns for start in starts)
    elif until_ns is not None:
        begin = sum(start < until_ns for start in starts) - count
    else:
        fault_ns = next((fault.at_ns for fault in record.faults if fault.at_ns > starts[0]), 0)
        begin = sum(start < fault_ns for start in starts) - int(_BEFORE * count)
    begin = max(0, min(begin, len(starts) - 1))
    end = begin + count
    return starts[begin], starts[end] if end < len(starts) else record.last_ns


def draw_space_time(axes: Axes, record: Record, window: Window) -> list[Line2D]:
    """Draw a window into axes; the marks that occur, for a legend."""
    unit, name = (1e6, "ms") if window.until_ns - window.from_ns < _MILLISECONDS else (1e9, "s")
    lanes = {agent: -row for row, agent in enumerate(window.agents)}
    shown = [frame for frames in frame_fates(record).values() for frame in frames if window.shows(frame)]
    for lane in lanes.values():
        axes.axhline(lane, color=GREY, linewidth=0.6, zorder=0.5)
    _draw_bars(axes, shown, lanes, unit)
    for frame in shown:
        _draw_way(axes, frame, lanes, unit)
    _shade(axes, record.faults, len(record.plan.links), window, lanes, unit)
    axes.set_xlim(window.from_ns / unit, window.until_ns / unit)
    axes.set_ylim(min(lanes.values()) - 0.6, 0.6)
    axes.set_yticks(list(lanes.values()), list(lanes))
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.set_ylabel("agent")
    axes.set_xlabel(f"time ({name})")
    return list(_marks(shown))


def _beside(frame: FrameFate, lanes: Mapping[str, int]) -> float:
    """Where a frame leaves: beside the lane of its source, on the side of its target."""
    here, there = lanes[frame.source], lanes[frame.target]
    return here + (_APART if there > here else -_APART)


def _draw_bars(axes: Axes, frames: Iterable[FrameFate], lanes: Mapping[str, int], unit: float) -> None:
    """When a transceiver was on the air; what is sent to several at once is drawn once on each side."""
    bars = {
        (_beside(frame, lanes), frame.start_ns / unit, (frame.start_ns + frame.airtime_ns) / unit)
        for frame in frames
        if frame.start_ns is not None and frame.airtime_ns is not None
    }
    for side, start, end in sorted(bars):
        axes.plot([start, end], [side, side], color=SKY, linewidth=_BAR, solid_capstyle="butt", zorder=1)


def _draw_way(axes: Axes, frame: FrameFate, lanes: Mapping[str, int], unit: float) -> None:
    """From the last bit out to due, as far as the frame came, and from there to when it was handed over."""
    look, side, there = LOOKS[frame.fate], _beside(frame, lanes), lanes[frame.target]
    if frame.start_ns is None or frame.due_ns is None:
        time = frame.dropped_ns if frame.dropped_ns is not None else frame.due_ns
        axes.plot([(time or 0) / unit], [side], **_mark(look))
        return
    end, due = (frame.start_ns + (frame.airtime_ns or 0)) / unit, frame.due_ns / unit
    stop = end + look.reach * (due - end), side + look.reach * (there - side)
    dashes = ":" if frame.copy else "-"
    axes.plot([end, stop[0]], [side, stop[1]], color=look.colour, linestyle=dashes, linewidth=0.7, alpha=0.85)
    if frame.handed_ns is not None and frame.handed_ns > frame.due_ns and frame.fate == DELIVERED:
        colour = look.colour if frame.behind_ns is None else VERMILION
        axes.plot([due, frame.handed_ns / unit], [there, there], color=colour, linestyle=":", linewidth=1.2)
        stop = frame.handed_ns / unit, there
    axes.plot([stop[0]], [stop[1]], **_mark(look, late=frame.behind_ns is not None))


def _mark(look: Look, *, late: bool = False) -> dict[str, Any]:
    """A mark at the end of a frame; a small one where all is well."""
    stroke = look.mark in _STROKES
    return {
        "marker": look.mark,
        "color": look.colour,
        "markersize": 2.4 if look.mark == "o" else 4.5 if stroke else 4.0,
        "markeredgewidth": 1.2 if late or stroke else 0.0,
        "markeredgecolor": VERMILION if late else look.colour,
        "linestyle": "none",
        "zorder": 3,
    }


def _shade(
    axes: Axes, faults: Iterable[Fault], link_count: int, window: Window, lanes: Mapping[str, int], unit: float
) -> None:
    """Faults of links over all lanes, those of an agent over its own; their names above."""
    level, before_ns = 0, -window.until_ns
    for fault in faults:
        until_ns = window.until_ns if fault.until_ns is None else min(fault.until_ns, window.until_ns)
        from_ns = max(fault.at_ns, window.from_ns)
        if from_ns >= until_ns or not (isinstance(fault, LinkFault) or fault.agent in lanes):
            continue
        left, width = from_ns / unit, (until_ns - from_ns) / unit
        if isinstance(fault, LinkFault):
            axes.axvspan(left, left + width, color=GREY, alpha=0.45, linewidth=0, zorder=0)
        else:
            middle = lanes[fault.agent]
            bars = axes.broken_barh([(left, width)], (middle - _BAND, 2 * _BAND), facecolor=GREY, zorder=0.2)
            bars.set(hatch="////", edgecolor="white", linewidth=0)
        level = level + 1 if from_ns - before_ns < _CLOSE * (window.until_ns - window.from_ns) else 0
        before_ns = from_ns
        axes.annotate(
            fault_label(fault, link_count),
            (left, 1.0),
            xycoords=axes.get_xaxis_transform(),
            xytext=(0, 2 + 7 * (level % _LEVELS)),
            textcoords="offset points",
            fontsize=6,
            color=DARK_GREY,
        )


def _marks(frames: Collection[FrameFate]) -> Iterator[Line2D]:
    from matplotlib.lines import Line2D

    if any(frame.airtime_ns for frame in frames):
        yield Line2D([], [], color=SKY, linewidth=_BAR, label="on the air")
    yield from fate_marks(frame.fate for frame in frames)
    if any(frame.copy for frame in frames):
        yield Line2D([], [], color=BLUE, linestyle=":", linewidth=0.8, label="duplicate")
    if any(frame.behind_ns is not None for frame in frames):
        yield Line2D([], [], **_mark(LOOKS[DELIVERED], late=True), label="late")


def fate_marks(fates: Iterable[str]) -> list[Line2D]:
    """The marks of some fates for a legend, each once, in the order of LOOKS."""
    from matplotlib.lines import Line2D

    wanted = set(fates)
    looks = (look for fate, look in LOOKS.items() if fate in wanted)
    return [Line2D([], [], **{**_mark(look), "linestyle": "-", "linewidth": 0.8}, label=look.name) for look in looks]
