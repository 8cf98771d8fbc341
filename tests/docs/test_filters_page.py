"""docs/filters.md: every filter and way to average is explained, and the filter that is shown runs as is said of it."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import volery
from volery.estimators.averages.average_consensus import AVERAGINGS, LOCAL
from volery.estimators.distributed.filters import FILTERS

from .conftest import DOCS, blocks

TEXT = (DOCS / "filters.md").read_text("utf-8")
ROWS = dict(re.findall(r"^\| `([\w-]+)` \|.*\| ([^|]*) \|$", TEXT, re.MULTILINE))


def test_every_filter_and_averaging_has_its_row() -> None:
    """And no other; the last column of an averaging says whether the graph may change."""
    assert set(ROWS) == {*FILTERS, *AVERAGINGS}
    assert {name for name in AVERAGINGS if ROWS[name] == "yes"} == set(LOCAL)


def test_the_filter_that_is_shown_runs_and_is_as_it_is_said_to_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its ANEES is near one, 1.5 being chance in 45 samples, that of the other filter below, whose error is smaller."""
    (code,), (scenario,) = blocks("filters.md", "python"), blocks("filters.md", "yaml")
    (tmp_path / "my_filter.py").write_text(code, "utf-8")
    (tmp_path / "contender.yaml").write_text(scenario, "utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    found: dict[str, dict[str, float]] = {}
    cases: dict[str, list[str]] = {"own": [], "other": ["agents.filter=hybrid-contributions"]}
    for name, overrides in cases.items():
        run = volery.run("contender.yaml", engine="twin", overrides=overrides, name=name)
        found[name] = {finding.name: finding.value for finding in run.metrics.findings}
    sys.modules.pop("my_filter")
    assert found["own"]["ANEES"] < 1.5
    assert found["other"]["ANEES"] < 1.0
    assert found["other"]["position error"] < found["own"]["position error"]
