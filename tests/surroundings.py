"""Worlds, graphs and formations from what a scenario says of them, with the place of what is wrong."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from volery.errors import BadInput
from volery.experiments.scenario.explaining import read
from volery.topologies import Formation, Position, TimedGraph
from volery.topologies.over_time import GRAPHS, Topology
from volery.topologies.presence import Places
from volery.worlds.world_kinds import AnyWorld


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


def build_formation(spec: Mapping[str, Any], count: int, place: str = "formation") -> NDArray[np.float64]:
    """The places of vehicles in a formation as it is written."""
    settings = read(Formation, spec, place)
    with _below(place):
        places: NDArray[np.float64] = settings.of(count)
        return places
