"""Kinds of agents by name."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest

from volery import kinds
from volery.agents import registry
from volery.agents.dfa.module import DfaModule
from volery.errors import BadInput

OWN = "from volery.agents.agent import Agent\n\nclass Mine(Agent):\n    pass\n\nNOT_A_CLASS = 3\n"


@pytest.fixture
def _own_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A user's own file beside the scenario."""
    (tmp_path / "own_agents_of_a_test.py").write_text(OWN, "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    yield
    kinds._added.cache_clear()


def test_built_in_kinds_have_names() -> None:
    """A scenario says `dfa-module`."""
    assert registry.find("dfa-module") is DfaModule
    assert "dfa-module" in registry.AGENTS.names()


@pytest.mark.usefixtures("_own_file")
def test_a_class_in_a_users_file_is_found() -> None:
    """By `module:Class`, with nothing to be changed here."""
    found = registry.find("own_agents_of_a_test:Mine")
    assert (found.__module__, found.__name__) == ("own_agents_of_a_test", "Mine")


@pytest.mark.usefixtures("_own_file")
def test_an_installed_package_brings_kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Through the entry points of the group `volery.agents`."""
    points = EntryPoints([EntryPoint("mine", "own_agents_of_a_test:Mine", registry.AGENTS.entry_points)])
    monkeypatch.setattr(kinds, "entry_points", points.select)
    kinds._added.cache_clear()
    assert registry.find("mine").__name__ == "Mine"
    assert "mine" in registry.AGENTS.names()


@pytest.mark.usefixtures("_own_file")
@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("dfa-modul", r"unknown agent kind 'dfa-modul' \(did you mean 'dfa-module'"),
        ("quite-another", "or write package.module:Class"),
        ("no_such_module_anywhere:Mine", "cannot be loaded: No module named"),
        ("own_agents_of_a_test:Yours", "cannot be loaded: .* has no attribute 'Yours'"),
        ("own_agents_of_a_test:NOT_A_CLASS", "is 3, not a subclass of volery.agents.agent.Agent"),
        ("pathlib:Path", "not a subclass of volery.agents.agent.Agent"),
    ],
)
def test_what_is_no_kind_is_refused(kind: str, message: str) -> None:
    """The message says what is wrong and what would be right."""
    with pytest.raises(BadInput, match=message.replace("?", r"\?")):
        registry.find(kind)
