"""The graph of docs/own-graph.md, its scenario, its file and its commands, exactly as they are written there."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from ruamel.yaml import YAML

import volery
from volery.experiments.cli.app import main
from volery.experiments.scenario.load import load_scenario
from volery.experiments.sweeps.sweep_plan import plan_sweep

from .conftest import DOCS, blocks, typed

PAGE = "own-graph.md"
FUNCTION, OBJECT = blocks(PAGE, "python")
SCENARIO, FROM_FILE = blocks(PAGE, "yaml")
(FILE,) = blocks(PAGE, "xml")
COMMANDS = typed(PAGE)


@pytest.fixture
def rooms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the files of the page."""
    (tmp_path / "my_graph.py").write_text(FUNCTION, "utf-8")
    (tmp_path / "rooms.yaml").write_text(SCENARIO, "utf-8")
    (tmp_path / "zoo.graphml").write_text(FILE, "utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_page_and_its_example_are_short() -> None:
    """Function and scenario take no more than 40 lines, the page two screens."""
    assert len(f"{FUNCTION}{SCENARIO}".splitlines()) <= 40
    assert len((DOCS / PAGE).read_text("utf-8").splitlines()) <= 120


def test_every_command_does_what_the_page_says(rooms: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Twin and lockstep run, `verify` certifies, and the bridge has its latency."""
    said = []
    for command in COMMANDS:
        assert main(shlex.split(command)[1:]) == 0, command
        said.append(capsys.readouterr().out)
    assert [command.split()[1] for command in COMMANDS] == ["links", "run", "run", "verify"]
    assert "constant 50ms" in said[0]
    assert "certified: 144 estimates" in said[3]
    runs = [volery.load(path.parent) for path in sorted((rooms / "runs").glob("*/plan.json"))]
    assert [run.record.info["engine"] for run in runs] == ["twin", "zenoh"]
    assert set(runs[0].frames["fate"][runs[0].frames["source"] == "0"].tolist()) == {"delivered"}
    assert "my_graph.py" in (runs[0].folder / "sources.json").read_text("utf-8")


@pytest.mark.usefixtures("rooms")
def test_the_file_of_the_page() -> None:
    """Its names, its joined edges and its rates are as the page says."""
    yaml = YAML(typ="safe")
    fields = yaml.load(SCENARIO) | yaml.load(FROM_FILE)
    plan = load_scenario(fields).plan
    assert [agent.name for agent in plan.agents] == ["Basel", "Bern", "Zurich_HB"]
    assert {link: settings.rate for link, settings in plan.links.items() if link[0] < link[1]} == {
        ("Basel", "Bern"): 1e5,
        ("Bern", "Zurich_HB"): 2e6,
    }


@pytest.mark.usefixtures("rooms")
def test_the_sweep_of_the_page() -> None:
    """Each cell has the bridge that is asked for."""
    (words,) = re.findall(r"`volery (sweep .*)` asks", (DOCS / PAGE).read_text("utf-8"))
    _, scenario, _, over, *_ = words.split()
    cells = plan_sweep(scenario, over=[over]).loaded
    assert [one.plan.links["3", "4"].latency.minimum_ns for one in cells] == [20_000_000, 100_000_000]


@pytest.mark.usefixtures("rooms")
def test_the_object_of_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    """The Python lines run, and print the six agents; the run's scenario has the edge with its latency."""
    exec(OBJECT, {})  # noqa: S102 - the page's own lines
    assert capsys.readouterr().out == "('0', '1', '2', '3', '4', '5')\n"
    (scenario,) = Path("runs").glob("*/scenario.yaml")
    assert load_scenario(scenario).plan.links["0", "1"].latency.minimum_ns == 150_000_000
    assert main(["verify", str(scenario.parent)]) == 0
