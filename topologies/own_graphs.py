"""Graphs of files and of a user's own code as topologies: names, joined edges, parts, positions, attributes of links.

Attributes of edges are kept as they are, per direction: what they say about links is for the scenario to read.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections import defaultdict
from collections.abc import Hashable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import networkx as nx
import numpy as np

from ..errors import BadInput
from .graphs import agents, edges, ordered, validate
from .naming import check_name, natural_key
from .regular import centred

Link = tuple[str, str]
"""Sender and receiver."""
Attributes = Mapping[str, Any]
_EARTH_RADIUS_M = 6_371_000.0
_OF_LINKS = "link attributes"
_STRUCTURE = {"id", "key"}
"""Attributes of edges that only tell edges apart."""
_GEOGRAPHIC = ({"longitude", "lon", "lng"}, {"latitude", "lat"})
_OTHER_CHARACTERS = re.compile(r"[^A-Za-z0-9]+")


class Remedies(NamedTuple):
    """Ends of error messages: what to do about edges to themselves, twice or one way only, parts, and names."""

    loop: str
    parallel: str
    one_way: str
    apart: str
    names: str


IN_FILE = Remedies(
    "remove it, or leave all such out with `merge: true`",
    "keep one, or join them with `merge: true`",
    "write the other direction too, or take it for both with `merge: true`",
    "link the parts, or take the largest with `component: largest`",
    "`names: id` replaces all other characters, `names: label` takes an attribute of the nodes",
)
IN_PYTHON = Remedies(
    "remove it, as graph.remove_edges_from(networkx.selfloop_edges(graph)) does",
    "keep one, as networkx.Graph(graph) does",
    "add the other direction too, as graph.to_undirected() does",
    "link the parts, or take one of networkx.connected_components(graph)",
    "networkx.relabel_nodes renames agents",
)


def topology_of(
    raw: nx.Graph,
    names: str | None = None,
    *,
    merge: bool = False,
    component: Literal["largest"] | None = None,
    remedies: Remedies = IN_PYTHON,
) -> nx.Graph:
    """The topology of any networkx graph; `link_attributes` has what its edges say.

    Numbers of nodes become names. Positions are in metres, from `position` or `pos`, or x, y and perhaps z; else, where
    every node has them, from longitude and latitude in degrees.

    Args:
        raw: directed or not, with or without parallel edges. An undirected edge says the same of both directions.
        names: attribute of the nodes that gives the names of agents, or `id`; characters that no name has become `_`.
        merge: whether parallel edges, and the one direction of an edge that has no other, stand for one edge, and
            edges of a node to itself for none.
        component: `largest` takes the largest connected part.
        remedies: what errors propose.
    Raises:
        BadInput: as `graphs.validate`; an edge with one direction, or two nodes with one name.
    """
    named = nx.relabel_nodes(raw, _names(raw, names, remedies))
    links = _links(named)
    both = nx.MultiGraph()
    both.add_nodes_from(named.nodes(data=True))
    for first, second in dict.fromkeys(ordered(*link) for link in links if not (merge and link[0] == link[1])):
        forth, back = links.get((first, second)), links.get((second, first))
        if not merge and not (forth and back):
            source, target = (first, second) if forth else (second, first)
            raise BadInput(f"{source}>{target} has no {target}>{source}, and links go both ways: {remedies.one_way}")
        copies = 1 if merge else max(len(forth or ()), len(back or ()))
        both.add_edges_from([(first, second)] * copies)
        links[first, second], links[second, first] = forth or back or [], back or forth or []
    if component is not None and len(both):
        parts = sorted(nx.connected_components(both), key=lambda part: (-len(part), min(map(natural_key, part))))
        both = nx.MultiGraph(both.subgraph(parts[0]))
    _place(both)
    clean = validate(both, loop=remedies.loop, parallel=remedies.parallel, apart=remedies.apart)
    given = {link: [each for each in links[link] if each] for edge in edges(clean) for link in (edge, edge[::-1])}
    clean.graph[_OF_LINKS] = {link: several for link, several in given.items() if several}
    return clean


def link_attributes(graph: nx.Graph) -> Mapping[Link, Sequence[Attributes]]:
    """Sender and receiver → the attributes of each of the edges that are joined to this link; those with any."""
    found: Mapping[Link, Sequence[Attributes]] = graph.graph.get(_OF_LINKS, {})
    return found


def with_link_attributes(graph: nx.Graph, others: Sequence[nx.Graph]) -> nx.Graph:
    """The graph, with the attributes of links that other graphs of the same agents have."""
    joined: dict[Link, list[Attributes]] = defaultdict(list)
    for other in others:
        for link, several in link_attributes(other).items():
            joined[link] += several
    graph.graph[_OF_LINKS] = dict(joined)
    return graph


def _links(named: nx.Graph) -> dict[Link, list[Attributes]]:
    """The attributes of every edge, in each of its directions."""
    links: dict[Link, list[Attributes]] = defaultdict(list)
    for source, target, data in named.edges(data=True):
        own = {str(name): value for name, value in data.items() if name not in _STRUCTURE}
        links[source, target].append(own)
        if not named.is_directed() and source != target:
            links[target, source].append(own)
    for link, several in link_attributes(named).items():
        links[link] += several
    return links


# -- names ------------------------------------------------------------------------------------------------------------


def _names(raw: nx.Graph, attribute: str | None, remedies: Remedies) -> dict[Hashable, str]:
    names = {node: _name(node, data, attribute, remedies) for node, data in raw.nodes(data=True)}
    owner: dict[str, Hashable] = {}
    for node, name in names.items():
        if name in owner:
            raise BadInput(f"the nodes {owner[name]!r} and {node!r} would both be called {name}: {remedies.names}")
        owner[name] = node
    return names


def _name(node: Hashable, data: Attributes, attribute: str | None, remedies: Remedies) -> str:
    if attribute is None:
        try:
            return check_name(_number_as_text(node))
        except BadInput as error:
            raise BadInput(f"{error}; {remedies.names}") from error
    value = node if attribute == "id" else data.get(attribute)
    if value is None:
        known = ", ".join(data) or "none"
        raise BadInput(f"the node {node!r} has no attribute {attribute!r} to be named by; it has {known}")
    letters = unicodedata.normalize("NFKD", str(value)).encode("ascii", "ignore").decode()
    try:
        return check_name(_OTHER_CHARACTERS.sub("_", letters).strip("_") or str(value))
    except BadInput as error:
        raise BadInput(f"the node {node!r}: {error}") from error


def _number_as_text(value: Any) -> Any:
    """Whole numbers become names, as files and networkx often number their nodes."""
    return str(value) if isinstance(value, int | np.integer) and not isinstance(value, bool) else value


# -- positions --------------------------------------------------------------------------------------------------------


def _place(graph: nx.Graph) -> None:
    """Turn what nodes say about where they are into `position` [m]."""
    for node, data in graph.nodes(data=True):
        axes = [axis for axis in ("x", "y", "z") if axis in data]
        if axes not in ([], ["x", "y"], ["x", "y", "z"]):
            raise BadInput(f"node {node} has the coordinates {', '.join(axes)}: write x and y, or x, y and z")
        if axes:
            data["position"] = [data[axis] for axis in axes]
        if "position" not in data and "pos" in data:
            data["position"] = data["pos"]
        if isinstance(data.get("position"), np.ndarray | list | tuple):
            data["position"] = [_number(value) for value in data["position"]]
    placed = any("position" in data for _, data in graph.nodes(data=True))
    if len(graph) and not placed:
        nx.set_node_attributes(graph, _geographic(graph), "position")


def _number(value: Any) -> Any:
    """Text of a number as one, as GraphML without types has it."""
    try:
        return float(value) if isinstance(value, str | np.number) else value
    except ValueError:
        return value


def _geographic(graph: nx.Graph) -> dict[str, tuple[float, ...]]:
    """Positions on the plane that touches the earth at the mean latitude, about their centroid; none if one lacks them.

    x = R cos φ₀ (λ − λ₀), y = R φ, with longitude λ and latitude φ in radians.
    """
    degrees: dict[str, list[float]] = {}
    for node in agents(graph):
        data = {str(name).lower(): _number(value) for name, value in graph.nodes[node].items()}
        found = [data[name] for words in _GEOGRAPHIC for name in data if name in words]
        if len(found) != len(_GEOGRAPHIC) or not all(isinstance(each, int | float) for each in found):
            return {}
        degrees[node] = found
    first, middle = next(iter(degrees.values())), math.fsum(north for _, north in degrees.values()) / len(degrees)
    scale = math.radians(_EARTH_RADIUS_M)
    return centred(
        {
            node: (scale * math.cos(math.radians(middle)) * ((east - first[0] + 180) % 360 - 180), scale * north)
            for node, (east, north) in degrees.items()
        }
    )
