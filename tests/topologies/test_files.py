"""Topologies from files."""

import json
import math
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest

from volery import topologies
from volery.errors import BadInput
from volery.topologies.graph_settings import FromFile

PLACES = {"1": (0.0, 0.0), "2": (1.0, 0.0), "10": (1.0, 1.0)}


def _model() -> nx.Graph:
    return topologies.from_edges([("1", "2"), ("2", "10")], positions=PLACES)


def read(path: str | Path, **options: Any) -> nx.Graph:
    """The topology of a file."""
    graph: nx.Graph = FromFile(str(path), **options).topology(0)
    return graph


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
    assert _same(read(path), _model())


@pytest.mark.parametrize("key", ["edges", "links"])
def test_node_link_json(tmp_path: Path, key: str) -> None:
    """Node-link data is read with either of the names that networkx has used, positions in either form."""
    for number, raw in enumerate((_model(), _with_axes())):
        path = tmp_path / f"array{number}.json"
        path.write_text(json.dumps(nx.node_link_data(raw, edges=key)))
        assert _same(read(str(path)), _model())


def test_plain_json(tmp_path: Path) -> None:
    """Edges, and positions if there are any; numbers are names as well."""
    path = tmp_path / "array.json"
    path.write_text(json.dumps({"edges": [[1, 2], ["10", "2"]], "positions": PLACES}))
    assert _same(read(path), _model())
    path.write_text(json.dumps({"edges": [["a", "b"]]}))
    assert topologies.positions(read(path)) == {}


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    """Editors of Windows write one: it belongs to no name, in edge lists, JSON and GraphML."""
    (tmp_path / "a.edges").write_text("\ufeff1 2\n2 10\n", "utf-8")
    (tmp_path / "a.json").write_text('\ufeff{"edges": [[1, 2], [2, 10]]}', "utf-8")
    nx.write_graphml(nx.Graph([("1", "2"), ("2", "10")]), tmp_path / "a.graphml")
    (tmp_path / "a.graphml").write_bytes(b"\xef\xbb\xbf" + (tmp_path / "a.graphml").read_bytes())
    for suffix in ("edges", "json", "graphml"):
        assert topologies.edges(read(tmp_path / f"a.{suffix}")) == [("1", "2"), ("2", "10")]


@pytest.mark.parametrize("suffix", [".edgelist", ".edges", ".txt", ".TXT"])
def test_edge_list(tmp_path: Path, suffix: str) -> None:
    """Two agents a line; comments and empty lines do not count."""
    path = tmp_path / f"array{suffix}"
    path.write_text("# an array\n\n1 2\n10\t2  # the far one\n")
    assert topologies.edges(read(path)) == [("1", "2"), ("2", "10")]


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
        ("a.json", '{"directed": true, "nodes": [{"id": 1}, {"id": 2}], "edges": []}', "no path from 1 to 2"),
        ("a.graphml", "<graphml", "damaged"),
        ("a.graphml", "<graphml></graphml>", "damaged"),
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, name: str, text: str, message: str) -> None:
    """Every fault of a file is a BadInput that names the file and the fault."""
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(BadInput, match=message) as caught:
        read(path)
    assert str(path) in str(caught.value)


PARALLEL = """{"nodes": [{"id": "a"}, {"id": "b"}, {"id": "c"}], "links": [
    {"source": "a", "target": "b", "latency": "5 ms"}, {"source": "b", "target": "a", "rate": "1 Mbit/s"},
    {"source": "b", "target": "c"}]}"""
