"""list, show, new, validate."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from volery.experiments.scenario.library import builtin_scenarios
from volery.experiments.scenario.load import load_scenario, scenario_text

from .conftest import Volery


def test_list_names_every_built_in_scenario(volery: Volery) -> None:
    """One row for each, with its paper."""
    said = volery("list")
    assert said.code == 0
    assert all(f"│ {scenario.name} " in said.out for scenario in builtin_scenarios())


def test_show_prints_the_file_as_it_is(volery: Volery) -> None:
    """What `volery show` writes into a file is the scenario itself, of a built-in one and of a file."""
    assert volery("show", "dfa16-lossy").out == scenario_text("dfa16-lossy")
    assert volery("show", "short.yaml").out == Path("short.yaml").read_text("utf-8")


def test_show_resolved_prints_what_is_run(volery: Volery) -> None:
    """With --resolved, defaults and overrides are written out, and reading that back gives the same scenario."""
    said = volery("show", "short.yaml", "--resolved", "--set", "seed=9")
    Path("resolved.yaml").write_text(said.out, "utf-8")
    assert load_scenario("resolved.yaml").scenario == load_scenario("short.yaml", ["seed=9"]).scenario
    assert volery("show", "short.yaml", "--set", "seed=9").code == 2


def test_new_writes_a_scenario_that_is_valid(volery: Volery) -> None:
    """`volery new` writes NAME.yaml, which validates as it is, and overwrites nothing."""
    assert volery("new", "mine").code == 0
    text = Path("mine.yaml").read_text("utf-8")
    assert volery("validate", "mine.yaml").code == 0
    again = volery("new", "mine.yaml")
    assert (again.code, again.out) == (2, "")
    assert again.error.startswith("error: mine.yaml exists already")
    assert Path("mine.yaml").read_text("utf-8") == text


@pytest.mark.parametrize("name", ["no such folder/mine", "two words"])
def test_new_with_a_name_that_cannot_be_leaves_no_file(volery: Volery, name: str) -> None:
    """A file that cannot be written, or a name that cannot name a run, is bad input."""
    assert volery("new", name).code == 2
    assert sorted(Path().iterdir()) == [Path("short.yaml")]


def test_validate_prints_utilisation_and_puts(volery: Volery) -> None:
    """A row for each medium, and the puts per second of all: 10 directed links, 20 Hz, 3 rounds."""
    said = volery("validate", "short.yaml")
    assert said.code == 0
    assert all(word in said.out for word in ("1>2", "utilisation", "600 puts/s"))


def test_validate_refuses_an_overloaded_medium(volery: Volery) -> None:
    """More airtime than there is: exit code 2, unless the scenario says overload: true."""
    fields = ["links.medium.access=aloha", "links.rate=20 kbit/s", "agents.timing=asynchronous"]
    aloha = [word for field in fields for word in ("--set", field)]
    said = volery("validate", "short.yaml", *aloha)
    assert said.code == 2
    assert "airtime utilisation is above 100 %" in said.error
    assert volery("validate", "short.yaml", *aloha, "--set", "overload=true").code == 0
    assert volery("run", "short.yaml", "--engine", "twin", *aloha).code == 2
    assert not Path("runs").exists()


def test_validate_prints_the_schema(volery: Volery) -> None:
    """The JSON Schema for editors, whole and without a scenario."""
    schema = json.loads(volery("validate", "--schema").out)
    assert {"topology", "agents", "links", "faults"} <= set(schema["properties"])
    assert volery("validate").code == 2
