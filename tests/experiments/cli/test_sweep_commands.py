"""`volery sweep`, `compare`, and `plot` of a sweep, from the words to what is printed."""

from __future__ import annotations

import json
from collections.abc import Generator, Iterable
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from volery.experiments.cli.progress_display import SweepProgress, duration
from volery.experiments.sweeps.pools import Done
from volery.experiments.sweeps.sweep import Advance, SweepOptions
from volery.experiments.sweeps.sweep_plan import Job
from volery.experiments.sweeps.sweep_runs import run_job

from .conftest import Volery

SWEEP = (
    "sweep",
    "short.yaml",
    "--over=links.loss.bernoulli=0:0.6:0.3",
    "--over=agents.estimator=running-sum,metropolis-least-squares",
    "--set=duration=0.4 s",
)
ERROR = "estimate.oracle_error.steady_rms"


@pytest.fixture(autouse=True)
def _in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs are carried out one after the other, without processes."""

    def pool(_options: SweepOptions) -> object:
        def carry_out(jobs: Iterable[Job]) -> Generator[Done, None, None]:
            for job in jobs:
                yield Done(job, run_job(job))

        return carry_out

    monkeypatch.setattr(SweepOptions, "pool", pool)


def test_a_sweep_from_words_to_figures(volery: Volery) -> None:
    """The table, where it is, and that it went on; then comparison and figures of the same sweep by its name."""
    said = volery(*SWEEP, "--repeat", "2")
    assert said.code == 0
    assert ERROR in said.out
    assert "running-sum" in said.out
    assert "12 of 12 runs" in said.out
    assert "too few seeds to tell" in said.error
    (folder,) = Path("runs").iterdir()
    assert folder.name.startswith("short-")
    assert f"table    {folder}/table.parquet" in said.out
    again = volery(*SWEEP, "--repeat", "3")
    assert again.out.startswith("12 of 18 runs\n")
    assert "18 of 18 runs" in again.out

    told = json.loads(volery("compare", folder.name, "--by", "links.loss.bernoulli", "--json").out)
    first = told[ERROR][0]
    assert first["where"] == {"agents.estimator": "running-sum"}
    assert first["standings"][0]["contestant"] == "0"
    assert [one["count"] for one in first["standings"]] == [3, 3, 3]
    bytes_too = volery("compare", str(folder), "--measure", "links.bytes_per_agent_s", "--measure", ERROR)
    assert bytes_too.out.index("links.bytes_per_agent_s") < bytes_too.out.index(ERROR)

    drawn = volery("plot", folder.name, "curves", "heat", "--format", "svg").out.split()
    assert [Path(path) for path in drawn] == [folder / "figures/sweep-curves.svg", folder / "figures/sweep-heat.svg"]
    assert all(Path(path).stat().st_size > 0 for path in drawn)


def test_sweeps_side_by_side(volery: Volery) -> None:
    """Two sweeps of one scenario compete in the cells that both have; those of different scenarios do not."""
    volery(*SWEEP, "--name", "three", "--set", "agents.rounds=3")
    volery("sweep", "short.yaml", *SWEEP[2:4], "--set=duration=0.4 s", "--set=agents.rounds=1", "--name", "one")
    said = volery("compare", "one", "three")
    assert said.code == 0
    assert {"three", "one"} <= {*said.out.replace("│", " ").split()}
    Path("other.yaml").write_text(Path("short.yaml").read_text("utf-8").replace("name: short", "name: other"), "utf-8")
    volery("sweep", "other.yaml", *SWEEP[2:], "--name", "other")
    refused = volery("compare", "one", "other")
    assert (refused.code, "another scenario, other, than runs/one, short" in refused.error) == (2, True)


def test_runs_side_by_side(volery: Volery) -> None:
    """Runs that differ in their seed are repetitions of one contestant, runs that differ in nothing are two.

    Runs and sweeps are not mixed.
    """
    words = ("run", "short.yaml", "--engine", "twin", "--no-figures", "--set=duration=0.4 s")
    for name, *changes in (("a", "seed=1"), ("b", "seed=2"), ("c", "seed=1", "links.loss.bernoulli=0.5")):
        volery(*words, "--name", name, *(word for change in changes for word in ("--set", change)))
    told = json.loads(volery("compare", "a", "b", "c", "--json").out)
    assert [*told] == [ERROR, "links.delivered_fraction", "links.bytes_per_agent_s"]
    standings = told[ERROR][0]["standings"]
    assert {one["contestant"]: one["count"] for one in standings} == {"a": 2, "c": 1}
    assert told["links.delivered_fraction"][0]["standings"][0]["contestant"] == "a"
    volery(*words, "--name", "again", "--set", "seed=1")
    (twice,) = json.loads(volery("compare", "a", "again", "--measure", ERROR, "--json").out)[ERROR]
    assert {one["contestant"]: one["count"] for one in twice["standings"]} == {"a": 1, "again": 1}
    assert len({one["mean"] for one in twice["standings"]}) == 1
    volery(*SWEEP[:3], "--name", "sweep", "--set=duration=0.4 s")
    refused = volery("compare", "a", "sweep")
    assert (refused.code, "both kinds" in refused.error) == (2, True)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--over=links.lss=0,1",), "--over links.lss: unknown field (did you mean 'loss'?)"),
        (("--over=links.loss.bernoulli=1:0:0.1",), "the range is empty"),
        (("--over=links.loss.bernoulli=0:1",), "in which steps"),
        (("--over=links.loss",), "write KEY=RANGE"),
        (("--over=agents.rounds=1,2", "--repeat", "0"), "at least once"),
        (("--over=agents.rounds=1,2", "--random", "0"), "at least one cell"),
        (("--over=agents.rounds=1,2", "--pace", "lockstep"), "--pace is for swarms over Zenoh"),
        (("--over=agents.rounds=1,2", "--scheduler", "tcp://localhost:1", "--workers", "2"), "leave out one"),
    ],
)
def test_bad_input_leaves_nothing(volery: Volery, words: tuple[str, ...], message: str) -> None:
    """Exit code 2, and no folder."""
    said = volery("sweep", "short.yaml", *words)
    assert (said.code, message in said.error) == (2, True)
    assert not Path("runs").exists()


def test_bad_input_about_results(volery: Volery) -> None:
    """A folder with other results, a measure or axis that there is not, and options of runs for a sweep."""
    volery(*SWEEP, "--name", "mine")
    told = {
        "another sweep (scenarios with other fields)": (*SWEEP, "--name", "mine", "--set", "agents.rounds=1"),
        "--measure estimate.oracle_errr.steady_rms: no such measure (did you mean": (
            *("compare", "mine", "--measure", "estimate.oracle_errr.steady_rms"),
        ),
        "--by rounds: no such axis": ("compare", "mine", "--by", "rounds"),
        "--across loss: no such axis": ("plot", "mine", "--across", "loss"),
        "choose a --measure": ("plot", "mine", "--quantity", "estimate"),
        "did you mean 'mine'": ("compare", "mina"),
        "is a sweep and no run": ("metrics", "mine"),
    }
    for message, words in told.items():
        said = volery(*words)
        assert (said.code, message in said.error) == (2, True), said.error
    Path("runs/mine/journal.jsonl").write_text('{"sweep": "0123"}\n', "utf-8")
    assert "it has the results of another" in volery("compare", "mine").error


def test_options_of_sweeps_are_refused_for_runs(own_run: Path, volery: Volery) -> None:
    """A run has no axes."""
    said = volery("plot", own_run.name, "--by", "links.loss")
    assert (said.code, "of the figures of a sweep" in said.error) == (2, True)


def test_ctrl_c_says_how_to_go_on(volery: Volery, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit code 130, and what is finished is there."""

    def pool(_options: SweepOptions) -> object:
        def carry_out(jobs: Iterable[Job]) -> Generator[Done, None, None]:
            first = next(iter(jobs))
            yield Done(first, run_job(first))
            raise KeyboardInterrupt

        return carry_out

    monkeypatch.setattr(SweepOptions, "pool", pool)
    said = volery(*SWEEP)
    assert said.code == 130
    assert "interrupted after 1 of 6 runs: the same command goes on" in said.error


