"""Settings of time-varying graphs in a scenario: schedules, and the proximity graph of moving agents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Annotated

import networkx as nx
import numpy as np

from ..errors import BadInput
from ..units import Duration, Metres, Period, check_above_zero
from .graph_settings import FIXED, Edges, GraphSettings, Place, check_instant, over_whole_run, seconds
from .graphs import edges, positions
from .naming import natural_key
from .own_graphs import with_link_attributes
from .presence import Edge, Places, Span, TimedGraph, epochs

_MOST_INSTANTS = 1_000_000


@dataclass(frozen=True)
class Epoch:
    """A graph that is valid from an instant on.

    from: when it starts.
    """

    from_: Duration
    graph: Annotated[GraphSettings, FIXED] = field(metadata={"inline": True})


@dataclass(frozen=True)
class Schedule(GraphSettings):
    """A sequence of graphs of the same agents, each valid until the next starts; lists of edges may name any agents.

    schedule: as in [{from: 0 s, ring: 6}, {from: 5 s, line: 6}]; positions are those of the first graph.
    """

    schedule: tuple[Epoch, ...]

    def build(self, seed: int) -> nx.Graph:
        """Refuse to build: the graph changes over time."""
        raise BadInput("a schedule is a graph that changes, and cannot stand here: use another kind")

    def over_time(self, seed: int, until_ns: int, places: Places | None = None) -> TimedGraph:
        """Build the union of all graphs, with the time spans of edges that are not in all."""
        self._check_begins(until_ns)
        graphs = [_graph(epoch, index, seed) for index, epoch in enumerate(self.schedule)]
        everyone = sorted({name for graph in graphs for name in graph}, key=natural_key)
        for index, (epoch, graph) in enumerate(zip(self.schedule, graphs, strict=True)):
            missing = [name for name in everyone if name not in graph]
            if missing and not isinstance(epoch.graph, Edges):
                text = f"agents {', '.join(missing)} of other epochs are not in this one"
                raise BadInput(f"{text}: give all the same agents, or write its edges", (index,))
        begun = [(epoch.from_, edges(graph)) for epoch, graph in zip(self.schedule, graphs, strict=True)]
        timed = over_whole_run(epochs(begun, until_ns), until_ns, everyone, positions(graphs[0]))
        return replace(timed, union=with_link_attributes(timed.union, graphs))

    def shortened(self, until_ns: int) -> tuple[GraphSettings, list[tuple[Place, int]]]:
        """Leave out the graphs that start too late."""
        kept = tuple(epoch for epoch in self.schedule if epoch.from_ < until_ns)
        late: list[tuple[Place, int]] = [
            (("schedule", index), epoch.from_) for index, epoch in enumerate(self.schedule) if epoch.from_ >= until_ns
        ]
        return replace(self, schedule=kept), late

    def _check_begins(self, until_ns: int) -> None:
        if not self.schedule:
            raise BadInput("write a list, as in [{from: 0 s, ring: 6}, {from: 5 s, line: 6}]")
        for index, epoch in enumerate(self.schedule):
            check_instant(epoch.from_, until_ns, (index, "from"))
        if self.schedule[0].from_ != 0:
            raise BadInput("the first graph begins at 0 s", (0, "from"))
        for index, (before, after) in enumerate(pairwise(self.schedule), start=1):
            if after.from_ <= before.from_:
                text = f"begins must ascend, the one before is {seconds(before.from_)}"
                raise BadInput(text, (index, "from"))


def _graph(epoch: Epoch, index: int, seed: int) -> nx.Graph:
    """Build one graph of a schedule; a list of edges need not be connected."""
    try:
        if isinstance(epoch.graph, Edges) and not isinstance(epoch.graph.edges, Mapping):
            graph = nx.Graph(epoch.graph.listed())
            nx.set_node_attributes(graph, epoch.graph.positions or {}, "position")
            return graph
        return epoch.graph.topology(seed)
    except BadInput as error:
        raise BadInput(str(error), (index, FIXED.name_of(type(epoch.graph)))) from error


@dataclass(frozen=True)
class Proximity(GraphSettings):
    """Agents of a world with motion, linked while they are near each other.

    Two agents become neighbours at a distance of `radius` or less, and remain neighbours up to radius + hysteresis. The
    hysteresis prevents frequent changes of an edge between agents at about this distance.

    radius: distance at which agents become neighbours.
    every: sampling period of the distances; the graph of an instant is valid until the next.
    hysteresis: additional distance up to which agents remain neighbours.
    """

    radius: Metres
    every: Period = 100_000_000
    hysteresis: Metres = 0.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_above_zero("radius", self.radius, "m")
        if not self.hysteresis >= 0:
            raise BadInput(f"hysteresis is {self.hysteresis:g} m, it must be at least 0")

    def build(self, seed: int) -> nx.Graph:
        """Refuse to build: the graph changes over time."""
        raise BadInput("proximity is a graph that changes, and cannot stand here: use another kind")

    def over_time(self, seed: int, until_ns: int, places: Places | None = None) -> TimedGraph:
        """Build the union of all edges, with the time spans in which agents are near each other."""
        if places is None:
            raise BadInput("nobody moves: add a world in which agents do, `world: {kind: moving, …}`")
        if self.every < 1 or until_ns > self.every * _MOST_INSTANTS:
            text = f"in {seconds(until_ns)} this is more than a million looks: make it longer"
            raise BadInput(text, ("every",))
        names, spans = self.near(places, until_ns)
        return over_whole_run(spans, until_ns, names)

    def near(self, places: Places, until_ns: int) -> tuple[list[str], dict[Edge, list[Span]]]:
        """The agents, and edge → the time spans in which its ends are near each other, up to `until_ns`."""
        names = sorted(places(0), key=natural_key)
        firsts, seconds_ = np.triu_indices(len(names), k=1)
        linked = np.zeros(len(firsts), dtype=bool)
        since: dict[int, int] = {}
        found: dict[Edge, list[Span]] = {}
        for time_ns in range(0, until_ns, self.every):
            here = places(time_ns)
            points = np.array([here[name] for name in names])
            apart = np.linalg.norm(points[firsts] - points[seconds_], axis=1)
            now = apart <= np.where(linked, self.radius + self.hysteresis, self.radius)
            for pair in np.flatnonzero(now != linked).tolist():
                if now[pair]:
                    since[pair] = time_ns
                else:
                    ends = names[firsts[pair]], names[seconds_[pair]]
                    found.setdefault(ends, []).append((since.pop(pair), time_ns))
            linked = now
        for pair, start in since.items():
            found.setdefault((names[firsts[pair]], names[seconds_[pair]]), []).append((start, until_ns))
        return names, found


GRAPHS = replace(FIXED, built_in={**FIXED.built_in, "schedule": Schedule, "proximity": Proximity})
Topology = Annotated[GraphSettings, GRAPHS]
"""A scenario's `topology:`."""
