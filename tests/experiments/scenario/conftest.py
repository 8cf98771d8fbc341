"""A scenario to start from, and its loading with changes."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import pytest

from volery.errors import BadInput
from volery.experiments.scenario.load import Scenario, load_scenario

TEXT = """\
name: example
seed: 7
duration: 10 s
topology: {line: 3}
agents:
  kind: tiny_agents:Talker
  rate: 20 Hz
links:
  medium: {kind: half-duplex, per: edge, access: {tdma: {cycle: 60 Hz, guard: 0.2 ms}}}
  rate: 115.2 kbit/s
  bits_per_byte: 10
  overhead: 4 B
  latency: {normal: {mean: 2 ms, sd: 0.5 ms}}
  loss: {gilbert-elliott: {to_bad: 0.05, to_good: 0.3, loss_bad: 0.9}}
faults:
  - {at: 3 s, until: 4 s, cut: 1-2}
  - {at: 6 s, for: 1 s, where: all, set: {loss: {bernoulli: 0.5}}}
"""


class Load(Protocol):
    """Loads the example with lines of its text replaced, and with overrides."""

    def __call__(self, *overrides: str, replacing: tuple[str, str] = ("", "")) -> Scenario:
        """The scenario."""


class Refusal(Protocol):
    """As `Load`, for what is refused."""

    def __call__(self, *overrides: str, replacing: tuple[str, str] = ("", "")) -> str:
        """The message, without the folder of the file."""


@pytest.fixture(autouse=True)
def _tiny_agents(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parent)


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Load the example."""

    def load_example(*overrides: str, replacing: tuple[str, str] = ("", "")) -> Scenario:
        assert replacing[0] in TEXT
        path = tmp_path / "example.yaml"
        path.write_text(TEXT.replace(*replacing, 1) if replacing[0] else TEXT + replacing[1], encoding="utf-8")
        return load_scenario(path, overrides).scenario

    return load_example


@pytest.fixture
def refusal(load: Load, tmp_path: Path) -> Refusal:
    """Why the example, changed, is refused."""

    def refuse(*overrides: str, replacing: tuple[str, str] = ("", "")) -> str:
        with pytest.raises(BadInput) as caught:
            load(*overrides, replacing=replacing)
        assert caught.value.exit_code == 2
        return str(caught.value).replace(f"{tmp_path}/", "")

    return refuse