def test_progress_has_the_time_left() -> None:
    """A line at each tenth where the output is no terminal and that is often enough, a bar where it is one."""
    seen = StringIO()
    with SweepProgress(Console(file=seen, width=100), "name") as progress:
        for finished in range(101):
            progress.show(Advance(finished, 1000 // 10, finished, finished * 2.0))
    lines = seen.getvalue().splitlines()
    assert len(lines) == 11
    assert lines[1] == "10 of 100 runs, 0.5 runs/s, 3 min 00 s left"
    assert lines[-1] == "100 of 100 runs"
    terminal = StringIO()
    with SweepProgress(Console(file=terminal, force_terminal=True, width=100), "name") as progress:
        progress.show(Advance(10, 100, 10, 2.0))
    assert "10 of 100 runs, 5 runs/s, 18 s left" in terminal.getvalue()
    assert [duration(seconds) for seconds in (59.4, 61, 7265)] == ["59 s", "1 min 01 s", "2 h 01 min"]


def test_no_minute_of_long_work_is_silent() -> None:
    """7,280 runs at 4 a second, where the output is no terminal: a line a minute, and at each tenth besides."""
    seen = StringIO()
    with SweepProgress(Console(file=seen, width=100), "name") as progress:
        for finished in range(7281):
            progress.show(Advance(finished, 7280, finished, finished / 4))
    lines = seen.getvalue().splitlines()
    # A tenth is 182 s: each but the last begins with the line of its tenth, and has three more, a minute apart.
    assert len(lines) == 10 * 4 + 1
    assert lines[0] == "0 of 7,280 runs"
    assert lines[1] == "240 of 7,280 runs, 4 runs/s, 29 min 20 s left"
    assert [line.split(" of ")[0] for line in lines[2:6]] == ["480", "720", "728", "968"]