LOOP = "1 2\n2 2\n2 3\n"
PARTS = "1 2\n2 3\n4 5\n6 7\n"
CITIES = """<graphml xmlns="http://graphml.graphdrawing.org/xmlns">
  <key id="n" for="node" attr.name="label" attr.type="string"/>
  <key id="lon" for="node" attr.name="Longitude" attr.type="double"/>
  <key id="lat" for="node" attr.name="Latitude" attr.type="double"/>
  <key id="d" for="edge" attr.name="delay" attr.type="double"><default>7.5</default></key>
  <key id="l" for="edge" attr.name="LinkLabel" attr.type="string"/>
  <graph edgedefault="undirected">
    <node id="n-0"><data key="n">Zürich HB</data><data key="lon">8.54</data><data key="lat">47.38</data></node>
    <node id="n-1"><data key="n">Graz</data><data key="lon">15.44</data><data key="lat">47.07</data></node>
    <node id="n-2"><data key="n">St. Pölten</data><data key="lon">15.63</data><data key="lat">48.20</data></node>
    <edge id="e0" source="n-0" target="n-1"><data key="l">OC-192</data></edge>
    <edge id="e1" source="n-1" target="n-2"><data key="d">2</data></edge>
  </graph>
</graphml>"""


def _written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, "utf-8")
    return path


def test_parallel_edges_are_joined_if_asked(tmp_path: Path) -> None:
    """Without `merge` they are refused with that remedy; with it one edge has the attributes of both."""
    path = _written(tmp_path, "a.json", PARALLEL)
    with pytest.raises(BadInput, match=r"a\.json: the edge a-b is there more than once: .* `merge: true`"):
        read(path)
    graph = read(path, merge=True)
    assert topologies.edges(graph) == [("a", "b"), ("b", "c")]
    assert topologies.link_attributes(graph)["b", "a"] == [{"latency": "5 ms"}, {"rate": "1 Mbit/s"}]


def test_edges_of_nodes_to_themselves_are_left_out_if_asked(tmp_path: Path) -> None:
    """Without `merge` they are refused with that remedy."""
    path = _written(tmp_path, "a.edges", LOOP)
    with pytest.raises(BadInput, match=r"a\.edges: agent 2 has an edge to itself, 2-2: .* `merge: true`"):
        read(path)
    assert topologies.edges(read(path, merge=True)) == [("1", "2"), ("2", "3")]


def test_the_largest_part_is_taken_if_asked(tmp_path: Path) -> None:
    """Without `component` a graph that falls apart is refused with that remedy; of equal parts the first counts."""
    path = _written(tmp_path, "a.edges", PARTS)
    with pytest.raises(BadInput, match=r"no path from 1 to 4, 5, 6, 7: link the parts, .* `component: largest`"):
        read(path)
    assert topologies.agents(read(path, component="largest")) == ["1", "2", "3"]
    path.write_text("4 5\n10 11\n")
    assert topologies.agents(read(path, component="largest")) == ["4", "5"]


def test_directions_of_their_own(tmp_path: Path) -> None:
    """A directed file says something of each direction; one that is missing is refused, or taken from the other."""
    edges = [("a", "b", {"loss": 0.1}), ("b", "a", {"loss": 0.4}), ("b", "c", {"loss": 0.2})]
    path = tmp_path / "a.graphml"
    nx.write_graphml(nx.DiGraph(edges), path)
    with pytest.raises(BadInput, match=r"b>c has no c>b, and links go both ways: .* `merge: true`"):
        read(path)
    found = topologies.link_attributes(read(path, merge=True))
    assert {link: several[0]["loss"] for link, several in found.items()} == {
        ("a", "b"): 0.1, ("b", "a"): 0.4, ("b", "c"): 0.2, ("c", "b"): 0.2,
    }  # fmt: skip


def test_ids_that_are_no_names(tmp_path: Path) -> None:
    """They are refused with the remedies; an attribute, or the id, names agents with `_` for other characters."""
    path = _written(tmp_path, "a.graphml", CITIES)
    with pytest.raises(BadInput, match=r"'n-0' cannot be an agent's name: .*; `names: id` .*, `names: label` takes"):
        read(path)
    assert topologies.agents(read(path, names="label")) == ["Graz", "St_Polten", "Zurich_HB"]
    assert topologies.agents(read(path, names="id")) == ["n_0", "n_1", "n_2"]
    with pytest.raises(BadInput, match=r"the node 'n-0' has no attribute 'city' to be named by; it has label, Long"):
        read(path, names="city")
    path.write_text(CITIES.replace("Graz", "Zurich-HB"), "utf-8")
    with pytest.raises(BadInput, match="the nodes 'n-0' and 'n-1' would both be called Zurich_HB"):
        read(path, names="label")


