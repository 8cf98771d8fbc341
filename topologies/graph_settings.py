"""Settings of graphs in a scenario; each builds its graph. Parameters of functions that return a graph are settings."""

from __future__ import annotations

import inspect
import traceback
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, make_dataclass, replace
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, get_type_hints

import networkx as nx

from ..errors import BadInput
from ..kinds import Kinds
from ..randomness import keyed_seed
from ..units import BareMetres, Count, Nanoseconds, OneOrMany
from .arrays import MODULE_SPACING, four_module_array, hexagonal, random_hexagonal, sixteen_module_array
from .files import read
from .graphs import Position, from_edges
from .naming import check_name
from .own_graphs import IN_FILE, topology_of
from .presence import Edge, Places, Span, TimedGraph, timed
from .random_graphs import erdos_renyi, geometric, small_world
from .regular import complete, grid, line, ring, star

Place = tuple[str | int, ...]
"""Place of a value relative to the settings."""
_FIXED_ARRAYS = {4: four_module_array, 16: sixteen_module_array}


@dataclass(frozen=True)
class GraphSettings:
    """Settings of a graph; `plain`: number of first fields that the value of the kind's name gives, as in `ring: 6`.

    A class of one's own derives from this one and is a frozen dataclass with `build`, or with `over_time` if the graph
    changes.
    """

    plain: ClassVar[int] = 1

    @abstractmethod
    def build(self, seed: int) -> nx.Graph:
        """Build the graph, with names and attributes as `topology_of` reads them; `seed` is that of the run.

        Raises:
            BadInput: the settings are refused.
        """

    def topology(self, seed: int) -> nx.Graph:
        """Build the graph as a validated topology.

        Raises:
            BadInput: `build` refuses the settings or fails, or its graph is no topology.
        """
        name = f"{type(self).__module__}:{type(self).__qualname__}"
        try:
            graph = self.build(seed)
        except BadInput:
            raise
        except Exception as error:
            frames = traceback.extract_tb(error.__traceback__)
            of_user = [each for each in frames if "site-packages" not in each.filename and "<" not in each.filename]
            at = of_user[-1]
            text = f"{name} failed in line {at.lineno} of {at.filename}"
            raise BadInput(f"{text}: {type(error).__name__}: {error}") from error
        if not isinstance(graph, nx.Graph):
            raise BadInput(f"{name} returned {graph!r:.60}: return a networkx graph")
        return topology_of(graph)

    def over_time(self, seed: int, until_ns: int, places: Places | None = None) -> TimedGraph:
        """Build the graph over the time [0, until_ns).

        Args:
            seed: seed of the run.
            until_ns: end of the run.
            places: positions of moving agents.
        Raises:
            BadInput: as `topology`, with the place relative to these settings.
        """
        return TimedGraph(self.topology(seed))

    def shortened(self, until_ns: int) -> tuple[GraphSettings, list[tuple[Place, int]]]:
        """These settings without what starts at `until_ns` or later, and place and start of each part left out."""
        return self, []


# -- functions --------------------------------------------------------------------------------------------------------


def generated(function: Callable[..., nx.Graph], plain: int = 1) -> Any:
    """Settings with the parameters of a generator of this package; `plain` as in `GraphSettings`."""
    return _settings_of(function, plain, lambda seed: seed)


@cache
def own(function: Callable[..., nx.Graph]) -> Any:
    """Settings with the parameters of a function of a user's own that returns a networkx graph.

    Annotations give types and units; a parameter without one takes any plain value. `seed` is what the settings say,
    else a number of 32 bits that follows from the seed of the run and the function's name.
    """
    name = f"{function.__module__}:{function.__qualname__}"
    return _settings_of(function, 1, lambda seed: keyed_seed(seed, "topology", name))


def _settings_of(function: Callable[..., nx.Graph], plain: int, seed_of: Callable[[int], int]) -> Any:
    try:
        hints = get_type_hints(inspect.unwrap(function), include_extras=True)
    except NameError as error:
        raise BadInput(f"an annotation of {function.__module__}:{function.__qualname__} is unknown: {error}") from error
    listed = inspect.signature(function).parameters.values()
    parameters = [each for each in listed if each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)]

    def build(settings: Any, seed: int) -> nx.Graph:
        values = {each.name: getattr(settings, each.name) for each in parameters}
        if "seed" in values and values["seed"] is None:
            values["seed"] = seed_of(seed)
        return function(**values)

    made = make_dataclass(
        function.__name__,
        [_field(each, hints.get(each.name, Any)) for each in parameters],
        bases=(GraphSettings,),
        namespace={"build": build, "plain": plain, "__doc__": function.__doc__ or ""},
        frozen=True,
        kw_only=True,
    )
    made.__module__, made.__qualname__ = function.__module__, function.__qualname__
    return made


