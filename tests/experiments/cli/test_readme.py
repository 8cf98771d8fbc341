"""What the README tells its readers to type can be typed."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from volery.experiments.cli.app import app
from volery.experiments.scenario.load import load_scenario
from volery.experiments.scenario.validate import validate_plan

from ...surroundings import BUILT_IN
from .conftest import Volery

ROOT = Path(__file__).parents[3]
README = (ROOT / "README.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)
TYPED = [line for kind, block in BLOCKS if kind == "sh" for line in block.splitlines() if line.startswith("volery ")]
IN_TABLES = re.findall(r"^\| `(volery [^`]*)` \|", README, re.MULTILINE)
NAMED = [line for line in IN_TABLES if "SCENARIO" not in line and "RUN" not in line and "," not in line]


@pytest.mark.parametrize("line", [*TYPED, *NAMED])
def test_commands_parse(line: str) -> None:
    """Every command line of the README is one, and runs a scenario that there is."""
    words = shlex.split(line, comments=True)[1:]
    app.parse_args(words, exit_on_error=False)
    if words[0] == "run":
        assert words[1] in {*BUILT_IN, "mine.yaml"}


def test_enough_is_found() -> None:
    """The README has the commands of the tour, which the test above must not lose sight of."""
    assert len(TYPED) > 10
    assert {line.split()[1] for line in TYPED} >= {"run", "fault", "metrics", "plot", "verify", "validate"}


def test_scenario_is_valid(volery: Volery) -> None:
    """The scenario of the README validates, with the override of the README too."""
    assert volery is not None
    (text,) = (block for kind, block in BLOCKS if kind == "yaml")
    Path("mine.yaml").write_text(text, "utf-8")
    for overrides in ([], ["links.loss.bernoulli=0.3"]):
        validate_plan(load_scenario("mine.yaml", overrides).plan)


def test_python_example_runs(volery: Volery, capsys: pytest.CaptureFixture[str]) -> None:
    """The Python of the README runs, here for a few seconds of the run, and the run is as asked."""
    assert volery is not None
    (code,) = (block for kind, block in BLOCKS if kind == "python")
    code = code.replace('engine="twin"', 'engine="twin", overrides=["duration=5 s", "faults=[]"]')
    exec(compile(code, "README.md", "exec"), {})  # noqa: S102 - our own README
    assert "as asked" in capsys.readouterr().out


def test_pictures_and_files_are_there() -> None:
    """Every relative link of the README leads to a file."""
    targets = [target for target in re.findall(r"\]\(([^)]+)\)", README) if not target.startswith("http")]
    assert [target for target in targets if not (ROOT / target).exists()] == []
