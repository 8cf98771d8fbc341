"""The models of docs/own-links.md, their scenario and its commands, exactly as they are written there."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

import volery
from volery.experiments.cli.app import main

from .conftest import blocks, typed

PAGE = "own-links.md"
(MODELS,) = blocks(PAGE, "python")
(SCENARIO,) = blocks(PAGE, "yaml")
COMMANDS = typed(PAGE)


@pytest.fixture(scope="module", autouse=True)
def _module(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Where Python finds the module of the page; one for all tests, since a process imports it only once."""
    folder = tmp_path_factory.mktemp("links")
    (folder / "my_links.py").write_text(MODELS, "utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        yield


@pytest.fixture
def air(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the two files."""
    (tmp_path / "my_links.py").write_text(MODELS, "utf-8")
    (tmp_path / "air.yaml").write_text(SCENARIO, "utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_models_are_short() -> None:
    """Three models in 40 lines; the one of distance and length takes no more than 15 of them, imports included."""
    assert len(MODELS.splitlines()) <= 40
    assert len(MODELS.partition("@dataclass(frozen=True)\nclass Bursts")[0].rstrip().splitlines()) <= 15


def test_every_command_does_what_the_page_says(air: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Typed one after the other: twin and lockstep agree, the run is certified, what models say is what happened."""
    said = []
    for command in COMMANDS:
        assert main(shlex.split(command)[1:]) == 0, command
        said.append(capsys.readouterr().out)
    assert [command.split()[1] for command in COMMANDS] == ["validate", "run", "run", "verify", "links"]
    assert said[3].startswith("certified: ")
    assert "my_links:Fading 30m, mean varies" in said[4]
    folders = sorted(path for path in (air / "runs").iterdir() if (path / "plan.json").exists())
    twin, lockstep = (volery.load(folder) for folder in folders)
    links = twin.metrics.links
    for name, other in lockstep.metrics.links.items():
        assert (links[name].account, links[name].age) == (other.account, other.age)
    assert Counter(one.channel.loss.decision for one in links.values()) == {"within": 6}
    assert Counter(one.channel.latency.decision for one in links.values()) == {"within": 6}
    assert links["2>3"].channel.loss.asked == pytest.approx((20 / 30) ** 4)
    assert links["1>2"].channel.loss.asked == pytest.approx(((20 / 30) ** 4 + 0.2) / 2, abs=1e-3)
    assert links["2>3"].channel.latency.asked == pytest.approx(5e6)
