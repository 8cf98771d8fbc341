"""Readers of a run take its folder and nothing else."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import volery

MODULE = """\
from volery.agents.agent import Agent
from volery.experiments.evaluation.evaluation import Evaluation, View
from volery.quantities import Component, Quantity


class Judge(Evaluation):
    quantities = (Quantity("x", (Component("height", "m"),)),)

    def truth(self, agent, quantity, index, time_ns):
        return 1.0

    def view(self, agent, reports):
        return View({"mark": [reports["x"][0], 0.0]})


class Absent(Agent):
    evaluation = Judge

    def start(self):
        self.context.report("x", 3.0)
"""
SCENARIO = """\
duration: 0.1 s
topology: {line: 2, spacing: 1 m}
agents: {kind: 'absent_module:Absent'}
links: {latency: 1 ms}
"""
READER = """\
import sys
from pathlib import Path

import volery
from volery.experiments.analysis.export import write
from volery.experiments.figures.animation import still

run = volery.load(sys.argv[1])
assert run.metrics.quantities["x"].truth_error.final == 2.0
assert run.samples("x").components[0].name == "height"
assert len(run.frames["fate"]) == 0
out = Path(sys.argv[1]) / "read"
run.plot("estimates", out=out, formats=["png"])
write(run.record, "csv", out)
still(run.record, out, 50_000_000)
print(sorted(path.name for path in out.iterdir()))
"""


def test_a_run_is_read_where_the_users_module_is_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Metrics, samples, frames, figures, tables and stills, in a process that cannot find it."""
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    (here / "absent_module.py").write_text(MODULE, "utf-8")
    (here / "own.yaml").write_text(SCENARIO, "utf-8")
    monkeypatch.syspath_prepend(str(here))
    run = volery.run(here / "own.yaml", engine="twin", runs=here / "runs", name="mine")
    folder = run.folder.rename(there / "moved")
    command = [sys.executable, "-c", READER, str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=there)
    assert done.stderr == ""
    assert done.stdout.split() == ["['estimates.csv',", "'estimates.png',", "'frames.csv',", "'still-0.05s.png']"]
