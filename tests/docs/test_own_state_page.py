"""The robots of docs/own-state.md, their scenario and the commands, exactly as they are written there."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import volery
from volery.experiments.cli.app import main

from .conftest import blocks, typed

PAGE = "own-state.md"
ROBOTS, CENTRAL = blocks(PAGE, "python")
(SCENARIO,) = blocks(PAGE, "yaml")
COMMANDS = [command for command in typed(PAGE) if "robots" not in command]


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A working directory with the files of the page; one for all tests, since a process imports a module only once."""
    folder = tmp_path_factory.mktemp("robots")
    (folder / "yard.py").write_text(f"{ROBOTS}\n\n{CENTRAL}", "utf-8")
    (folder / "yard.yaml").write_text(SCENARIO, "utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        patch.chdir(folder)
        yield folder


def test_the_example_is_short() -> None:
    """World, sensor, quantity and estimator take no more than 40 lines."""
    assert len(ROBOTS.splitlines()) <= 40


@pytest.mark.long
def test_every_command_does_what_the_page_says(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Twin and lockstep are one; tables and figures treat each robot by itself."""
    said = []
    for command in COMMANDS:
        assert main(shlex.split(command)[1:]) == 0, command
        said.append(capsys.readouterr().out)
    twin, lockstep, verified = said
    for output in (twin, lockstep):
        assert "consistent" in output
        assert "error to truth" in output
    assert "certified" in verified
    figures = {path.name for path in (folder / "runs" / "twin" / "figures").iterdir()}
    assert {"estimates.png", "errors.png", "disagreement.png", "overview.png"} <= figures


def test_each_robot_has_errors_of_its_own() -> None:
    """Right covariances, though frames are lost; the central estimator, which loses none, is nearer to the truth."""
    overrides = ["agents.kind=yard:Judged", "duration=10 s"]
    run = volery.run("yard.yaml", engine="twin", overrides=overrides, name="judged")
    seen, one = run.samples("place"), run.metrics.consistency["place"]
    assert not seen.is_shared
    assert np.isnan(seen.disagreement).all()
    known = ~np.isnan(seen.estimate)
    assert not np.allclose(seen.truth[known], np.roll(seen.truth, 1, axis=1)[known], equal_nan=True)
    assert one.low < one.mean < one.high
    assert one.low < one.central < one.high
    oracle = np.sqrt(np.nanmean((seen.oracle - seen.truth) ** 2))
    own = np.sqrt(np.nanmean((seen.estimate - seen.truth) ** 2))
    assert oracle < own
    views = run.record.evaluated.views
    assert {agent: view.names for agent, view in views.items()} == {name: (name,) for name in "12345"}
