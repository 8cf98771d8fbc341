"""The agent of docs/own-agent.md, its scenario and its commands, exactly as they are written there."""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import volery
from volery.agents.agent import Agent
from volery.experiments import execution
from volery.experiments.cli.app import main
from volery.experiments.evaluation.evaluation import Evaluation

from .conftest import blocks, typed

PAGE = "own-agent.md"
(AGENT,) = blocks(PAGE, "python")
(SCENARIO,) = blocks(PAGE, "yaml")
COMMANDS = typed(PAGE)
OF_NO_PAGE = {Agent: ["keeps_state"], Evaluation: ["declared"]}
"""Methods that follow from others."""


def write(folder: Path) -> None:
    """The two files of the page."""
    (folder / "my_agent.py").write_text(AGENT, "utf-8")
    (folder / "room.yaml").write_text(SCENARIO, "utf-8")


@pytest.fixture(scope="module", autouse=True)
def _module(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Where Python finds the module of the page; one for all tests, since a process imports it only once."""
    folder = tmp_path_factory.mktemp("agent")
    write(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        yield


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the two files."""
    write(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def mean_temperature() -> float:
    """Of eight thermometers on a regular octagon with sides of 1 m, by the formula of the page."""
    angles = np.arange(8) * np.pi / 4
    radius = 0.5 / np.sin(np.pi / 8)
    x, y = radius * np.cos(angles), radius * np.sin(angles)
    return float((18.0 + 6.0 / (1.0 + (x - 2.0) ** 2 + y**2)).mean())


def test_the_agent_is_short() -> None:
    """A complete agent of one's own, with what judges it, takes no more than 45 lines."""
    assert len(AGENT.splitlines()) <= 45


@pytest.mark.usefixtures("room")
def test_the_average_is_found() -> None:
    """Every thermometer ends at the mean of all, to which the oracle agrees.

    A round shrinks the spread of at most 6 degrees by (1 + 2 cos 45°)/3 = 0.805; after 99 rounds 3e-9 are left.
    """
    seen = volery.run("room.yaml", engine="twin").samples("temperature")
    assert seen.agents == tuple("12345678")
    assert seen.oracle[-1] == pytest.approx(mean_temperature(), abs=1e-12)
    assert seen.estimate[-1] == pytest.approx(mean_temperature(), abs=1e-8)
    assert seen.disagreement[0] > 0.1


def test_every_command_does_what_the_page_says(
    room: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Typed one after the other: twin and lockstep find the mean, the run is certified, loss moves the mean.

    Figures, which the page does not speak of, are not drawn.
    """
    monkeypatch.setattr(execution, "draw", lambda *_: [])
    said = []
    for command in COMMANDS:
        assert main(shlex.split(command)[1:]) == 0, command
        said.append(capsys.readouterr().out)
    assert [command.split()[1] for command in COMMANDS] == ["validate", "run", "run", "verify", "run"]
    assert "certified: 800 estimates" in said[3]
    twin, lockstep, lossy = (volery.load(folder) for folder in sorted((room / "runs").iterdir()))
    assert lockstep.record.info["pace"] == "lockstep"
    for run in (twin, lockstep):
        assert run.samples("temperature").oracle_error[-1].max() < 1e-8
    seen = lossy.samples("temperature")
    assert seen.disagreement[-1] < 1e-6
    assert seen.oracle_error[-1].min() > 1e-3


@pytest.mark.usefixtures("room")
def test_a_thermometer_that_is_killed_comes_back() -> None:
    """It begins anew at the next round after its restart, and all agree again, not quite on the mean of all."""
    run = volery.run("room.yaml", engine="twin", overrides=["faults=[{at: 2 s, for: 1.01 s, kill: 5}]"])
    assert run.problems == ()
    seen = run.samples("temperature")
    theirs = seen.estimate[:, seen.agents.index("5"), 0]
    missing = np.isnan(theirs)
    assert (seen.time_ns[missing].min(), seen.time_ns[missing].max()) == (2 * 10**9, 3 * 10**9)
    assert seen.disagreement[-1] < 1e-3 < seen.oracle_error[-1].min()


def test_the_page_names_all_that_a_class_may_override() -> None:
    """Every public method of an agent and of an evaluation, and every class attribute."""
    page = (Path(__file__).parents[2] / "docs" / PAGE).read_text("utf-8")
    for base in (Agent, Evaluation):
        hooks = [name for name in vars(base) if not name.startswith("_")]
        assert [name for name in hooks if f"`{name}`" not in page and f"def {name}(" not in page] == OF_NO_PAGE[base]


@pytest.mark.parametrize("scenario", ["room.yaml", "room/room.yaml", "../room/room.yaml"])
def test_the_module_is_found_beside_the_scenario(tmp_path: Path, scenario: str) -> None:
    """As the installed command has it: Python itself does not look in the working directory."""
    for name in ("room", "elsewhere"):
        (tmp_path / name).mkdir()
    write(tmp_path / "room")
    places = {"room.yaml": tmp_path / "room", "room/room.yaml": tmp_path, "../room/room.yaml": tmp_path / "elsewhere"}
    words = [sys.executable, "-P", "-m", "volery", "validate", scenario]
    done = subprocess.run(words, cwd=places[scenario], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_module_is_found_in_the_working_directory(tmp_path: Path) -> None:
    """The scenario may lie elsewhere, as the one in a run's folder does."""
    (tmp_path / "elsewhere").mkdir()
    write(tmp_path)
    (tmp_path / "room.yaml").rename(tmp_path / "elsewhere" / "room.yaml")
    words = [sys.executable, "-P", "-m", "volery", "validate", "elsewhere/room.yaml"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
