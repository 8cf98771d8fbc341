"""docs/scenario.md names every field that a scenario may have, and everything that it shows can be loaded."""

from __future__ import annotations

import re
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from volery.errors import BadInput
from volery.experiments.scenario.load import json_schema, load_scenario

from .conftest import DOCS, blocks

PAGE = "scenario.md"
TEXT = (DOCS / PAGE).read_text("utf-8")
EXAMPLE, *FRAGMENTS = blocks(PAGE, "yaml")
CODE = " ".join(re.findall(r"```.*?```|`[^`\n]*`", TEXT, re.DOTALL))
IN_CODE = {*re.findall(r"[\w-]+", CODE), *re.findall(r"[\w-]+(?:\.\w+)+", CODE)}


def schema_names(node: Any) -> Iterator[str]:
    """Every name of a field, and every word to choose from, in a JSON Schema."""
    if isinstance(node, dict):
        yield from node.get("properties", ())
        yield from (word for word in (*node.get("enum", ()), node.get("const")) if isinstance(word, str))
        for child in node.values():
            yield from schema_names(child)
    elif isinstance(node, list):
        for child in node:
            yield from schema_names(child)


def test_every_field_of_the_schema_is_explained() -> None:
    """Fields, kinds and choices of all that the JSON Schema knows stand in the page as code."""
    names = set(schema_names(json_schema()))
    assert len(names) > 300
    assert names - IN_CODE == set()


@pytest.mark.parametrize("fragment", [{}, *FRAGMENTS], ids=range(len(FRAGMENTS) + 1))
def test_what_is_shown_can_be_loaded(fragment: str, tmp_path: Path) -> None:
    """The example as it stands, and with each of the other blocks in its place."""
    yaml = YAML(typ="safe")
    changed = yaml.load(EXAMPLE) | (yaml.load(fragment) if fragment else {})
    text = StringIO()
    yaml.dump(changed, text)
    path = tmp_path / "example.yaml"
    path.write_text(text.getvalue() if fragment else EXAMPLE, "utf-8")
    assert load_scenario(path).plan.name == "example"


def test_the_error_that_is_shown(tmp_path: Path) -> None:
    """The page's example of a message is what volery says."""
    (scenario,) = blocks("own-agent.md", "yaml")
    path = tmp_path / "room.yaml"
    path.write_text(scenario.replace("latency", "latncy").replace("my_agent:Thermometer, rate: 20 Hz", "dfa-module"))
    (said,) = re.findall(r"`(room\.yaml:.*?)`", TEXT, re.DOTALL)
    with pytest.raises(BadInput) as refused:
        load_scenario(path)
    assert str(refused.value).removeprefix(f"{tmp_path}/") == " ".join(said.split())
