"""`volery run`, in the twin: what it prints, leaves behind, and ends with."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from volery.experiments.cli import run_command as cli_run
from volery.experiments.execution import execute
from volery.experiments.record import record as mcap_record
from volery.experiments.scenario import compile as compile_module
from volery.experiments.scenario import load as scenario_load

from .conftest import Volery

TWIN = ("--engine", "twin", "--no-figures")


def test_run_ends_with_metrics_verdict_and_folder(volery: Volery) -> None:
    """Ten lines of progress, the tables, the verdict and the run's folder, which holds scenario, record and metrics."""
    said = volery("run", "short.yaml", *TWIN, "--name", "mine")
    assert (said.code, said.error) == (0, "")
    lines = said.out.splitlines()
    assert [line[:12] for line in lines[:10]] == [f"{tenth / 10:.1f} of 1 s: " for tenth in range(1, 11)]
    assert "in force: t1: cut 1–2" in lines[3]
    assert "in force" not in lines[0] + lines[9]
    assert "4 of 4 agents alive" in lines[0]
    assert "as asked: no late frame" in said.out
    assert lines[-1].split() == ["run", "runs/mine"]
    assert {path.name for path in Path("runs/mine").iterdir()} == {
        *("scenario.yaml", "plan.json", "record.mcap", "evaluation.npz", "metrics.json", "run.json", "sources.json"),
        "sources",
    }


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["none.yaml"], "none.yaml: cannot be read"),
        (["dfa16-losy"], "did you mean 'dfa16-lossy'?"),
        (["short.yaml", "--set", "durations=1 s"], "--set durations: unknown field (did you mean 'duration'?)"),
        (["short.yaml", "--set", "duration=0 s"], "must be above 0"),
        (["short.yaml", "--set", "duration"], "write KEY=VALUE"),
        (["short.yaml", "--set", "links.loss.bernoulli=1.5"], "lies between 0 and 1"),
        (["short.yaml", "--set", "links.rate=5 s"], "links.rate"),
        (["short.yaml", "--set", "agents.estimator=mean"], "agents.estimator"),
        (["short.yaml", "--set", "faults.0.cut=1-99"], "there is no agent '99'"),
        (["short.yaml", "--speed", "0"], "it must be above 0"),
        (["short.yaml", "--speed", "2"], "the twin and lockstep run as fast as they can"),
        (["short.yaml", "--detach"], "--detach is for swarms over Zenoh"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_run_refuses_bad_input_and_leaves_nothing(volery: Volery, words: list[str], message: str) -> None:
    """Exit code 2, a message that names the place and the remedy, and no folder."""
    said = volery("run", *words, "--engine", "twin")
    assert said.code == 2
    assert message in " ".join(said.error.replace("│", "").split())
    assert not Path("runs").exists()


def test_two_runs_of_one_name(volery: Volery) -> None:
    """A run is never overwritten by another of its name."""
    volery("run", "short.yaml", *TWIN, "--name", "mine")
    before = Path("runs/mine/record.mcap").read_bytes()
    said = volery("run", "short.yaml", *TWIN, "--name", "mine")
    assert said.code == 2
    assert said.error.startswith("error: runs/mine exists already: choose another --name")
    assert Path("runs/mine/record.mcap").read_bytes() == before


def test_strict_ends_with_3_where_the_machine_did_not_keep_up(volery: Volery, monkeypatch: pytest.MonkeyPatch) -> None:
    """--strict is 0 for a run as asked, and 3 for another, which without it is only told."""
    assert volery("run", "short.yaml", *TWIN, "--strict").code == 0

    def late(*arguments: Any) -> Any:
        outcome = execute(*arguments)
        fidelity = replace(outcome.metrics.fidelity, as_asked=False)
        return replace(outcome, metrics=replace(outcome.metrics, fidelity=fidelity))

    monkeypatch.setattr(cli_run, "execute", late)
    assert volery("run", "short.yaml", *TWIN, "--strict").code == 3
    assert volery("run", "short.yaml", *TWIN).code == 0


def test_problems_are_told_and_end_with_1(volery: Volery, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run with problems failed, even with --strict, and says why."""

    def failing(*arguments: Any) -> Any:
        outcome = execute(*arguments)
        info = {**outcome.record.info, "problems": ["agent 3 ended with exit code 1"]}
        return replace(outcome, record=replace(outcome.record, info=info))

    monkeypatch.setattr(cli_run, "execute", failing)
    said = volery("run", "short.yaml", *TWIN, "--strict")
    assert said.code == 1
    assert "error: agent 3 ended with exit code 1" in said.error


def test_interrupt_keeps_what_was_recorded(volery: Volery) -> None:
    """Ctrl-C during a long twin run: it ends whole at that instant, with metrics, and is certified."""
    command = [sys.executable, "-m", "volery", "run", "short.yaml", *TWIN, "--set", "duration=120 s", "--name", "mine"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("12.")
        process.send_signal(signal.SIGINT)
        out, error = process.communicate()
    assert process.returncode == 0, error
    assert "s of the run took" in out
    kept = json.loads(volery("metrics", "last", "--json").out)["mine"]
    assert 11 < kept["seconds"] < 120
    assert volery("verify", "mine").out.startswith("certified")


def test_detach_tells_why_the_swarm_could_not_start(volery: Volery) -> None:
    """An error of the process in the background is shown, with its exit code, and nothing is left behind."""
    said = volery("run", "short.yaml", "--detach", "--listen", "tcp/127.0.0.1:99999")
    assert said.code == 2
    assert said.error.startswith("error: cannot listen at tcp/127.0.0.1:99999")
    assert list(Path("runs").iterdir()) == []


def test_a_run_is_read_compiled_and_loaded_once(volery: Volery, monkeypatch: pytest.MonkeyPatch) -> None:
    """With metrics and figures: one reading of the scenario, one compilation, one loading of the record."""
    counts = Counter[str]()

    def counted(module: ModuleType, name: str) -> None:
        real = getattr(module, name)

        def call(*arguments: Any, **options: Any) -> Any:
            counts[name] += 1
            return real(*arguments, **options)

        monkeypatch.setattr(module, name, call)

    counted(scenario_load, "read_document")
    counted(compile_module, "attempt")
    counted(scenario_load, "attempt")
    counted(mcap_record, "collect")
    said = volery("run", "short.yaml", "--engine", "twin", "--name", "mine")
    assert said.code == 0
    figures = [line.split()[1] for line in said.out.splitlines() if line.startswith("figure ")]
    assert "runs/mine/figures/overview.png" in figures
    assert all(Path(figure).stat().st_size > 0 for figure in figures)
    assert counts == {"read_document": 1, "attempt": 1, "collect": 1}


def test_data_files_that_a_scenario_names_are_kept(volery: Volery) -> None:
    """Traces and graphs, with their hashes; the plan has what is in them."""
    Path("loss.csv").write_text("time_s,loss\n0,0.25\n", "utf-8")
    Path("graph.edges").write_text("1 2\n2 3\n", "utf-8")
    changes = ["topology={file: graph.edges}", "links.loss={trace: loss.csv}", "world=null", "faults=[]"]
    changes.append("agents={kind: beacon}")
    said = volery("run", "short.yaml", *TWIN, "--name", "mine", *(word for one in changes for word in ("--set", one)))
    assert said.code == 0, said.error
    kept = json.loads(Path("runs/mine/sources.json").read_text("utf-8"))
    here = Path.cwd().resolve()
    assert {f"data{here}/loss.csv", f"data{here}/graph.edges"} <= kept.keys()
    assert Path(f"runs/mine/sources/data{here}/loss.csv").read_bytes() == Path("loss.csv").read_bytes()


def test_faults_beyond_a_shorter_duration_are_left_out_with_a_note(volery: Volery) -> None:
    """Of an override; a file that says so itself is refused. What is kept begins as the whole run does."""
    said = volery("run", "short.yaml", *TWIN, "--set", "duration=0.2 s", "--name", "cut")
    assert said.code == 0, said.error
    assert said.error == "note: faults.0 is left out: starts at 0.3 s, the run ends at 0.2 s\n"
    assert "cut: 1-2" not in Path("runs/cut/scenario.yaml").read_text("utf-8")
    assert volery("verify", "cut").out.startswith("certified")
    text = Path("short.yaml").read_text("utf-8").replace("duration: 1 s", "duration: 0.2 s")
    Path("shorter.yaml").write_text(text, "utf-8")
    said = volery("run", "shorter.yaml", *TWIN)
    assert said.code == 2
    assert "faults.0.at: starts at 0.3 s, the run ends at 0.2 s: start it earlier" in said.error
