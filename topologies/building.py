"""The `topology:` mapping of a scenario, turned into a graph."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import networkx as nx

from .. import units
from ..errors import BadInput
from ..names import did_you_mean
from .arrays import MODULE_SPACING, four_module_array, hexagonal, random_hexagonal, sixteen_module_array
from .files import read
from .graphs import from_edges
from .naming import check_name
from .random_graphs import erdos_renyi, geometric, small_world
from .regular import complete, grid, line, ring, star

_Reader = Callable[[object], Any]
OVER_TIME = ("schedule", "proximity")
"""Kinds of graphs that change, for `over_time.build_over_time` to read."""
_FIXED_ARRAYS = {4: four_module_array, 16: sixteen_module_array}


def build(spec: Mapping[str, Any], seed: int) -> nx.Graph:
    """The graph of a `topology:` mapping that does not change, such as {ring: 6} or {geometric: {count: 20, …}}.

    One key names the kind. Its value is a mapping of all parameters, or the first of them with the others beside the
    kind: {cells: [[0, 0], [1, 0]], spacing: 0.25 m}. Lengths are text with a unit, or numbers in metres. {hexagonal: 4}
    and {hexagonal: 16} without a seed of their own are the fixed arrays; other random kinds without one use `seed`.

    Raises:
        BadInput: an unknown kind or parameter, a value of the wrong form, or whatever the generator refuses.
    """
    name = _kind_of(spec)
    kind = _KINDS[name]
    given = _given(name, kind, spec)
    missing = [field for field in kind.required if field not in given]
    if missing:
        raise BadInput(f"topology.{name}: {' and '.join(missing)} missing: it needs {', '.join(kind.required)}")
    values = {field: _read(f"topology.{name}.{field}", kind.fields[field], value) for field, value in given.items()}
    try:
        return kind.make(**values, **({"run_seed": seed} if kind.random else {}))
    except BadInput as error:
        raise BadInput(f"topology.{name}: {error}") from error


@dataclass(frozen=True)
class _Kind:
    """How one kind is written: its required parameters, the optional ones, and what makes the graph of them.

    A plain value gives the first `plain` of the required ones. A random kind is also handed `run_seed`.
    """

    make: Callable[..., nx.Graph]
    required: Mapping[str, _Reader]
    optional: Mapping[str, _Reader]
    plain: int = 1
    random: bool = False

    @property
    def fields(self) -> dict[str, _Reader]:
        return {**self.required, **self.optional}


def _kind_of(spec: Mapping[str, Any]) -> str:
    found = [key for key in spec if key in _KINDS]
    if len(found) == 1:
        return found[0]
    if found:
        raise BadInput(f"topology: {' and '.join(found)} each name a kind: keep one")
    for key in spec:
        if key in OVER_TIME:
            raise BadInput(f"topology: {key} is a graph that changes, and cannot stand here: use another kind")
        raise BadInput(f"topology: unknown kind {key!r}{did_you_mean(key, (*_KINDS, *OVER_TIME))}")
    raise BadInput(f"topology: no kind: write one of {', '.join((*_KINDS, *OVER_TIME))}")


def _given(name: str, kind: _Kind, spec: Mapping[str, Any]) -> dict[str, Any]:
    beside = {key: value for key, value in spec.items() if key != name}
    value = spec[name]
    if isinstance(value, Mapping):
        if beside:
            raise BadInput(f"topology: {', '.join(map(str, beside))} beside {name}: move it into the mapping of {name}")
        given = dict(value)
    else:
        given = {**_plain(name, kind, value), **beside}
    for key in given:
        if key not in kind.fields:
            raise BadInput(f"topology.{name}: unknown parameter {key!r}{did_you_mean(key, kind.fields)}")
    return given


def _plain(name: str, kind: _Kind, value: object) -> dict[str, object]:
    names = list(kind.required)[: kind.plain]
    if kind.plain == 1:
        return {names[0]: value}
    if isinstance(value, list | tuple) and len(value) == len(names):
        return dict(zip(names, value, strict=True))
    raise BadInput(f"topology.{name}: {value!r} does not fit: write [{', '.join(names)}]")


def _read(place: str, reader: _Reader, value: object) -> Any:
    try:
        return reader(value)
    except BadInput as error:
        raise BadInput(f"{place}: {error}") from error


def _integer(value: object) -> int:
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    raise BadInput(f"{value!r} is not a whole number")


def _number(value: object) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    raise BadInput(f"{value!r} is not a finite number")


def _length(value: object) -> float:
    return units.parse(value, "m") if isinstance(value, str) else _number(value)


def _cells(value: object) -> list[tuple[int, int]]:
    if isinstance(value, list | tuple) and all(isinstance(cell, list | tuple) and len(cell) == 2 for cell in value):
        return [(_integer(q), _integer(r)) for q, r in value]
    raise BadInput(f"{value!r} is not a list of cells: write axial coordinates, as in [[0, 0], [1, 0]]")


def edge_list(value: object) -> list[tuple[str, str]]:
    """Edges written as [1-2, 2-3].

    Raises:
        BadInput: not a list, or something in it that is not two names with a `-` between them.
    """
    if not isinstance(value, list | tuple):
        raise BadInput(f"{value!r} is not a list of edges: write them as in [1-2, 2-3]")
    return [edge(word) for word in value]


def edge(word: object) -> tuple[str, str]:
    """An edge written as 1-2.

    Raises:
        BadInput: not two names with a `-` between them.
    """
    first, dash, second = word.partition("-") if isinstance(word, str) else ("", "", "")
    if not (first.strip() and dash and second.strip()):
        raise BadInput(f"{word!r} is not an edge: write two names with a dash, as in 1-2")
    return check_name(first.strip()), check_name(second.strip())


def _path(value: object) -> str:
    if isinstance(value, str):
        return value
    raise BadInput(f"{value!r} is not a path")


def _array(count: int, run_seed: int, seed: int | None = None, spacing: float = MODULE_SPACING) -> nx.Graph:
    if seed is None and count in _FIXED_ARRAYS:
        return _FIXED_ARRAYS[count](spacing)
    return random_hexagonal(count, run_seed if seed is None else seed, spacing)


def _listed(edges: list[tuple[str, str]]) -> nx.Graph:
    return from_edges(edges)


def _seeded(make: Callable[..., nx.Graph]) -> Callable[..., nx.Graph]:
    """The generator with the run's seed in the place of a seed that is not given."""
    return lambda run_seed, **values: make(**{"seed": run_seed, **values})