def _field(parameter: inspect.Parameter, hint: Any) -> tuple[str, Any, Any]:
    if parameter.name == "seed":
        return "seed", int | None, field(default=None)
    if parameter.default is parameter.empty:
        return parameter.name, hint, field()
    if type(parameter.default).__hash__ is None:
        return parameter.name, hint, field(default_factory=lambda: parameter.default)
    return parameter.name, hint, field(default=parameter.default)


# -- graphs that are written down -------------------------------------------------------------------------------------


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
class FromFile(GraphSettings):
    """A graph from a file; what its edges say are settings of the links.

    path: a GraphML, edge-list or JSON file.
    names: attribute of the nodes that gives the names of agents, or id; characters that no name has become _.
    merge: whether parallel edges, and edges of which there is one direction only, stand for one edge; edges of a node
        to itself are left out.
    component: largest takes the largest connected part.
    attributes: attribute of the edges → setting of links and, for plain numbers, unit, as in {delay: latency ms}.
    ignore: attributes of the edges that are no settings.
    """

    path: str
    names: str | None = None
    merge: bool = False
    component: Literal["largest"] | None = None
    attributes: Mapping[str, str] = field(default_factory=dict)
    ignore: Annotated[tuple[str, ...], OneOrMany()] = ()

    def build(self, seed: int) -> nx.Graph:
        """Read the file; attributes have the names of settings."""
        graph = read(self.path)
        found: set[str] = set()
        for source, target, data in graph.edges(data=True):
            found |= data.keys()
            for name in self.ignore:
                data.pop(name, None)
            for name in [each for each in self.attributes if each in data]:
                setting, _, unit = self.attributes[name].partition(" ")
                if setting in data.keys() - {name}:
                    raise BadInput(f"{self.path}: the edge {source}-{target} has {setting} and {name}: ignore one")
                value = data.pop(name)
                data[setting] = f"{value} {unit}" if unit else value
        if unused := self.attributes.keys() - found:
            raise BadInput(f"{self.path}: no edge has the attribute {min(unused)!r}: they have {_listed(found)}")
        return graph

    def topology(self, seed: int) -> nx.Graph:
        """Read the file as a validated topology."""
        graph = self.build(seed)
        try:
            return topology_of(graph, self.names, merge=self.merge, component=self.component, remedies=IN_FILE)
        except BadInput as error:
            raise BadInput(f"{self.path}: {error}") from error


def _listed(names: set[str]) -> str:
    return ", ".join(sorted(names)) or "none"


Spans = Literal["always"] | tuple[tuple[Nanoseconds, Nanoseconds] | tuple[Nanoseconds], ...]


@dataclass(frozen=True)
class Edges(GraphSettings):
    """A graph given by its edges.

    edges: a list as in [1-2, 2-3], or edges with the time spans in which they are present, as in
        {1-2: always, 2-3: [[0 s, 2 s], [5 s]]}; a span without an end lasts until the end of the run.
    positions: where each agent is, two or three lengths, as in {1: [0 m, 0 m], 2: [1 m, 0 m]}.
    """

    edges: tuple[str, ...] | Mapping[str, Spans]
    positions: Mapping[str, tuple[BareMetres, ...]] | None = None

    def build(self, seed: int) -> nx.Graph:
        """Build the graph of a list of edges."""
        if isinstance(self.edges, Mapping):
            raise BadInput("edges with spans are a graph that changes, and cannot stand here: write a list of edges")
        return from_edges(self.listed(), positions=self.positions)

    def listed(self) -> list[Edge]:
        """All edges as pairs of names."""
        return [edge(word) for word in self.edges]

    def over_time(self, seed: int, until_ns: int, places: Places | None = None) -> TimedGraph:
        """Build the graph with the time spans of its edges, if given."""
        if not isinstance(self.edges, Mapping):
            return super().over_time(seed, until_ns, places)
        spans: dict[Edge, list[Span]] = {}
        for word, its in self.edges.items():
            ends = edge(word)
            if ends in spans or ends[::-1] in spans:
                raise BadInput(f"{word!r} is written twice: keep one, it carries both directions", (word,))
            spans[ends] = [(0, until_ns)] if isinstance(its, str) else _spans(its, word, until_ns)
        return over_whole_run(spans, until_ns, places=self.positions)

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
        "line": generated(line),
        "ring": generated(ring),
        "star": generated(star),
        "complete": generated(complete),
        "grid": generated(grid, plain=2),
        "hexagonal": Hexagonal,
        "cells": generated(hexagonal),
        "geometric": generated(geometric),
        "erdos-renyi": generated(erdos_renyi),
        "small-world": generated(small_world),
        "edges": Edges,
        "file": FromFile,
    },
    tag="beside",
    entry_points="volery.topologies",
    base=GraphSettings,
    of_function=own,
)
"""Kinds of graphs that do not change over time, except edges with time spans."""
