"""The command line in this process, in a folder of its own, and runs to look at."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

import volery as package
from volery.experiments.cli import app as cli

SCENARIO = """\
name: short
seed: 3
duration: 1 s
topology: {hexagonal: 4}
agents: {kind: dfa-module, rounds: 3, payload: float32}
world: {kind: plane, altitude: 0.2 m, distance_noise: 5 mm}
links:
  medium: {kind: half-duplex, per: edge, access: {tdma: {cycle: 60 Hz, guard: 0.2 ms}}}
  rate: 115.2 kbit/s
  bits_per_byte: 10
  overhead: 4 B
  latency: 2 ms
faults:
  - {at: 0.3 s, for: 0.2 s, cut: 1-2}
"""


class Said(NamedTuple):
    """What a command ended with and printed."""

    code: int
    out: str
    error: str


Volery = Callable[..., Said]


@pytest.fixture
def volery(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Volery:
    """`volery("metrics", "last")` in an empty folder that holds a scenario, short.yaml."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(Path(package.__file__).resolve().parents[1]))
    Path("short.yaml").write_text(SCENARIO, encoding="utf-8")

    def call(*words: str) -> Said:
        code = cli.main(words)
        return Said(code, *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def twin_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run of the short scenario in the twin; not to be changed."""
    folder = tmp_path_factory.mktemp("twin")
    (folder / "short.yaml").write_text(SCENARIO, encoding="utf-8")
    words = ["run", str(folder / "short.yaml"), "--engine", "twin", "--no-figures", "--runs", str(folder / "runs")]
    assert cli.main([*words, "--name", "short"]) == 0
    return folder / "runs" / "short"


@pytest.fixture
def own_run(volery: Volery, twin_run: Path) -> Path:
    """A copy of that run in the folder of the test, at runs/short."""
    assert volery is not None
    folder = Path("runs/short")
    shutil.copytree(twin_run, folder)
    return folder
