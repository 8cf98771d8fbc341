"""docs/faults.md shows every fault, in the timeline and live, and every example is one that volery takes."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.analysis.accounting import account
from volery.experiments.cli import app as cli
from volery.experiments.cli import fault_commands as cli_faults
from volery.experiments.record.record import Collector
from volery.experiments.scenario.expansion import parse_fault
from volery.experiments.scenario.fault_places import parse_agents, parse_links, places_of, read_words
from volery.experiments.scenario.load import load_scenario
from volery.experiments.scenario.timeline import ACTIONS, TROUBLES
from volery.experiments.swarm import running_swarm as remote
from volery.experiments.twin import Twin
from volery.transport.faults import Hog

from .conftest import blocks, typed

PAGE = "faults.md"
SCENARIO, *FRAGMENTS = blocks(PAGE, "yaml")
COMMANDS = typed(PAGE)


def plan_of(fragment: str, folder: Path) -> Plan:
    """The plan of the page's scenario with the fields of one of its other blocks."""
    yaml = YAML(typ="safe")
    text = StringIO()
    yaml.dump(yaml.load(SCENARIO) | (yaml.load(fragment) if fragment else {}), text)
    path = folder / "faults.yaml"
    path.write_text(text.getvalue(), "utf-8")
    return load_scenario(path).plan


@pytest.mark.parametrize("fragment", ["", *FRAGMENTS], ids=range(len(FRAGMENTS) + 1))
def test_what_is_shown_runs(fragment: str, tmp_path: Path) -> None:
    """Each block asks for faults, and a run with them comes to its end in the twin, where that has them."""
    plan = plan_of(fragment, tmp_path)
    assert plan.faults
    if not any(isinstance(fault, Hog) for fault in plan.faults):
        collector = Collector()
        Twin(plan, collector).run()
        assert all(link.closes for link in account(collector.record(plan)).values())


def test_every_fault_is_shown_both_ways() -> None:
    """Each action and trouble stands in a block of YAML, each command of `volery fault` in one for the shell."""
    entries = " ".join(FRAGMENTS)
    assert [word for word in (*ACTIONS, *TROUBLES) if f"{word}: " not in entries] == []
    shown = {command.split()[2] for command in COMMANDS}
    assert shown == {*cli_faults.fault} - {"--help", "-h", "--version"}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_understood(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it asks of the supervisor, that would do: the fault, the links or the agents exist in the scenario."""
    asked: list[Mapping[str, Any]] = []
    monkeypatch.setattr(cli_faults, "running_swarm", lambda *_: remote.RunningSwarm(tmp_path))
    monkeypatch.setattr(remote, "call", lambda _, request: asked.append(request))
    assert cli.main(shlex.split(command)[1:]) == 0
    (request,) = asked
    places = places_of(plan_of("", tmp_path))
    if request["do"] == "inject":
        assert parse_fault(request["fault"], "f1", places, 10**10)
    elif "links" in request:
        assert parse_links(request["links"], places)
    elif "agents" in request:
        assert parse_agents(read_words(request["agents"]), places)
    else:
        assert request["do"] == "clear"


def test_from_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page's block of Python asks for what it says, of a run whose folder says that it runs."""
    asked: list[Mapping[str, Any]] = []

    def call(_folder: Path, request: Mapping[str, Any]) -> Any:
        asked.append(request)
        return {"faults": {"f1": "cut 1–2"}} if request["do"] == "status" else "done"

    monkeypatch.setattr(remote, "call", call)
    monkeypatch.chdir(tmp_path)
    (code,) = blocks(PAGE, "python")
    with pytest.raises(BadInput, match="runs/demo is not running"):
        exec(code, {})  # noqa: S102 - the page's own example
    (tmp_path / "runs/demo").mkdir(parents=True)
    (tmp_path / "runs/demo/control.json").touch()
    exec(code, {})  # noqa: S102 - the page's own example
    assert [request["do"] for request in asked] == ["inject", "inject", "inject", "restart", "clear", "status"]
    places = places_of(plan_of("", tmp_path))
    assert all(parse_fault(request["fault"], "f1", places, 10**10) for request in asked[:3])
