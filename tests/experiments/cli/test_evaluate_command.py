"""`volery evaluate`, and runs whose evaluation fails in the user's code."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from volery import load as load_run

MODULE = """\
from volery.agents.agent import Agent
from volery.experiments.evaluation.evaluation import Evaluation


class Judge(Evaluation):
    def truth(self, agent, quantity, index, time_ns):
        return {truth}


class Quiet(Agent):
    evaluation = Judge

    def start(self):
        self.context.report("x", 3.0)
"""
SCENARIO = "duration: 0.1 s\ntopology: {line: 2}\nagents: {kind: '%s:Quiet'}\nlinks: {latency: 1 ms}\n"


@pytest.fixture
def own(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """`own("1.0")` writes agents whose evaluation has that truth, in a module of this test, and quiet.yaml."""
    name = f"quiet_{request.node.name}"
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(truth: str) -> None:
        (tmp_path / f"{name}.py").write_text(MODULE.format(truth=truth), "utf-8")
        (tmp_path / "quiet.yaml").write_text(SCENARIO % name, "utf-8")

    return write


def test_a_run_whose_evaluation_fails_says_so_and_is_evaluated_once_that_is_mended(
    volery: Callable[..., Any], own: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run is kept with its frames; the error stands in tables and refusals until `evaluate` has succeeded."""
    own("1.0 / 0")
    said = volery("run", "quiet.yaml", "--engine", "twin", "--no-figures", "--name", "mine")
    failure = "Judge.truth failed: ZeroDivisionError: float division by zero"
    reason = f"this run is not evaluated, `volery evaluate RUN` does it: {failure}"
    assert said.code == 1
    assert reason in said.error
    (problem,) = load_run("runs/mine").problems
    assert problem.startswith(f"{reason}\n  File ")
    assert "the sum of frames closes on every link" in volery("metrics", "mine").out
    assert reason in volery("export", "mine", "--csv").error
    assert failure in volery("evaluate", "mine").error
    own("1.0")
    _forget(monkeypatch)
    assert volery("evaluate", "mine").out.split() == ["runs/mine/evaluation.npz"]
    assert load_run("runs/mine").problems == ()
    rows = _exported(volery)
    assert {row[-3:] for row in rows} == {("3.0", "nan", "1.0")}


def _forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a new process: the mended module is read again."""
    import importlib
    import sys

    for name in [name for name in sys.modules if name.startswith("quiet_")]:
        monkeypatch.delitem(sys.modules, name)
    importlib.invalidate_caches()


def _exported(volery: Callable[..., Any]) -> list[tuple[str, ...]]:
    (path, _) = volery("export", "mine", "--csv").out.split()
    _, *rows = Path(path).read_text("utf-8").splitlines()
    return [tuple(row.split(",")) for row in rows]
