"""Graphs from files: GraphML, edge lists, and two JSON formats, as they are written there."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import networkx as nx

from ..errors import BadInput

_GRAPHML = "{http://graphml.graphdrawing.org/xmlns}"


def read(path: str | Path) -> nx.Graph:
    """Read a graph in the format given by the suffix, with all attributes; `topology_of` makes a topology of it.

    - `.graphml`
    - `.edgelist`, `.edges`, `.txt`: two agents per line; `#` starts a comment.
    - `.json`: `{"nodes": […], "links": […]}` or `"edges"` as networkx and d3 write them, links by the nodes' `id`, or
      by their `name`, or by their place in the list where they have none of these; or
      `{"edges": [["1", "2"], ["2", "3", {"latency": "5 ms"}], …], "positions": {"1": [0, 0], …}}`.

    Raises:
        BadInput: no such file, an unknown suffix, damaged text, or an edge to a node that is not listed; the message
            names the file.
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise BadInput(f"{path}: no topology format has the suffix {path.suffix!r}: use one of {', '.join(_READERS)}")
    try:
        return reader(path)
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror or error}") from error
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from error
    except (ET.ParseError, nx.NetworkXException, ValueError, TypeError, KeyError, AttributeError) as error:
        raise BadInput(f"{path}: damaged, or not a {path.suffix} topology: {error}") from error


def _graphml(path: Path) -> nx.Graph:
    """Read a graph with the defaults of its attributes, which networkx keeps apart."""
    graph = nx.read_graphml(path, force_multigraph=True)
    listed = {node.get("id") for node in ET.parse(path).iter(f"{_GRAPHML}node")}  # noqa: S314 - expat has a limit
    for source, target, data in graph.edges(data=True):
        _check_listed((source, target), listed, f"the edge {source}-{target}")
        data.update(graph.graph["edge_default"] | data)
    for _, data in graph.nodes(data=True):
        data.update(graph.graph["node_default"] | data)
    return graph


def _edge_list(path: Path) -> nx.Graph:
    graph = nx.MultiGraph()
    for number, text in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), start=1):
        match text.partition("#")[0].split():
            case []:
                continue
            case [first, second]:
                graph.add_edge(first, second)
            case words:
                raise BadInput(f"line {number} holds {len(words)} words, {' '.join(words)!r}: write two agents a line")
    return graph


def _json(path: Path) -> nx.Graph:
    data = json.loads(path.read_text(encoding="utf-8-sig"))
    if not isinstance(data, dict):
        raise BadInput(f'holds {type(data).__name__} at the top: write an object with "edges"')
    if "nodes" in data:
        return _node_link(data)
    unknown = data.keys() - {"edges", "positions"}
    if unknown or "edges" not in data:
        raise BadInput(f'holds {", ".join(data) or "nothing"}: write "edges" and perhaps "positions"')
    graph = nx.MultiGraph()
    for edge in data["edges"]:
        if not (isinstance(edge, list) and (len(edge) == 2 or (len(edge) == 3 and isinstance(edge[2], dict)))):
            raise BadInput(f'the edge {edge!r} is not a pair: write it as ["1", "2"], or ["1", "2", {{"loss": 0.1}}]')
        graph.add_edges_from([(_text(edge[0]), _text(edge[1]), *edge[2:])])
    for agent, position in (data.get("positions") or {}).items():
        if agent not in graph:
            raise BadInput(f"there is no agent {agent!r} in this topology, only a position for it")
        graph.nodes[agent]["position"] = position
    return graph


def _node_link(data: Mapping[str, Any]) -> nx.Graph:
    graph: nx.Graph = nx.MultiDiGraph() if data.get("directed") else nx.MultiGraph()
    nodes = [_text(node.get("id", node.get("name", place))) for place, node in enumerate(data["nodes"])]
    by_place = not any("id" in node for node in data["nodes"])
    for name, node in zip(nodes, data["nodes"], strict=True):
        if name in graph:
            raise BadInput(f"two nodes have one name, {name}: rename one")
        graph.add_node(name, **{key: value for key, value in node.items() if key != "id"})
    for place, link in enumerate(data["links" if "links" in data else "edges"]):
        ends = [
            nodes[end] if by_place and isinstance(end, int) and 0 <= end < len(nodes) else _text(end)
            for end in (link["source"], link["target"])
        ]
        _check_listed(ends, graph, f"link {place}")
        graph.add_edges_from([(*ends, {key: link[key] for key in link if key not in ("source", "target")})])
    return graph


def _check_listed(ends: Any, nodes: Any, what: str) -> None:
    for end in ends:
        if end not in nodes:
            raise BadInput(f"{what} leads to {end!r}, and no node is called so: list it among the nodes")


def _text(value: Any) -> Any:
    """A number as the name that it is."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


_READERS: Mapping[str, Callable[[Path], nx.Graph]] = {
    ".graphml": _graphml,
    ".edgelist": _edge_list,
    ".edges": _edge_list,
    ".txt": _edge_list,
    ".json": _json,
}
