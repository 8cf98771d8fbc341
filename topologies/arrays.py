"""Arrays of hexagonal flying-array modules: each module is an agent, linked to the modules that touch its sides.

A cell has axial coordinates (q, r). With spacing s its centre is at x = s·(q + r/2), y = s·(√3/2)·r,
shifted so that the centroid of the array is the origin.
"""

from __future__ import annotations

import math

import networkx as nx

from ..errors import BadInput
from ..randomness import stream
from ..units import BareMetres, check_above_zero
from .graphs import at_least, from_edges
from .regular import centred

Cell = tuple[int, int]

MODULE_SPACING = 0.25
_SIDES: tuple[Cell, ...] = ((1, 0), (0, 1), (-1, 1), (-1, 0), (0, -1), (1, -1))
_FOUR: tuple[Cell, ...] = ((0, 1), (0, 0), (1, -1), (1, 0))
_SIXTEEN: tuple[Cell, ...] = (
    (-1, 3), (-1, 0), (0, 2), (-1, 2), (-2, 2), (-2, 1), (-1, 1), (0, 1),
    (0, 0), (0, 3), (-2, 0), (-3, 0), (-1, -1), (0, -1), (0, -2), (-1, -2),
)  # fmt: skip


def hexagonal(cells: tuple[Cell, ...], spacing: BareMetres = MODULE_SPACING) -> nx.Graph:
    """An array of flying-array modules on given cells, module 1 on the first cell, 2 on the second and so on.

    Args:
        cells: axial coordinates, as in [[0, 0], [1, 0]].
        spacing: distance of the centres of neighbours.
    Raises:
        BadInput: a repeated cell, modules that touch no other, fewer than 2 cells, or a spacing that is not positive.
    """
    check_above_zero("spacing", spacing, "m")
    module: dict[Cell, str] = {}
    for number, cell in enumerate(cells, start=1):
        if cell in module:
            raise BadInput(f"cell {list(cell)} is taken by module {module[cell]} and given again to module {number}")
        module[cell] = str(number)
    half = len(_SIDES) // 2  # the other sides are these, seen from the neighbour
    pairs = [(module[cell], module[other]) for cell in module for other in _around(cell)[:half] if other in module]
    places = {name: (spacing * (q + r / 2), spacing * math.sqrt(3) / 2 * r) for (q, r), name in module.items()}
    return from_edges(pairs, names=places, positions=centred(places) if places else None)


def random_hexagonal(count: int, seed: int, spacing: float = MODULE_SPACING) -> nx.Graph:
    """Connected random array: modules are added one by one, each on a free adjacent cell chosen uniformly.

    With the same seed, the array of N modules is a part of the array of N + 1.

    Raises:
        BadInput: fewer than 2 modules, or a spacing that is not positive.
    """
    draws = stream(seed, "topology", "hexagonal")
    cells: list[Cell] = [(0, 0)]
    free = set(_around(cells[0]))
    for index in range(at_least(count, 2, "count") - 1):
        candidates = sorted(free)
        chosen = candidates[int(draws.uniform(index) * len(candidates))]
        cells.append(chosen)
        free = (free | set(_around(chosen))) - set(cells)
    return hexagonal(tuple(cells), spacing)


def four_module_array(spacing: float = MODULE_SPACING) -> nx.Graph:
    """The rhombus of Kriegleder 2012, Fig. 3a: modules 2 and 4 touch all others, 1 and 3 touch only 2 and 4."""
    return hexagonal(_FOUR, spacing)


def sixteen_module_array(spacing: float = MODULE_SPACING) -> nx.Graph:
    """Substitute for the array of Kriegleder 2012, Fig. 3b, whose layout the text does not give.

    It has the properties given in the text: only module 12 has a single neighbour, and the neighbourhoods of modules 2
    and 7 are the best, with three times the covariance of the whole array (two-norm, spacing 0.25 m).
    """
    return hexagonal(_SIXTEEN, spacing)


def _around(cell: Cell) -> list[Cell]:
    return [(cell[0] + q, cell[1] + r) for q, r in _SIDES]
