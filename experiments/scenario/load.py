"""Scenarios, the front door: a name or a file, with overrides, to a validated scenario."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from .compile import attempt, compile_plan
from .explaining import explain
from .library import Source, builtin_scenarios, find_source, new_scenario_text, scenario_text
from .link_schema import validated
from .schema import SCENARIO, Scenario, json_schema, known_fields, resolved_yaml
from .trace_files import anchor
from .yaml_document import read_document

__all__ = [
    "Scenario",
    "builtin_scenarios",
    "compile_plan",
    "json_schema",
    "load_scenario",
    "new_scenario_text",
    "read_scenario",
    "resolved_yaml",
    "scenario_text",
]


def load_scenario(source: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """The scenario of a built-in name or a file.

    Args:
        source: a name such as dfa16-lossy, or the path of a YAML file.
        overrides: such as `links.loss.bernoulli=0.3`; the later wins.
    Raises:
        BadInput: every error at once, each as `file:line:column: field: message`, or `--set KEY: field: message`.
    """
    return read_scenario(find_source(source), overrides)


def read_scenario(source: Source, overrides: Sequence[str] = ()) -> Scenario:
    """The scenario of a text, as `load_scenario` reads it.

    Raises:
        BadInput: as there.
    """
    name, label, text, folder = source
    _reach(Path.cwd(), folder)
    document = read_document(text, label, overrides)
    document.data.setdefault("name", name)
    overridden = any(path[:2] in {("topology",), ("topology", "file")} for path in document.overrides)
    _anchor_all(document.data.get("topology"), Path.cwd() if overridden else folder)
    for field in ("links", "faults"):
        anchor(
            document.data.get(field), lambda place: Path.cwd() if document.is_overridden(place) else folder, (field,)
        )
    try:
        scenario = validated(SCENARIO, document.data)
    except ValidationError as error:
        raise document.error(explain(error, partial(known_fields, document.data))) from error
    _, problems = attempt(scenario)
    if problems:
        raise document.error(problems)
    return scenario


def _reach(*folders: Path) -> None:
    """Let `kind: module:Class` find modules in these folders; what is installed comes first."""
    sys.path.extend(place for place in map(str, folders) if place not in sys.path)


def _anchor_all(topology: Any, folder: Path) -> None:
    """Anchor the graph, or every graph of a schedule."""
    schedule = topology.get("schedule") if isinstance(topology, dict) else None
    for graph in schedule if isinstance(schedule, list) else [topology]:
        _anchor(graph, folder)


def _anchor(topology: Any, folder: Path) -> None:
    """Make the path of a graph's file absolute, so that the scenario means the same wherever it is read."""
    if isinstance(topology, dict):
        place, key = (topology["file"], "path") if isinstance(topology.get("file"), dict) else (topology, "file")
        if isinstance(place.get(key), str):
            place[key] = str(folder / Path(place[key]).expanduser())
