"""Loads scenarios: from a name or a file, with overrides, to a validated scenario and its plan."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ...agents.plan import Plan
from ...units import quantity
from .compile import attempt
from .explaining import explain
from .library import builtin_scenarios, find_source, new_scenario_text, scenario_text
from .schema import Scenario, json_schema, resolved_yaml
from .settings_reading import validated
from .trace_files import anchor
from .yaml_document import Loc, Problem, read_document

__all__ = [
    "LoadedScenario",
    "Scenario",
    "builtin_scenarios",
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


def load_scenario(source: str | Path, overrides: Sequence[str] = ()) -> LoadedScenario:
    """The scenario of a built-in name or a file, read and compiled once.

    A fault, or a graph or edge of a topology that changes, that starts after the end of the run is refused, unless an
    override shortened the run: then it is left out.

    Args:
        source: a name such as dfa16-lossy, or the path of a YAML file.
        overrides: such as `links.loss.bernoulli=0.3`; the later wins.
    Raises:
        BadInput: every error at once, each as `file:line:column: field: message`, or `--set KEY: field: message`.
    """
    name, label, text, folder = find_source(source)
    _reach(Path.cwd(), folder)
    document = read_document(text, label, overrides)
    document.data.setdefault("name", name)

    def folder_of(place: Loc) -> Path:
        return Path.cwd() if document.is_overridden(place) else folder

    files = list(_graph_files(document.data.get("topology"), folder_of))
    for field in ("links", "faults"):
        files += anchor(document.data.get(field), folder_of, (field,))
    try:
        scenario: Scenario = validated(Scenario, document.data)
    except ValidationError as error:
        raise document.error(explain(error)) from error
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
