"""Small runs of beacons in the twin, and space-time diagrams of them: what links.py draws with."""

# ruff: noqa: TID251 - it is a user of the package
from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.lines import Line2D

from volery.agents.journal import Sent
from volery.agents.plan import Plan
from volery.experiments.figures import BLACK, BLUE, GREEN, VERMILION
from volery.experiments.record import Collector, Record
from volery.experiments.scenario import compile_plan, load_scenario
from volery.experiments.twin import Twin
from volery.transport.faults import LinkFault, LinkName
from volery.transport.links import LinkSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 5.0
MS = 1e6
FATES = {
    "delivered": (BLUE, "o", "delivered"),
    "loss": (VERMILION, "x", "lost"),
    "corrupt": (VERMILION, "P", "corrupt"),
    "cut": (BLACK, "|", "cut"),
    "half-duplex": (GREEN, "s", "receiver was sending"),
    "collision": (VERMILION, "D", "collision"),
}
MARKER_PT = 4.5


# -- runs ---------------------------------------------------------------------------------------------------------


def planned(*fields: str) -> Plan:
    """A plan of beacons: 1 and 2 with a perfect link, and fields such as "links.loss=0.3"."""
    base = ("topology={line: 2}", "links={}", "duration=1 s", "overload=true", "agents={kind: beacon, talkers: [1]}")
    return compile_plan(load_scenario("beacons", (*base, *fields)))


def simulate(*fields: str) -> Record:
    """The record of such a plan, run in the twin."""
    plan = planned(*fields)
    collector = Collector()
    Twin(plan, collector).run()
    return collector.record(plan)


def settings_of(*fields: str) -> LinkSettings:
    """What the link 1>2 is in such a plan."""
    return planned(*fields).links["1", "2"]


def frames(record: Record, source: str, target: str) -> list[tuple[Sent, str, int]]:
    """What a link has transmitted, in order: the transmission, its fate, and when it arrives."""
    heard = {(entry.sequence, entry.copy): entry for entry in record.batches[target, 0].heard if entry.source == source}
    found = []
    for sent in record.batches[source, 0].sent:
        if sent.target == target:
            end = heard.get((sent.sequence, sent.copy))
            fate = sent.verdict if end is None else end.fate
            found.append((sent, fate, released_ns(record, (source, target), sent.due_ns)))
    return found


def released_ns(record: Record, link: LinkName, due_ns: int) -> int:
    """When a frame arrives that is due at an instant: then, or at the end of a fault that holds frames back."""
    for fault in record.faults:
        if (
            isinstance(fault, LinkFault)
            and fault.changes.get("hold")
            and link in fault.links
            and fault.in_force(due_ns)
        ):
            return record.last_ns if fault.until_ns is None else fault.until_ns
    return due_ns


def space_time(axes: Axes, record: Record, from_ms: float, until_ms: float) -> None:
    """Agents as lanes: a bar while a frame is on the air, a line while it travels, a mark at its end."""
    lanes = {agent.name: -row for row, agent in enumerate(record.plan.agents)}
    for source, target in record.plan.links:
        for sent, fate, due_ns in frames(record, source, target):
            start, end, due = (time / MS for time in (sent.start_ns, sent.start_ns + sent.airtime_ns, due_ns))
            if not from_ms <= start <= until_ms:
                continue
            colour, marker, _ = FATES[fate]
            here, there = lanes[source], lanes[target]
            axes.plot([start, end], [here, here], lw=4, color=colour, solid_capstyle="butt", alpha=0.6)
            reach = 1.0 if fate in ("delivered", "corrupt", "half-duplex", "collision") else 0.55
            stop = end + reach * (due - end), here + reach * (there - here)
            dashes = ":" if sent.copy else "-"
            axes.plot([end, stop[0]], [here, stop[1]], dashes, color=colour)
            axes.plot(*stop, marker, ms=MARKER_PT, color=colour, mew=1.2)
    axes.set_yticks(list(lanes.values()), [f"agent {name}" for name in lanes])
    axes.set_ylim(min(lanes.values()) - 0.3, 0.3)
    axes.set_xlim(from_ms, until_ms)
    axes.set_xlabel("time (ms)")


def legend(figure: Figure, *fates: str) -> None:
    """What the marks mean, below the figure."""
    marks = [
        Line2D([], [], color=FATES[fate][0], marker=FATES[fate][1], ms=MARKER_PT, label=FATES[fate][2])
        for fate in fates
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=len(marks))


def counts(record: Record, *links: tuple[str, str]) -> str:
    """What became of the frames of some links."""
    found: dict[str, int] = {}
    for link in links or record.plan.links:
        for _, fate, _ in frames(record, *link):
            found[fate] = found.get(fate, 0) + 1
    return ", ".join(f"{number} {FATES[fate][2]}" for fate, number in sorted(found.items()))
