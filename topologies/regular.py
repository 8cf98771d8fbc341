"""Regular graphs: line, ring, star, complete graph and grid, on agents "1" to "N"."""

from __future__ import annotations

import math

import networkx as nx

from ..units import BareMetres, Count, check_above_zero
from .graphs import Position, at_least, from_edges


def line(count: Count, spacing: BareMetres = 1.0) -> nx.Graph:
    """Each agent linked to the next, on the x axis, centred on the origin.

    Args:
        count: number of agents.
        spacing: distance of neighbours on the line.
    Raises:
        BadInput: fewer than 2 agents, or a spacing that is not positive.
    """
    return grid(1, at_least(count, 2, "count"), spacing)


def ring(count: Count, spacing: BareMetres = 1.0) -> nx.Graph:
    """Each agent linked to the next and the last to the first, on a regular polygon.

    Args:
        count: number of agents, at least 3.
        spacing: length of the sides of the regular polygon.
    Raises:
        BadInput: fewer than 3 agents, or a spacing that is not positive.
    """
    check_above_zero("spacing", spacing, "m")
    radius = spacing / (2 * math.sin(math.pi / at_least(count, 3, "count")))
    return from_edges(_numbered(nx.cycle_graph(count)), positions=_circle(1, count, radius))


def star(count: Count, spacing: BareMetres = 1.0) -> nx.Graph:
    """Agent 1 linked to all others, which are on a circle around it.

    Args:
        count: number of agents.
        spacing: distance of the others from agent 1.
    Raises:
        BadInput: fewer than 2 agents, or a spacing that is not positive.
    """
    at_least(count, 2, "count")
    check_above_zero("spacing", spacing, "m")
    around = _circle(2, count - 1, spacing)
    return from_edges(_numbered(nx.star_graph(count - 1)), positions=centred({"1": (0.0, 0.0), **around}))


def complete(count: Count) -> nx.Graph:
    """Every agent linked to every other, without positions.

    Args:
        count: number of agents.
    Raises:
        BadInput: fewer than 2 agents.
    """
    return from_edges(_numbered(nx.complete_graph(at_least(count, 2, "count"))))


def grid(rows: Count, columns: Count, spacing: BareMetres = 1.0) -> nx.Graph:
    """A square grid, numbered row by row; each agent is linked to its up to four neighbours.

    Args:
        rows: number of rows.
        columns: number of columns.
        spacing: distance of neighbours.
    Raises:
        BadInput: no row, no column, fewer than 2 agents, or a spacing that is not positive.
    """
    at_least(rows, 1, "rows")
    at_least(columns, 1, "columns")
    check_above_zero("spacing", spacing, "m")
    raw = nx.grid_2d_graph(rows, columns)
    places = {str(number): (spacing * column, spacing * row) for number, (row, column) in enumerate(raw, start=1)}
    return from_edges(_numbered(raw), names=places, positions=centred(places))


def centred(places: dict[str, tuple[float, float]]) -> dict[str, Position]:
    """Positions shifted so that their centroid is the origin, in metres."""
    middle_x = math.fsum(x for x, _ in places.values()) / len(places)
    middle_y = math.fsum(y for _, y in places.values()) / len(places)
    return {agent: (x - middle_x, y - middle_y) for agent, (x, y) in places.items()}


def _circle(first: int, count: int, radius: float) -> dict[str, tuple[float, float]]:
    angles = {str(first + index): 2 * math.pi * index / count for index in range(count)}
    return {agent: (radius * math.cos(angle), radius * math.sin(angle)) for agent, angle in angles.items()}


def _numbered(raw: nx.Graph) -> list[tuple[str, str]]:
    number = {node: str(index) for index, node in enumerate(raw, start=1)}
    return [(number[first], number[second]) for first, second in raw.edges()]
