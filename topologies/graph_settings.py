"""Settings of graphs in a scenario; each builds its graph."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import networkx as nx

from ..errors import BadInput
from ..kinds import Kinds
from ..units import BareMetres, Count, Nanoseconds, Probability
from .arrays import MODULE_SPACING, Cell, four_module_array, hexagonal, random_hexagonal, sixteen_module_array
from .files import read
from .graphs import Position, from_edges
from .naming import check_name
from .presence import Edge, Places, Span, TimedGraph, timed
from .random_graphs import erdos_renyi, geometric, small_world
from .regular import complete, grid, line, ring, star

Place = tuple[str | int, ...]
"""Place of a value relative to the settings."""
_FIXED_ARRAYS = {4: four_module_array, 16: sixteen_module_array}


@dataclass(frozen=True)
class GraphSettings:
    """Settings of a graph; `plain`: number of first fields that the value of the kind's name gives, as in `ring: 6`."""

    plain: ClassVar[int] = 1

    @abstractmethod
    def build(self, seed: int) -> nx.Graph:
        """Build the graph; `seed` is that of the run, for random graphs without a seed.

        Raises:
            BadInput: the generator refuses the settings.
        """

    def over_time(self, seed: int, until_ns: int, places: Places | None = None) -> TimedGraph:
        """Build the graph over the time [0, until_ns).

        Args:
            seed: seed of the run.
            until_ns: end of the run.
            places: positions of moving agents.
        Raises:
            BadInput: as `build`, with the place relative to these settings.
        """
        return TimedGraph(self.build(seed))

    def shortened(self, until_ns: int) -> tuple[GraphSettings, list[tuple[Place, int]]]:
        """These settings without what starts at `until_ns` or later, and place and start of each part left out."""
        return self, []


@dataclass(frozen=True)
class Line(GraphSettings):
    """Each agent linked to the next.

    count: number of agents.
    spacing: distance of neighbours on the line.
    """

    count: Count
    spacing: BareMetres = 1.0

    def build(self, seed: int) -> nx.Graph:
        """As `line`."""
        return line(self.count, self.spacing)


@dataclass(frozen=True)
class Ring(GraphSettings):
    """Each agent linked to the next and the last to the first.

    count: number of agents, at least 3.
    spacing: length of the sides of the regular polygon.
    """

    count: Count
    spacing: BareMetres = 1.0

    def build(self, seed: int) -> nx.Graph:
        """As `ring`."""
        return ring(self.count, self.spacing)


@dataclass(frozen=True)
class Star(GraphSettings):
    """Agent 1 linked to all others.

    count: number of agents.
    spacing: distance of the others from agent 1.
    """

    count: Count
    spacing: BareMetres = 1.0

    def build(self, seed: int) -> nx.Graph:
        """As `star`."""
        return star(self.count, self.spacing)


@dataclass(frozen=True)
class Complete(GraphSettings):
    """Every agent linked to every other, without positions.

    count: number of agents.
    """

    count: Count

    def build(self, seed: int) -> nx.Graph:
        """As `complete`."""
        return complete(self.count)


@dataclass(frozen=True)
class Grid(GraphSettings):
    """A square grid, numbered row by row.

    rows: number of rows.
    columns: number of columns.
    spacing: distance of neighbours.
    """

    plain: ClassVar[int] = 2

    rows: Count
    columns: Count
    spacing: BareMetres = 1.0

    def build(self, seed: int) -> nx.Graph:
        """As `grid`."""
        return grid(self.rows, self.columns, self.spacing)


@dataclass(frozen=True)
class Hexagonal(GraphSettings):
    """An array of flying-array modules; 4 and 16 without a seed are the arrays of the paper, others are random.

    count: number of modules.
    seed: seed of a random array; by default that of the run.
    spacing: distance of the centres of neighbours.
    """

    count: Count
    seed: int | None = None
    spacing: BareMetres = MODULE_SPACING

    def build(self, seed: int) -> nx.Graph:
        """As `four_module_array`, `sixteen_module_array` or `random_hexagonal`."""
        if self.seed is None and self.count in _FIXED_ARRAYS:
            return _FIXED_ARRAYS[self.count](self.spacing)
        return random_hexagonal(self.count, seed if self.seed is None else self.seed, self.spacing)


@dataclass(frozen=True)
class Cells(GraphSettings):
    """An array of flying-array modules on given cells.

    cells: axial coordinates, as in [[0, 0], [1, 0]].
    spacing: distance of the centres of neighbours.
    """

    cells: tuple[Cell, ...]
    spacing: BareMetres = MODULE_SPACING

    def build(self, seed: int) -> nx.Graph:
        """As `hexagonal`."""
        return hexagonal(self.cells, self.spacing)


@dataclass(frozen=True)
class Geometric(GraphSettings):
    """Agents at random positions in a square, linked if they are near each other.

    count: number of agents.
    radius: largest distance of linked agents.
    seed: seed of the positions; by default that of the run.
    side: side of the square.
    """

    count: Count
    radius: BareMetres
    seed: int | None = None
    side: BareMetres = 1.0

    def build(self, seed: int) -> nx.Graph:
        """As `geometric`."""
        return geometric(self.count, self.radius, seed if self.seed is None else self.seed, self.side)


@dataclass(frozen=True)
class ErdosRenyi(GraphSettings):
    """Every pair of agents linked with the same probability.

    count: number of agents.
    probability: probability of each link.
    seed: seed of the links; by default that of the run.
    """

    count: Count
    probability: Probability
    seed: int | None = None

    def build(self, seed: int) -> nx.Graph:
        """As `erdos_renyi`."""
        return erdos_renyi(self.count, self.probability, seed if self.seed is None else self.seed)


