"""The world of docs/own-world.md, its scenario and its commands, exactly as they are written there."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import volery
from volery.experiments.cli.app import main
from volery.experiments.scenario.load import load_scenario

from .conftest import DOCS, blocks, typed

PAGE = "own-world.md"
WORLD, RANGES = blocks(PAGE, "python")
(SCENARIO,) = blocks(PAGE, "yaml")
LONGEST = 40


@pytest.fixture(scope="module", autouse=True)
def _module(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Where Python finds the module of the page, and another one whose world has the `measure` of the second block."""
    folder = tmp_path_factory.mktemp("world")
    (folder / "my_world.py").write_text(WORLD, "utf-8")
    before, _, rest = WORLD.partition("    def measure(")
    after = rest[rest.index("    def measure_frame(") :]
    (folder / "my_seeing_world.py").write_text(before + re.sub("(?m)^", "    ", RANGES) + "\n" + after, "utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        yield


@pytest.fixture
def pond(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the two files."""
    (tmp_path / "my_world.py").write_text(WORLD, "utf-8")
    (tmp_path / "pond.yaml").write_text(SCENARIO, "utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def error(folder: Path) -> float:
    """Root mean square of the error to the truth at the end, as the table has it."""
    return volery.load(folder).metrics.quantities["place"].truth_error.steady_rms


def test_the_example_is_short() -> None:
    """World and agent together."""
    assert sum(bool(line.strip()) for line in WORLD.splitlines()) <= LONGEST


@pytest.mark.usefixtures("pond")
def test_ranges_of_frames_make_the_error_smaller() -> None:
    """As the page says, of the run in the twin; without hearing anybody there are the fixes alone."""
    with_ranges, alone = (
        error(volery.run("pond.yaml", engine="twin", overrides=overrides).folder)
        for overrides in ([], ["links.loss.bernoulli=1"])
    )
    told = re.search(r"alone give an error of (.*?) m; with the ranges it is (.*?) m", (DOCS / PAGE).read_text("utf-8"))
    assert told is not None
    assert [f"{alone:.2f}", f"{with_ranges:.2f}"] == list(told.groups())


@pytest.mark.usefixtures("pond")
def test_a_sensor_that_looks_at_others_says_whom_it_sees() -> None:
    """The `measure` of the second block: of ducks one radian apart on a circle of 20 m those within 25 m."""
    world = load_scenario("pond.yaml", ["world.kind=my_seeing_world:Pond"]).plan.world
    assert world is not None
    seen = world.measure("2", "fix", 0)
    apart = np.abs(2 * 20 * np.sin((np.arange(5) - 1) / 2))
    expected = [(number, far) for number, far in enumerate(apart) if 0 < far < 25]
    np.testing.assert_allclose(np.array(seen), expected)
    assert [number for number, _ in expected] == [0, 2]


@pytest.mark.long
def test_every_command_does_what_the_page_says(pond: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Typed one after the other: twin and lockstep have the same errors, and the run is certified."""
    printed = []
    for command in typed(PAGE):
        assert main(shlex.split(command)[1:]) == 0, command
        printed.append(capsys.readouterr().out)
    assert [command.split()[1] for command in typed(PAGE)] == ["validate", "run", "run", "verify", "sweep"]
    assert "certified: 500 estimates" in printed[3]
    twin, lockstep = sorted((pond / "runs").glob("*-pond"))
    assert error(twin) == error(lockstep)
