"""The `topology:` mapping of a scenario."""

from pathlib import Path
from typing import Any

import networkx as nx
import pytest

from volery import topologies
from volery.errors import BadInput

from ..surroundings import build_graph

SEED = 11


def _same(graph: nx.Graph, other: nx.Graph) -> bool:
    return topologies.edges(graph) == topologies.edges(other) and topologies.positions(graph) == topologies.positions(
        other
    )


@pytest.mark.parametrize(
    ("spec", "graph"),
    [
        ({"line": 5}, topologies.line(5)),
        ({"line": 5, "spacing": "50 cm"}, topologies.line(5, 0.5)),
        ({"line": {"count": 5, "spacing": 0.5}}, topologies.line(5, 0.5)),
        ({"ring": 6}, topologies.ring(6)),
        ({"star": 5}, topologies.star(5)),
        ({"complete": 4}, topologies.complete(4)),
        ({"grid": [3, 4]}, topologies.grid(3, 4)),
        ({"grid": {"rows": 3, "columns": 4, "spacing": 2}}, topologies.grid(3, 4, 2.0)),
        ({"hexagonal": 4}, topologies.four_module_array()),
        ({"hexagonal": 16}, topologies.sixteen_module_array()),
        ({"hexagonal": {"count": 16, "spacing": "1 m"}}, topologies.sixteen_module_array(1.0)),
        ({"hexagonal": {"count": 16, "seed": 3}}, topologies.random_hexagonal(16, 3)),
        ({"hexagonal": 8}, topologies.random_hexagonal(8, SEED)),
        ({"hexagonal": {"count": 8, "seed": 3, "spacing": "0.3 m"}}, topologies.random_hexagonal(8, 3, 0.3)),
        ({"hexagonal": {"count": 8, "seed": 0}}, topologies.random_hexagonal(8, 0)),
        ({"cells": [[0, 0], [1, 0]], "spacing": "0.3 m"}, topologies.hexagonal(((0, 0), (1, 0)), 0.3)),
        ({"geometric": {"count": 9, "radius": "60 cm"}}, topologies.geometric(9, 0.6, SEED)),
        ({"geometric": 9, "radius": 3, "side": 5, "seed": 2}, topologies.geometric(9, 3.0, 2, 5.0)),
        ({"erdos-renyi": {"count": 9, "probability": 0.4}}, topologies.erdos_renyi(9, 0.4, SEED)),
        (
            {"small-world": {"count": 9, "neighbours": 4, "rewiring": 0.2}},
            topologies.small_world(9, 4, 0.2, SEED),
        ),
    ],
)
def test_each_kind(spec: dict[str, Any], graph: nx.Graph) -> None:
    """Every way to write a topology gives the graph of its generator; the run's seed stands in for a missing one."""
    assert _same(build_graph(spec, SEED), graph)


def test_file(tmp_path: Path) -> None:
    """A file is read in the format of its suffix."""
    path = tmp_path / "pair.edges"
    path.write_text("a b\n")
    assert topologies.edges(build_graph({"file": str(path)}, SEED)) == [("a", "b")]


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({}, "topology: no kind: write one of line"),
        ({"hexagon": 4}, r"unknown kind 'hexagon' \(did you mean 'hexagonal'"),
        ({"zzz": 4}, r"unknown kind 'zzz' \(known: cells, "),
        ({"line": 3, "ring": 4}, "line and ring each name a kind"),
        ({"ring": 6, "spacings": 1}, r"topology.spacings: unknown field \(did you mean 'spacing'\?\)"),
        ({"ring": {"count": 6}, "spacing": 1}, "spacing beside ring: move it into the mapping"),
        ({"geometric": {"count": 5}}, "topology.geometric.radius: is missing"),
        ({"small-world": {}}, "topology.small-world.count: is missing"),
        ({"ring": "six"}, "topology.ring: should be a valid integer, not 'six'"),
        ({"ring": 6.0}, "topology.ring: should be a valid integer, not 6.0"),
        ({"ring": True}, "topology.ring: should be a valid integer, not True"),
        ({"ring": None}, "topology.ring: should be a valid integer, not None"),
        ({"ring": 2}, "topology.ring: count is 2, it must be at least 3"),
        (
            {"ring": 6, "spacing": "2 Hz"},
            "topology.spacing: '2 Hz' is not a quantity here: write a number and one of mm, cm, m, km",
        ),
        ({"ring": 6, "spacing": [1]}, r"topology.spacing: \[1\] has no unit: write it with one of mm, cm, m, km"),
        ({"ring": 6, "spacing": -1}, "topology.ring: spacing is -1 m"),
        ({"grid": 3}, "topology.grid: should be a list, not 3"),
        ({"grid": [3, 4, 5]}, r"topology.grid: should have at most 2 items, not \[3, 4, 5\]"),
        (
            {"erdos-renyi": {"count": 4, "probability": "high"}},
            "topology.erdos-renyi.probability: should be a valid number, not 'high'",
        ),
        (
            {"erdos-renyi": {"count": 4, "probability": float("nan")}},
            "topology.erdos-renyi.probability: probability is nan, it must be at least 0 and at most 1",
        ),
        ({"cells": 4}, "topology.cells: should be a list, not 4"),
        ({"cells": [[0, 0], [1]]}, "topology.cells.1.1: is missing"),
        ({"cells": [[0, 0], [1, 0.5]]}, "topology.cells.1.1: should be a valid integer, not 0.5"),
        ({"cells": [[0, 0], [0, 0]]}, r"topology.cells: cell \[0, 0\] is taken by module 1"),
        ({"file": 3}, "topology.file: should be a valid string, not 3"),
        ({"file": "nowhere.json"}, "topology.file: nowhere.json: cannot be read"),
    ],
)
def test_bad_specs_name_the_place_and_the_remedy(spec: dict[str, Any], message: str) -> None:
    """A topology that cannot be built says where the fault is, and what to write."""
    with pytest.raises(BadInput, match=message):
        build_graph(spec, SEED)