@dataclass(frozen=True)
class SmallWorld(GraphSettings):
    """A ring with links to the nearest agents, some of them rewired (Watts and Strogatz).

    count: number of agents.
    neighbours: number of neighbours of each agent before rewiring, even.
    rewiring: probability that a link is rewired.
    seed: seed of the links; by default that of the run.
    """

    count: Count
    neighbours: int
    rewiring: Probability
    seed: int | None = None

    def build(self, seed: int) -> nx.Graph:
        """As `small_world`."""
        return small_world(self.count, self.neighbours, self.rewiring, seed if self.seed is None else self.seed)


@dataclass(frozen=True)
class FromFile(GraphSettings):
    """A graph from a file.

    path: a GraphML, edge-list or JSON file.
    """

    path: str

    def build(self, seed: int) -> nx.Graph:
        """As `read`."""
        return read(self.path)


Spans = Literal["always"] | tuple[tuple[Nanoseconds, Nanoseconds] | tuple[Nanoseconds], ...]


@dataclass(frozen=True)
class Edges(GraphSettings):
    """A graph given by its edges.

    edges: a list as in [1-2, 2-3], or edges with the time spans in which they are present, as in
        {1-2: always, 2-3: [[0 s, 2 s], [5 s]]}; a span without an end lasts until the end of the run.
    """

    edges: tuple[str, ...] | Mapping[str, Spans]

    def build(self, seed: int) -> nx.Graph:
        """Build the graph of a list of edges."""
        if isinstance(self.edges, Mapping):
            raise BadInput("edges with spans are a graph that changes, and cannot stand here: write a list of edges")
        return from_edges(self.listed())

    def listed(self) -> list[Edge]:
        """All edges as pairs of names."""
        return [edge(word) for word in self.edges]

    def over_time(self, seed: int, until_ns: int, places: Places | None = None) -> TimedGraph:
        """Build the graph with the time spans of its edges, if given."""
        if not isinstance(self.edges, Mapping):
            return TimedGraph(self.build(seed))
        spans: dict[Edge, list[Span]] = {}
        for word, its in self.edges.items():
            ends = edge(word)
            if ends in spans or ends[::-1] in spans:
                raise BadInput(f"{word!r} is written twice: keep one, it carries both directions", (word,))
            spans[ends] = [(0, until_ns)] if isinstance(its, str) else _spans(its, word, until_ns)
        return over_whole_run(spans, until_ns)

    def shortened(self, until_ns: int) -> tuple[GraphSettings, list[tuple[Place, int]]]:
        """Leave out the spans that start too late, and edges that have no other."""
        if not isinstance(self.edges, Mapping):
            return self, []
        kept: dict[str, Spans] = {}
        late: list[tuple[Place, int]] = []
        for word, its in self.edges.items():
            if isinstance(its, str):
                kept[word] = its
                continue
            late += [(("edges", word, index), span[0]) for index, span in enumerate(its) if span[0] >= until_ns]
            if (begun := tuple(span for span in its if span[0] < until_ns)) or not its:
                kept[word] = begun
        return replace(self, edges=kept), late


def edge(word: str) -> Edge:
    """Read an edge such as 1-2.

    Raises:
        BadInput: not two names with a `-` between them.
    """
    first, dash, second = word.partition("-")
    if not (first.strip() and dash and second.strip()):
        raise BadInput(f"{word!r} is not an edge: write two names with a dash, as in 1-2")
    return check_name(first.strip()), check_name(second.strip())


def _spans(given: Sequence[tuple[int, ...]], word: str, until_ns: int) -> list[Span]:
    if not given:
        raise BadInput("no spans: write always, or as in [[0 s, 2 s], [5 s]]", (word,))
    found: list[Span] = []
    for index, span in enumerate(given):
        start, end = check_instant(span[0], until_ns, (word, index)), span[1] if len(span) == 2 else until_ns
        if end <= start:
            text = f"the span from {seconds(start)} ends at {seconds(end)}, and that is not after it"
            raise BadInput(text, (word, index))
        for other in found:
            if start < other[1] and other[0] < end:
                text = f"the spans from {seconds(other[0])} and {seconds(start)} overlap: join them"
                raise BadInput(text, (word, index))
        found.append((start, end))
    return found


def check_instant(time_ns: int, until_ns: int, place: Place) -> int:
    """Return the instant if it is within the run.

    Raises:
        BadInput: it is not.
    """
    if not 0 <= time_ns < until_ns:
        text = f"{seconds(time_ns)} is not within the run, which lasts {seconds(until_ns)}"
        raise BadInput(text, place)
    return time_ns


def over_whole_run(
    spans: Mapping[Edge, Sequence[Span]],
    until_ns: int,
    names: Sequence[str] = (),
    places: Mapping[str, Position] | None = None,
) -> TimedGraph:
    """As `timed`; error messages say that they concern the union of all edges."""
    try:
        return timed(spans, until_ns, names, places)
    except BadInput as error:
        raise BadInput(f"over the whole run, {error}") from error


def seconds(time_ns: int) -> str:
    """Text of a time in seconds, for messages."""
    return f"{time_ns / 1e9:g} s"


FIXED = Kinds(
    "kind",
    {
        "line": Line,
        "ring": Ring,
        "star": Star,
        "complete": Complete,
        "grid": Grid,
        "hexagonal": Hexagonal,
        "cells": Cells,
        "geometric": Geometric,
        "erdos-renyi": ErdosRenyi,
        "small-world": SmallWorld,
        "edges": Edges,
        "file": FromFile,
    },
    tag="beside",
)
"""Kinds of graphs that do not change over time, except edges with time spans."""
