"""What tests of several folders share: worlds, graphs and formations from what a scenario says of them, and seeds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray

from volery.errors import BadInput
from volery.experiments.scenario.explaining import read
from volery.topologies import Formation, Position, TimedGraph, edges
from volery.topologies.over_time import GRAPHS, Topology
from volery.topologies.presence import Places
from volery.worlds.world_kinds import AnyWorld

BUILT_IN = sorted(path.stem for path in (Path(__file__).parents[1] / "scenarios").glob("*.yaml"))
"""The names of the scenarios that come with volery."""


def seeds(quick: int, all_of_them: int) -> list[Any]:
    """Seeds of drawn cases, as parameters of a test: the first ones always, the others in the long run."""
    return [*range(quick), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(quick, all_of_them))]


@contextmanager
def _below(place: str) -> Iterator[None]:
    try:
        yield
    except BadInput as error:
        raise BadInput(f"{'.'.join(map(str, (place, *error.place)))}: {error}") from error


def build_world(
    spec: Mapping[str, Any], positions: Mapping[str, Position], seed: int, agents: Sequence[str] = ()
) -> Any:
    """The world of a `world:` mapping."""
    settings = read(AnyWorld, spec, "world")
    with _below("world"):
        return settings.build(positions, seed, agents)


def build_graph(spec: Mapping[str, Any], seed: int) -> nx.Graph:
    """The graph of a `topology:` mapping that does not change."""
    settings = read(Topology, spec, "topology")
    with _below(f"topology.{GRAPHS.name_of(type(settings))}"):
        graph: nx.Graph = settings.topology(seed)
        return graph


def build_over_time(spec: Mapping[str, Any], seed: int, until_ns: int, places: Places | None = None) -> TimedGraph:
    """The graph of a `topology:` mapping over time."""
    settings = read(Topology, spec, "topology")
    with _below(f"topology.{GRAPHS.name_of(type(settings))}"):
        graph: TimedGraph = settings.over_time(seed, until_ns, places)
        return graph


def edges_at(graph: TimedGraph, time_ns: int) -> list[tuple[str, str]]:
    """The edges that are present at an instant, in natural order."""
    always = ((0, time_ns + 1),)
    spans = {edge: graph.presence.get(edge, always) for edge in edges(graph.union)}
    return [edge for edge, its in spans.items() if any(start <= time_ns < end for start, end in its)]


def build_formation(spec: Mapping[str, Any], count: int, place: str = "formation") -> NDArray[np.float64]:
    """The places of vehicles in a formation as it is written."""
    settings = read(Formation, spec, place)
    with _below(place):
        places: NDArray[np.float64] = settings.of(count)
        return places
