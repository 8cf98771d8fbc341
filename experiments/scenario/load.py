"""Loads scenarios: from a name or a file, with overrides, to a validated scenario and its plan."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import networkx as nx
from pydantic import ValidationError

from ...agents.plan import Plan
from ...errors import BadInput
from ...topologies import edges, positions, topology_of
from ...units import quantity
from ...user_code import names_user_code
from .compile import attempt
from .edge_settings import edge_settings
from .explaining import explain
from .library import find_source, new_scenario_text, scenario_text
from .python_values import plain
from .schema import Scenario, json_schema, resolved_yaml
from .settings_reading import validated
from .trace_files import anchor
from .yaml_document import NOTHING, Document, Loc, Problem, read_document, read_fields

__all__ = [
    "LoadedScenario",
    "Scenario",
    "json_schema",
    "load_scenario",
    "new_scenario_text",
    "resolved_yaml",
    "scenario_text",
]


@dataclass(frozen=True)
class LoadedScenario:
    """A scenario and its plan.

    scenario: the validated scenario.
    plan: the compiled plan.
    notes: parts of the file that are not in the plan, one sentence each.
    files: graphs and traces that the scenario names.
    """

    scenario: Scenario
    plan: Plan
    notes: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()


Source = str | Path | Mapping[str, Any]
"""A scenario: its built-in name, the path of its file, or its fields from Python, see `python_values`."""


@names_user_code
@names_user_code
def load_scenario(source: Source, overrides: Sequence[str] = (), given: Mapping[str, Any] = NOTHING) -> LoadedScenario:
    """The scenario of a built-in name or a file, or of its fields themselves, read and compiled once.

    A fault, or a graph or edge of a topology that changes, that starts after the end of the run is refused, unless an
    override shortened the run: then it is left out.

    Args:
        source: a name such as dfa16-lossy, the path of a YAML file, or its fields.
        overrides: such as `links.loss.bernoulli=0.3`; the later wins.
        given: fields from Python that replace those of the source.
    Raises:
        BadInput: every error at once, each as `file:line:column: field: message`, or `--set KEY: field: message`; of
            what comes from Python as `field: message`.
    """
    graph = _graph(source, given)
    own = {} if graph is None else {"topology": _fields(graph)}
    document, folder = _read(source, overrides, {**given, **own})
    _reach(Path.cwd(), folder)

    def folder_of(place: Loc) -> Path:
        return Path.cwd() if document.is_overridden(place) else folder

    files = list(_graph_files(document.data.get("topology"), folder_of))
    for field in ("links", "faults"):
        files += anchor(document.data.get(field), folder_of, (field,))
    try:
        scenario: Scenario = validated(Scenario, document.data)
    except ValidationError as error:
        raise document.error(explain(error)) from error
    if graph is not None:
        scenario = _with_edges_of(graph, scenario, document)
    late: list[tuple[Loc, str, int]] = [
        (("faults", index), "from" if entry.at is None else "at", entry.start_ns)
        for index, entry in enumerate(scenario.faults)
        if not scenario.in_run(entry)
    ]
    shortened = document.is_overridden(("duration",))
    if shortened:
        topology, late_parts = scenario.topology.shortened(scenario.duration)
        scenario = replace(scenario, topology=topology)
        late += [(("topology", *place), "", start_ns) for place, start_ns in late_parts]
    end = quantity(scenario.duration, "ns")
    texts = [
        (place, field, f"starts at {quantity(start, 'ns')}, the run ends at {end}") for place, field, start in late
    ]
    plan, problems = attempt(scenario)
    if not shortened:
        problems += [Problem((*place, field), f"{text}: start it earlier") for place, field, text in texts]
    if plan is None or problems:
        raise document.error(problems)
    notes = tuple(f"{'.'.join(map(str, place))} is left out: {text}" for place, _, text in texts)
    return LoadedScenario(scenario, plan, notes, tuple(dict.fromkeys(files)))


def _graph(source: Source, given: Mapping[str, Any]) -> nx.Graph | None:
    """The networkx graph that stands in the place of `topology`, as a topology; None if there is none."""
    topology = given.get("topology", source.get("topology") if isinstance(source, Mapping) else None)
    try:
        return topology_of(topology) if isinstance(topology, nx.Graph) else None
    except BadInput as error:
        raise BadInput(f"topology: {error}") from error


def _fields(graph: nx.Graph) -> dict[str, Any]:
    """The topology as a scenario has it."""
    fields: dict[str, Any] = {"edges": ["-".join(edge) for edge in edges(graph)]}
    return fields | ({"positions": places} if (places := positions(graph)) else {})


def _with_edges_of(graph: nx.Graph, scenario: Scenario, document: Document) -> Scenario:
    """The scenario with what the graph's edges say of links, before its entries of `links: only:`."""
    if override := next((key for path, key in document.overrides.items() if path[0] == "topology"), None):
        raise BadInput(f"--set {override}: topology is a networkx graph here: change that")
    try:
        of_edges = edge_settings(graph, Path.cwd())
    except BadInput as error:
        raise BadInput(f"topology: {error}") from error
    return replace(scenario, links=replace(scenario.links, only=(*of_edges, *scenario.links.only)))


def _read(source: Source, overrides: Sequence[str], given: Mapping[str, Any]) -> tuple[Document, Path]:
    """The fields of a scenario, and the folder in which the relative paths in them start."""
    if isinstance(source, Mapping):
        return read_fields(plain({"name": "scenario", **source, **given}), overrides), Path.cwd()
    name, label, text, folder = find_source(source)
    document = read_document(text, label, overrides, plain(given))
    document.data.setdefault("name", name)
    return document, folder


def _reach(*folders: Path) -> None:
    """Let `kind: module:Class` find modules in these folders, after installed ones."""
    sys.path.extend(place for place in map(str, folders) if place not in sys.path)


def _graph_files(topology: Any, folder_of: Callable[[Loc], Path]) -> Iterator[Path]:
    """Make the paths of graph files absolute, so that they mean the same wherever they are read; the paths."""
    schedule = topology.get("schedule") if isinstance(topology, dict) else None
    graphs = schedule if isinstance(schedule, list) else [topology]
    for index, graph in enumerate(graphs):
        place: Loc = ("topology", "schedule", index) if graph is not topology else ("topology",)
        if isinstance(graph, dict) and "file" in graph:
            below = isinstance(graph["file"], dict)
            node, key = (graph["file"], "path") if below else (graph, "file")
            if isinstance(node.get(key), str):
                path = folder_of((*place, "file", "path") if below else (*place, "file")) / Path(node[key]).expanduser()
                node[key] = str(path)
                yield path
