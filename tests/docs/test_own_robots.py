"""The five robots of docs/own_robots.py: tables, figures, certificate, sweep and film treat them as any swarm."""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import volery
from volery.experiments.cli.app import main

from .conftest import DOCS, typed

COMMANDS = [command for command in typed("own-state.md") if command.startswith("volery") and "robots" in command]


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A working directory with the two files; one for all tests, since a process imports a module only once."""
    folder = tmp_path_factory.mktemp("robots")
    for name in ("own_robots.py", "own_robots.yaml"):
        shutil.copy(DOCS / name, folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        patch.chdir(folder)
        yield folder


def test_the_file_is_short() -> None:
    """World, sensors, estimator and central filter."""
    assert len((DOCS / "own_robots.py").read_text("utf-8").splitlines()) <= 100


def test_robots_and_central_filter_are_consistent() -> None:
    """The central filter, which knows how errors correlate, is nearer to the truth; covariances are right."""
    run = volery.run("own_robots.yaml", engine="twin", overrides=["duration=10 s"])
    place, consistency = run.samples("place"), run.metrics.consistency["place"]
    assert consistency.low < consistency.mean < consistency.high
    assert consistency.low < consistency.central < consistency.high
    assert np.isnan(place.disagreement).all()
    settled = place.time_ns > 2 * 10**9
    errors = [np.sqrt(np.nanmean((one[settled] - place.truth[settled]) ** 2)) for one in (place.oracle, place.estimate)]
    assert errors[0] < errors[1]
    views = run.record.evaluated.views
    assert {agent: (view.names, len(view.covariances) > 0) for agent, view in views.items()} == {
        agent: ((agent,), True) for agent in run.samples("place").agents
    }


@pytest.mark.long
def test_every_command_treats_them_as_any_swarm(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Tables, figures, certificate, film, sweep and comparison, as docs/own-state.md says."""
    said = {}
    for command in COMMANDS:
        assert main(shlex.split(command)[1:]) == 0, command
        said[command.split()[1]] = capsys.readouterr().out
    assert list(said) == ["run", "verify", "plot", "sweep", "compare"]
    assert said["verify"].startswith("certified: ")
    assert "consistent" in said["run"]
    assert "place.oracle_error.steady_rms" in said["sweep"]
    assert re.search("0.9 .* 0.9995 │ *0.05 ", said["compare"])
    assert re.search("0 .* 1.128 │ *0.063 ", said["compare"])
    figures = folder / "runs" / "robots" / "figures"
    assert {"estimates.png", "errors.png", "disagreement.png", "overview.png", "animation.gif"} <= {
        path.name for path in figures.iterdir()
    }
