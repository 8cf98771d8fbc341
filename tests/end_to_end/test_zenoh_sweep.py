"""A sweep over Zenoh says what the sweep in the twin says."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import pytest

import volery

ENGINES: tuple[Literal["zenoh", "twin"], ...] = ("zenoh", "twin")
OVER = {"links.loss.bernoulli": [0.3]}
SHORT = ("duration=0.5 s",)


def test_a_cell_over_zenoh_equals_its_twin(tmp_path: Path) -> None:
    """Real processes in lockstep pace, started by a worker of the pool: every number of the run is the twin's."""
    rows = [
        volery.sweep("dfa4", OVER, overrides=SHORT, engine=engine, runs=tmp_path, name=engine, workers=1).rows
        for engine in ENGINES
    ]
    assert rows[0] == rows[1]
    assert 0.5 < (rows[0][0].values["links.delivered_fraction"] or 0) < 0.9
    assert not list((tmp_path / "zenoh").glob("runs/*"))


def test_a_sweep_from_python_shows_how_far_it_is_when_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """On the standard error, the first and the last of it too; unasked it says nothing."""
    for progress in (True, False):
        volery.sweep("dfa4", OVER, overrides=SHORT, runs=tmp_path, workers=1, fresh=True, progress=progress)
        said = capsys.readouterr()
        assert (said.out, said.err.splitlines()) == ("", ["0 of 1 runs", "1 of 1 runs"] if progress else [])