def test_longitude_and_latitude_are_positions(tmp_path: Path) -> None:
    """In metres on the plane: Graz to St. Pölten is 126 km on the sphere, within a part in a thousand."""
    graph = read(_written(tmp_path, "a.graphml", CITIES), names="label")
    places = topologies.positions(graph)
    assert math.dist(places["Graz"], places["St_Polten"]) == pytest.approx(126.4e3, rel=1e-3)
    assert np.mean(list(places.values()), axis=0) == pytest.approx([0.0, 0.0], abs=1e-6)
    without = CITIES.replace('<data key="lat">48.20</data>', "")
    assert topologies.positions(read(_written(tmp_path, "a.graphml", without), names="label")) == {}


def test_attributes_of_edges_are_mapped_and_ignored(tmp_path: Path) -> None:
    """A default holds for edges without a value; a unit is added; a name that no edge has is refused."""
    path = _written(tmp_path, "a.graphml", CITIES)
    graph = read(path, names="label", attributes={"delay": "latency ms"}, ignore=("LinkLabel",))
    found = topologies.link_attributes(graph)
    assert found["Graz", "Zurich_HB"] == found["Zurich_HB", "Graz"] == [{"latency": "7.5 ms"}]
    assert found["St_Polten", "Graz"] == [{"latency": "2.0 ms"}]
    with pytest.raises(BadInput, match=r"no edge has the attribute 'dealy': they have LinkLabel, delay"):
        read(path, names="label", attributes={"dealy": "latency ms"})
    with pytest.raises(BadInput, match=r"the edge n-0-n-1 has delay and LinkLabel: ignore one"):
        read(path, names="label", attributes={"LinkLabel": "delay"})


def test_links_to_nodes_that_are_not_listed_are_refused(tmp_path: Path) -> None:
    """They were agents that nobody had written down."""
    path = _written(tmp_path, "a.json", PARALLEL.replace('"target": "c"', '"target": "d"'))
    with pytest.raises(BadInput, match="link 2 leads to 'd', and no node is called so"):
        read(path)
    path = _written(tmp_path, "a.graphml", CITIES.replace('target="n-2"', 'target="n-3"'))
    with pytest.raises(BadInput, match="the edge n-1-n-3 leads to 'n-3', and no node is called so"):
        read(path)


def test_nodes_of_d3_keep_their_names(tmp_path: Path) -> None:
    """Links by the place of nodes that have names and no ids; nodes without either are numbered."""
    links = '"links": [{"source": 0, "target": 1, "value": 3}, {"source": 1, "target": 2}]'
    text = f'{{"nodes": [{{"name": "Myriel"}}, {{"name": "Napoleon"}}, {{"name": "7"}}], {links}}}'
    graph = read(_written(tmp_path, "a.json", text), ignore=("value",))
    assert topologies.edges(graph) == [("7", "Napoleon"), ("Myriel", "Napoleon")]
    text = f'{{"nodes": [{{}}, {{}}, {{}}], {links}}}'
    assert topologies.edges(read(_written(tmp_path, "a.json", text))) == [("0", "1"), ("1", "2")]


def test_missing_and_unreadable_files_are_named(tmp_path: Path) -> None:
    """A file that is not there, and bytes that are no text."""
    with pytest.raises(BadInput, match=r"gone\.json: cannot be read: No such file"):
        read(tmp_path / "gone.json")
    path = tmp_path / "bytes.edges"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInput, match="damaged"):
        read(path)
