"""Small runs of beacons in the twin, and space-time diagrams of them: what links.py draws with."""

# ruff: noqa: TID251 - it is a user of the package
from __future__ import annotations

from typing import TYPE_CHECKING

from volery.agents.plan import Plan
from volery.experiments.figures.space_time import LOOKS, Window, draw_space_time, fate_marks
from volery.experiments.record.frame_fates import FrameFate, frame_fates
from volery.experiments.record.record import Record
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import recorded
from volery.transport.links import LinkSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 5.0
MS = 1e6


# -- runs ---------------------------------------------------------------------------------------------------------


def planned(*fields: str) -> Plan:
    """A plan of beacons: 1 and 2 with a perfect link, and fields such as "links.loss=0.3"."""
    base = ("topology={line: 2}", "links={}", "duration=1 s", "overload=true", "agents={kind: beacon, talkers: [1]}")
    return load_scenario("beacons", (*base, *fields)).plan


def simulate(*fields: str) -> Record:
    """The record of such a plan, run in the twin."""
    plan = planned(*fields)
    return recorded(plan)


def settings_of(*fields: str) -> LinkSettings:
    """What the link 1>2 is in such a plan."""
    return planned(*fields).links["1", "2"]


def frames(record: Record, source: str, target: str) -> list[tuple[FrameFate, str, int]]:
    """What a link has transmitted, in order: the frame, its fate, and when it was handed over, or is due."""
    sent = [frame for frame in frame_fates(record)[source, target] if frame.start_ns is not None]
    return [(frame, frame.fate, frame.handed_ns or frame.due_ns or record.last_ns) for frame in sent]


def space_time(axes: Axes, record: Record, from_ms: float, until_ms: float) -> None:
    """Draw a window of a run as `volery plot --space-time` does."""
    window = Window(int(from_ms * MS), int(until_ms * MS), tuple(agent.name for agent in record.plan.agents))
    draw_space_time(axes, record, window)


def legend(figure: Figure, *fates: str) -> None:
    """What the marks mean, below the figure."""
    marks = fate_marks(fates)
    figure.legend(handles=marks, loc="outside lower center", ncols=len(marks))


def counts(record: Record, *links: tuple[str, str]) -> str:
    """What became of the frames of some links."""
    found: dict[str, int] = {}
    for link in links or record.plan.links:
        for _, fate, _ in frames(record, *link):
            found[fate] = found.get(fate, 0) + 1
    return ", ".join(f"{number} {LOOKS[fate].name}" for fate, number in sorted(found.items()))