_COUNT: Mapping[str, _Reader] = {"count": _integer}
_SPACING: Mapping[str, _Reader] = {"spacing": _length}
_SEED: Mapping[str, _Reader] = {"seed": _integer}
_KINDS: Mapping[str, _Kind] = {
    "line": _Kind(line, _COUNT, _SPACING),
    "ring": _Kind(ring, _COUNT, _SPACING),
    "star": _Kind(star, _COUNT, _SPACING),
    "complete": _Kind(complete, _COUNT, {}),
    "grid": _Kind(grid, {"rows": _integer, "columns": _integer}, _SPACING, plain=2),
    "hexagonal": _Kind(_array, _COUNT, {**_SEED, **_SPACING}, random=True),
    "cells": _Kind(hexagonal, {"cells": _cells}, _SPACING),
    "geometric": _Kind(_seeded(geometric), {**_COUNT, "radius": _length}, {**_SEED, "side": _length}, random=True),
    "erdos-renyi": _Kind(_seeded(erdos_renyi), {**_COUNT, "probability": _number}, _SEED, random=True),
    "small-world": _Kind(
        _seeded(small_world), {**_COUNT, "neighbours": _integer, "rewiring": _number}, _SEED, random=True
    ),
    "edges": _Kind(_listed, {"edges": edge_list}, {}),
    "file": _Kind(read, {"path": _path}, {}),
}
