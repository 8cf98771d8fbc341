"""Time-varying graphs: when each edge is present, when the graph is disconnected, and its mean connectivity.

Time is in whole nanoseconds, spans are half-open. An edge without spans is always present.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from .graphs import Position, agents, edges, from_edges, ordered
from .spectra import laplacian

Edge = tuple[str, str]
Span = tuple[int, int]
"""Half-open interval [from, until) in nanoseconds."""
Places = Callable[[int], Mapping[str, Sequence[float] | NDArray[np.float64]]]
"""Instant in nanoseconds → agent → (x, y) or (x, y, z) in metres."""


@dataclass(frozen=True)
class TimedGraph:
    """A time-varying graph: `union` has every edge that is present at some time, `presence` its time spans.

    `presence` maps edge, the lower name first → spans, ascending and disjoint; an edge without spans is always present.
    """

    union: nx.Graph
    presence: Mapping[Edge, tuple[Span, ...]] = field(default_factory=dict)


def merged(spans: Iterable[Span]) -> tuple[Span, ...]:
    """Merge spans that touch or overlap, and drop empty ones; the result is ascending and disjoint."""
    joined: list[Span] = []
    for start, end in sorted(span for span in spans if span[0] < span[1]):
        if joined and start <= joined[-1][1]:
            joined[-1] = joined[-1][0], max(joined[-1][1], end)
        else:
            joined.append((start, end))
    return tuple(joined)


def timed(
    spans: Mapping[Edge, Iterable[Span]],
    until_ns: int,
    names: Iterable[str] = (),
    positions: Mapping[str, Position] | None = None,
) -> TimedGraph:
    """Build the graph of edges with their time spans, over the time [0, until_ns).

    Args:
        spans: edge, either end first → spans in any order; parts outside [0, until_ns) are cut off.
        until_ns: end of the time, above 0.
        names: further agents.
        positions: agent → position in metres, for every agent or for none.

    Raises:
        BadInput: the union of all edges is not a valid topology, see `graphs.validate`.
    """
    kept = {
        ordered(*edge): merged((max(0, start), min(end, until_ns)) for start, end in its) for edge, its in spans.items()
    }
    union = from_edges((edge for edge, its in kept.items() if its), names, positions)
    return TimedGraph(union, {edge: kept[edge] for edge in edges(union) if kept[edge] != ((0, until_ns),)})


def epochs(graphs: Sequence[tuple[int, Iterable[Edge]]], until_ns: int) -> dict[Edge, tuple[Span, ...]]:
    """Edge, the lower name first → its time spans, from a sequence of graphs, each valid until the next starts.

    Args:
        graphs: (start in nanoseconds, edges), with ascending starts.
        until_ns: end of the last graph.
    """
    begins = [begin for begin, _ in graphs]
    found: dict[Edge, list[Span]] = {}
    for (begin, its), end in zip(graphs, [*begins[1:], until_ns], strict=True):
        for edge in its:
            found.setdefault(ordered(*edge), []).append((begin, end))
    return {edge: merged(spans) for edge, spans in found.items()}


def disconnected(graph: TimedGraph, until_ns: int) -> tuple[Span, ...]:
    """The spans of [0, until_ns) in which the graph is disconnected, ascending and disjoint."""
    come: dict[int, list[Edge]] = defaultdict(list)
    go: dict[int, list[Edge]] = defaultdict(list)
    for edge, spans in graph.presence.items():
        for start, end in spans:
            come[start].append(edge)
            go[end].append(edge)
    now = nx.Graph(graph.union)
    now.remove_edges_from(graph.presence)
    instants = sorted({0, until_ns, *come, *go})
    apart = []
    for start, end in pairwise(instants):
        now.remove_edges_from(go[start])
        now.add_edges_from(come[start])
        if not nx.is_connected(now):
            apart.append((start, end))
    return merged((start, min(end, until_ns)) for start, end in apart)


def mean_laplacian(graph: TimedGraph, until_ns: int) -> NDArray[np.float64]:
    """Time average of the Laplacian over [0, until_ns), shape (N, N), rows in natural order.

    L̄ = (1/T) ∫ L(t) dt: each edge has the fraction of the time in which it is present as its weight. λ_2 is above zero
    exactly if the union is connected, as consensus on a time-varying graph requires     Jadbabaie, Lin and Morse 2003
    """
    if until_ns <= 0:
        raise BadInput(f"an average over {until_ns} ns is none: it takes a time above 0")
    matrix = laplacian(graph.union)
    row = {name: index for index, name in enumerate(agents(graph.union))}
    for edge, spans in graph.presence.items():
        absent = 1.0 - sum(end - start for start, end in spans) / until_ns
        first, second = row[edge[0]], row[edge[1]]
        matrix[first, second] += absent
        matrix[second, first] += absent
        matrix[first, first] -= absent
        matrix[second, second] -= absent
    return matrix


def mean_connectivity(graph: TimedGraph, until_ns: int) -> float:
    """λ_2 of the time average of the Laplacian."""
    return float(np.linalg.eigvalsh(mean_laplacian(graph, until_ns))[1])
