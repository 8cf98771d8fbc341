"""Topologies from files."""

import json
from pathlib import Path

import networkx as nx
import pytest

from volery import topologies
from volery.errors import BadInput

PLACES = {"1": (0.0, 0.0), "2": (1.0, 0.0), "10": (1.0, 1.0)}


def _model() -> nx.Graph:
    return topologies.from_edges([("1", "2"), ("2", "10")], positions=PLACES)


def _same(graph: nx.Graph, other: nx.Graph) -> bool:
    return topologies.edges(graph) == topologies.edges(other) and topologies.positions(graph) == topologies.positions(
        other
    )


def _with_axes() -> nx.Graph:
    raw = nx.Graph([("1", "2"), ("2", "10")])
    for agent, (x, y) in PLACES.items():
        raw.nodes[agent].update(x=x, y=y)
    return raw


def test_graphml_that_networkx_wrote(tmp_path: Path) -> None:
    """Node data x and y of a GraphML file become positions."""
    path = tmp_path / "array.graphml"
    nx.write_graphml(_with_axes(), path)
    assert _same(topologies.read(path), _model())


@pytest.mark.parametrize("key", ["edges", "links"])
def test_node_link_json(tmp_path: Path, key: str) -> None:
    """Node-link data is read with either of the names that networkx has used, positions in either form."""
    for number, raw in enumerate((_model(), _with_axes())):
        path = tmp_path / f"array{number}.json"
        path.write_text(json.dumps(nx.node_link_data(raw, edges=key)))
        assert _same(topologies.read(str(path)), _model())


def test_plain_json(tmp_path: Path) -> None:
    """Edges, and positions if there are any; numbers are names as well."""
    path = tmp_path / "array.json"
    path.write_text(json.dumps({"edges": [[1, 2], ["10", "2"]], "positions": PLACES}))
    assert _same(topologies.read(path), _model())
    path.write_text(json.dumps({"edges": [["a", "b"]]}))
    assert topologies.positions(topologies.read(path)) == {}


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    """Editors of Windows write one: it belongs to no name, in edge lists, JSON and GraphML."""
    (tmp_path / "a.edges").write_text("\ufeff1 2\n2 10\n", "utf-8")
    (tmp_path / "a.json").write_text('\ufeff{"edges": [[1, 2], [2, 10]]}', "utf-8")
    nx.write_graphml(nx.Graph([("1", "2"), ("2", "10")]), tmp_path / "a.graphml")
    (tmp_path / "a.graphml").write_bytes(b"\xef\xbb\xbf" + (tmp_path / "a.graphml").read_bytes())
    for suffix in ("edges", "json", "graphml"):
        assert topologies.edges(topologies.read(tmp_path / f"a.{suffix}")) == [("1", "2"), ("2", "10")]


@pytest.mark.parametrize("suffix", [".edgelist", ".edges", ".txt", ".TXT"])
def test_edge_list(tmp_path: Path, suffix: str) -> None:
    """Two agents a line; comments and empty lines do not count."""
    path = tmp_path / f"array{suffix}"
    path.write_text("# an array\n\n1 2\n10\t2  # the far one\n")
    assert topologies.edges(topologies.read(path)) == [("1", "2"), ("2", "10")]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "1,2", r"suffix '\.csv': use one of \.graphml"),
        ("a.edges", "1 2\n3\n", "line 2 holds 1 words, '3'"),
        ("a.edges", "1 2 0.5\n", "line 1 holds 3 words"),
        ("a.edges", "1 2\n2 1\n", "edge 1-2 is there more than once"),
        ("a.edges", "1 2\n3 4\n", "no path from 1 to 3, 4"),
        ("a.edges", "", "0 agents"),
        ("a.json", '{"edges": [', "damaged"),
        ("a.json", "[1, 2]", "holds list at the top"),
        ("a.json", '{"edge": []}', "holds edge: write"),
        ("a.json", '{"edges": [["1", "2"]], "position": {}}', "holds edges, position: write"),
        ("a.json", '{"edges": [["1", "2", "3"]]}', r"edge \['1', '2', '3'\] is not a pair"),
        ("a.json", '{"edges": [["1", [2]]]}', "damaged"),
        ("a.json", '{"edges": [["1", 2.5]]}', "2.5 cannot be an agent's name"),
        ("a.json", '{"edges": [["1", true]]}', "True cannot be an agent's name"),
        ("a.json", '{"edges": [["1", "2"]], "positions": [1]}', "damaged"),
        ("a.json", '{"edges": [["1", "2"]], "positions": {"3": [0, 0]}}', "no agent '3'"),
        ("a.json", '{"nodes": [{"id": 1}, {"id": "1"}], "edges": []}', "two nodes have one name"),
        ("a.json", '{"nodes": [{"id": 1, "x": 0}, {"id": 2}], "edges": []}', "node 1 has the coordinates x: write"),
        ("a.json", '{"nodes": [{"id": 1}, {"id": 2}], "edges": [{"source": 1}]}', "damaged"),
        (
            "a.json",
            (
                '{"multigraph": false, "nodes": [{"id": 1}, {"id": 2}], "links":'
                '[{"source": 1, "target": 2}, {"source": 2, "target": 1}]}'
            ),
            "edge 1-2 is there more than once",
        ),
        ("a.json", '{"directed": true, "nodes": [{"id": 1}, {"id": 2}], "edges": []}', "directed"),
        ("a.graphml", "<graphml", "damaged"),
        ("a.graphml", "<graphml></graphml>", "damaged"),
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, name: str, text: str, message: str) -> None:
    """Every fault of a file is a BadInput that names the file and the fault."""
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(BadInput, match=message) as caught:
        topologies.read(path)
    assert str(path) in str(caught.value)


def test_parallel_and_directed_graphml_are_refused(tmp_path: Path) -> None:
    """GraphML may hold parallel and directed edges; a topology may not."""
    path = tmp_path / "a.graphml"
    nx.write_graphml(nx.MultiGraph([("a", "b"), ("a", "b")]), path)
    with pytest.raises(BadInput, match="edge a-b is there more than once"):
        topologies.read(path)
    nx.write_graphml(nx.DiGraph([("a", "b")]), path)
    with pytest.raises(BadInput, match="directed"):
        topologies.read(path)


def test_missing_and_unreadable_files_are_named(tmp_path: Path) -> None:
    """A file that is not there, and bytes that are no text."""
    with pytest.raises(BadInput, match=r"gone\.json: cannot be read: No such file"):
        topologies.read(tmp_path / "gone.json")
    path = tmp_path / "bytes.edges"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInput, match="damaged"):
        topologies.read(path)
