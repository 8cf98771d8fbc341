"""Topologies from files: GraphML, edge lists, and two JSON formats."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

import networkx as nx

from ..errors import BadInput
from .graphs import from_edges, validate


def read(path: str | Path) -> nx.Graph:
    """Read a topology in the format given by the suffix; positions are in metres.

    - `.graphml`: node data x, y and optionally z give the position.
    - `.edgelist`, `.edges`, `.txt`: two agents per line; `#` starts a comment.
    - `.json`: networkx node-link data with x, y, z or `position` at the nodes; or
      `{"edges": [["1", "2"], …], "positions": {"1": [0, 0], …}}`, the positions being optional.

    Raises:
        BadInput: no such file, an unknown suffix, damaged text, or not a valid topology; the message names the file.
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
    except (ParseError, nx.NetworkXException, ValueError, TypeError, KeyError, AttributeError) as error:
        raise BadInput(f"{path}: damaged, or not a {path.suffix} topology: {error}") from error


def _graphml(path: Path) -> nx.Graph:
    return _with_positions(nx.read_graphml(path))


def _edge_list(path: Path) -> nx.Graph:
    pairs = []
    for number, text in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), start=1):
        match text.partition("#")[0].split():
            case []:
                continue
            case [first, second]:
                pairs.append((first, second))
            case words:
                raise BadInput(f"line {number} holds {len(words)} words, {' '.join(words)!r}: write two agents a line")
    return from_edges(pairs)


def _json(path: Path) -> nx.Graph:
    data = json.loads(path.read_text(encoding="utf-8-sig"))
    if not isinstance(data, dict):
        raise BadInput(f'holds {type(data).__name__} at the top: write an object with "edges"')
    if "nodes" in data:
        links = "links" if "links" in data else "edges"
        return _with_positions(nx.node_link_graph({**data, "multigraph": True}, edges=links))
    unknown = data.keys() - {"edges", "positions"}
    if unknown or "edges" not in data:
        raise BadInput(f'holds {", ".join(data) or "nothing"}: write "edges" and perhaps "positions"')
    return from_edges([_pair(edge) for edge in data["edges"]], positions=data.get("positions"))


def _pair(edge: Any) -> tuple[str, str]:
    if isinstance(edge, list) and len(edge) == 2:
        return _name(edge[0]), _name(edge[1])
    raise BadInput(f'the edge {edge!r} is not a pair: write it as ["1", "2"]')


def _with_positions(raw: nx.Graph) -> nx.Graph:
    """Rename the nodes to agents' names, and convert their x, y, z to positions."""
    for node, data in raw.nodes(data=True):
        axes = [axis for axis in ("x", "y", "z") if axis in data]
        if axes not in ([], ["x", "y"], ["x", "y", "z"]):
            raise BadInput(f"node {node} has the coordinates {', '.join(axes)}: write x and y, or x, y and z")
        if axes:
            data["position"] = [data[axis] for axis in axes]
    names = {node: _name(node) for node in raw}
    if len(set(names.values())) < len(names):
        raise BadInput("two nodes have one name, once as a number and once as text: rename one")
    return validate(nx.relabel_nodes(raw, names))


def _name(value: Any) -> str:
    """Name of an agent; whole numbers become names, as files often number their nodes."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


_READERS: Mapping[str, Callable[[Path], nx.Graph]] = {
    ".graphml": _graphml,
    ".edgelist": _edge_list,
    ".edges": _edge_list,
    ".txt": _edge_list,
    ".json": _json,
}
