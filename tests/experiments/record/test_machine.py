"""What the bits of a run depend on is in its folder, and a verdict names what is not everywhere alike."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

import pytest

import volery
from volery.agents.dfa.module import DfaModule
from volery.experiments.record.machine import libraries
from volery.experiments.scenario.load import load_scenario
from volery.experiments.verify import verify


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A run of modules whose numbers are said to come from msgpack."""
    monkeypatch.setattr(DfaModule, "libraries", lambda _: ("msgpack",))
    return volery.run("dfa4", overrides=["duration=300 ms"], engine="twin", runs=tmp_path).folder


def test_a_verdict_names_the_libraries_that_the_bits_come_from(folder: Path) -> None:
    """Those that the kinds of agents name, with their versions, which are in the folder too."""
    assert json.loads((folder / "run.json").read_text())["libraries"] == {"msgpack": version("msgpack")}
    verdict = verify(folder)
    assert verdict.certified
    assert verdict.lines[0].endswith(f"bit for bit, with msgpack {version('msgpack')}")


def test_another_version_of_such_a_library_makes_bits_not_comparable(folder: Path) -> None:
    """The run is compared within a tolerance then, and not certified."""
    info = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps({**info, "libraries": {"msgpack": "0.0"}}))
    verdict = verify(folder)
    assert not verdict.certified
    assert verdict.lines[0].startswith("not comparable bit for bit here: libraries {'msgpack': '0.0'} there")


def test_kinds_name_what_their_parameters_choose() -> None:
    """The solver of a moving horizon; most kinds name nothing."""
    assert libraries(load_scenario("mhe-pitch").plan) == {"daqp": version("daqp")}
    assert libraries(load_scenario("dfa4").plan) == {}
    assert libraries(load_scenario("mav3").plan) == {}
    pytest.importorskip("numba")
    compiled = load_scenario("mav3", ["agents.filtering.form=compiled"]).plan
    assert libraries(compiled) == {"numba": version("numba")}
