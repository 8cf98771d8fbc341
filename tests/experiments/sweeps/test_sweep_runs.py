"""Sweeps go on where they were, whatever ended them, and their table does not tell."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import duckdb
import numpy as np
import pytest

import volery
from volery.errors import BadInput, RunFailed
from volery.experiments.analysis.statistics import mean_interval
from volery.experiments.sweeps.pools import dask_pool
from volery.experiments.sweeps.sweep import Advance, SweepOptions, run_sweep
from volery.experiments.sweeps.sweep_plan import SweepPlan, plan_sweep
from volery.experiments.sweeps.sweep_results import Journal, Row, Sweep, load_sweep

from .sweeping import OVER, SHORT, Counting, planned, swept

ERROR = "estimate.oracle_error.steady_rms"
DEADLINE_S = 60.0
_MARK = "VOLERY_TEST_OF"


@pytest.fixture(scope="module")
def plan() -> SweepPlan:
    """Two losses by two estimators."""
    return planned()


@pytest.fixture(scope="module")
def undisturbed(plan: SweepPlan, tmp_path_factory: pytest.TempPathFactory) -> Sweep:
    """The sweep as it is without interruption; not to be changed."""
    return swept(tmp_path_factory.mktemp("sweep") / "undisturbed", plan)


def table(sweep: Sweep) -> bytes:
    """The bytes of the table."""
    return (sweep.folder / "table.parquet").read_bytes()


def test_a_row_for_each_run(undisturbed: Sweep) -> None:
    """In the order of cell and repetition, with the axes, the seed and the measures; nothing of the clock."""
    rows = duckdb.read_parquet(str(undisturbed.folder / "table.parquet"))
    assert rows.columns[:6] == ["cell", "links.loss.bernoulli", "agents.estimator", "repeat", "seed", "pairing"]
    kept = rows.fetchall()
    assert [(row[0], row[3], row[4]) for row in kept] == [(cell, r, 4 + r) for cell in range(4) for r in range(2)]
    assert [row[1:3] for row in kept[::2]] == [
        (loss, name) for loss in (0.0, 0.5) for name in ("running-sum", "metropolis-least-squares")
    ]
    assert not [name for name in rows.columns if "wall" in name or "cpu" in name]
    assert kept[0][rows.columns.index("links.delivered_fraction")] == 1.0
    assert 0.3 < kept[-1][rows.columns.index("links.delivered_fraction")] < 0.7


def test_a_row_is_what_the_run_says(undisturbed: Sweep, tmp_path: Path) -> None:
    """The same scenario, run by itself with the seed of the row, has the numbers of the row."""
    changes = ["duration=0.4 s", "links.loss.bernoulli=0.5", "agents.estimator=running-sum", "seed=5"]
    run = volery.run("dfa4", engine="twin", overrides=changes, runs=tmp_path)
    (row,) = [row for row in undisturbed.rows if (row.cell, row.repeat) == (2, 1)]
    metrics = run.metrics
    quantity = metrics.quantities["estimate"]
    assert row.seed == 5
    assert row.values[ERROR] == quantity.oracle_error.steady_rms
    assert row.values["estimate.truth_error.ise"] == quantity.truth_error.ise
    assert row.values["estimate.disagreement.final"] == quantity.disagreement.final
    assert row.values["estimate.contraction"] is None
    assert row.values["estimate.roll_deg.truth_error"] == quantity.components[1].truth_rms
    sent = sum(link.account.sent_bytes for link in metrics.links.values())
    assert row.values["links.bytes_per_agent_s"] == pytest.approx(sent / 4 / 0.4)
    delivered = (run.frames["fate"] == "delivered").sum()
    assert (
        row.values["links.delivered_fraction"] == delivered / np.isin(run.frames["fate"], ["delivered", "loss"]).sum()
    )


@pytest.mark.parametrize("after", [0, 3, 7])
def test_an_interrupted_sweep_goes_on(plan: SweepPlan, undisturbed: Sweep, tmp_path: Path, after: int) -> None:
    """Nothing is run twice, whatever order runs come in, and the table is the same, byte for byte."""
    folder = tmp_path / "interrupted"
    first, second = Counting(interrupted_after=after), Counting()
    with pytest.raises(KeyboardInterrupt):
        swept(folder, plan, first)
    assert load_sweep(folder).missing == 8 - after
    assert not (folder / "table.parquet").exists()
    assert table(swept(folder, plan, second)) == table(undisturbed)
    assert (first.carried_out, second.carried_out) == (after, 8 - after)


@pytest.mark.parametrize("cut", [1, 40, "all but the head"])
def test_a_line_that_was_cut_off_is_run_again(
    plan: SweepPlan, undisturbed: Sweep, tmp_path: Path, cut: int | str
) -> None:
    """What a kill left half written is no result; every whole line before it is."""
    folder = tmp_path / "cut"
    shutil.copytree(undisturbed.folder, folder)
    journal = folder / "journal.jsonl"
    text = journal.read_bytes()
    journal.write_bytes(text[:-cut] if isinstance(cut, int) else text[: text.index(b"\n") + 5])
    lost = 1 if isinstance(cut, int) else 8
    assert load_sweep(folder).missing == lost
    pool = Counting()
    assert table(swept(folder, plan, pool)) == table(undisturbed)
    assert pool.carried_out == lost


def test_more_repetitions_are_added(plan: SweepPlan, undisturbed: Sweep, tmp_path: Path) -> None:
    """A finished sweep gets further seeds, and asked for fewer it shows those."""
    folder = tmp_path / "more"
    shutil.copytree(undisturbed.folder, folder)
    pool = Counting()
    assert len(swept(folder, plan, pool, repeat=3).rows) == 12
    assert pool.carried_out == 4
    assert table(swept(folder, plan, Counting(interrupted_after=0))) == table(undisturbed)


def test_results_of_another_sweep_are_refused(undisturbed: Sweep, tmp_path: Path) -> None:
    """Another scenario, other axes, other fields, another engine or other code: each is named; --fresh drops them."""
    folder = tmp_path / "other"
    shutil.copytree(undisturbed.folder, folder)
    others = {
        "scenario dfa4, not dfa8-random": plan_sweep("dfa8-random", SHORT, ["links.loss.bernoulli=0"]),
        "other axes": planned("links.loss.bernoulli=0,0.5"),
        "scenarios with other fields": planned(overrides=["world.altitude=0.3 m"]),
        "another seed": planned(overrides=["seed=5"]),
        "engine twin": planned(engine="zenoh"),
    }
    for reason, other in others.items():
        with pytest.raises(BadInput, match=r"--fresh") as refused:
            swept(folder, other)
        assert reason in str(refused.value)
    told = json.loads((folder / "sweep.json").read_text("utf-8"))
    told["made_with"]["code"] = "older"
    (folder / "sweep.json").write_text(json.dumps(told), "utf-8")
    with pytest.raises(BadInput, match="other code"):
        swept(folder, undisturbed.plan)
    with pytest.raises(BadInput, match="is not of the sweep"):
        load_sweep(folder)
    assert len(swept(folder, planned("links.loss.bernoulli=0"), repeat=1, fresh=True).rows) == 1


def test_a_filter_of_ones_own_is_part_of_what_results_rest_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its file's bytes, wherever a scenario names it; a module that nobody loaded, such as a typing error, is none."""
    source = "from volery.estimators.distributed.filtering import LocalFilter\n\n\nclass Mine(LocalFilter):\n    pass\n"
    (tmp_path / "one_of_my_filters.py").write_text(source, "utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    scenario = {
        "name": "own",
        "seed": 1,
        "duration": "1 s",
        "topology": {"ring": 4},
        "agents": {"kind": "tracker", "filter": "local"},
        "world": {"kind": "target"},
    }
    over = ["agents.filter=local,one_of_my_filters:Mine"]
    before = plan_sweep(scenario, over=over).made_with
    assert list(before["modules"]) == ["one_of_my_filters"]
    (tmp_path / "one_of_my_filters.py").write_text(source + "    # better\n", "utf-8")
    after = plan_sweep(scenario, over=over).made_with
    assert after["modules"] != before["modules"]
    assert {**after, "modules": None} == {**before, "modules": None}
    assert plan_sweep(scenario).made_with["modules"] == {}


def test_fresh_drops_nothing_but_sweeps(plan: SweepPlan, tmp_path: Path) -> None:
    """A folder that is no sweep stays as it is."""
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").write_text("…", "utf-8")
    with pytest.raises(BadInput, match="holds no sweep"):
        swept(tmp_path / "thesis", plan, fresh=True)
    assert (tmp_path / "thesis" / "chapter.tex").exists()


def test_one_process_at_a_time(plan: SweepPlan, tmp_path: Path) -> None:
    """Two that write into one folder would mix; the second is refused while the first is at work."""
    with Journal(tmp_path / "busy", plan, 1), pytest.raises(BadInput, match="another process"):
        Journal(tmp_path / "busy", plan, 1)
    with Journal(tmp_path / "busy", plan, 1) as journal:
        journal.add(Row(0, 0, 4, {"x": float("inf"), "y": None}))
    assert load_sweep(tmp_path / "busy").rows == (Row(0, 0, 4, {"x": float("inf"), "y": None}),)


def test_the_same_command_means_the_same_folder(plan: SweepPlan) -> None:
    """Without a name what is swept gives one; what else is set does not."""
    assert SweepOptions(1).folder(plan) == SweepOptions(9, keep=True).folder(planned())
    assert SweepOptions(1).folder(plan) != SweepOptions(1).folder(planned(OVER[0]))


def test_progress_tells_the_time_left(plan: SweepPlan, tmp_path: Path) -> None:
    """Runs that were there before count as finished and not for the speed."""
    folder = tmp_path / "watched"
    with pytest.raises(KeyboardInterrupt):
        swept(folder, plan, Counting(interrupted_after=5))
    seen: list[Advance] = []
    options = SweepOptions(2, runs=tmp_path, name="watched")
    run_sweep(plan, options, Counting(), seen.append)
    assert [(one.finished, one.fresh, one.total) for one in seen] == [(5 + n, n, 8) for n in range(4)]
    assert seen[0].left_s is None
    assert Advance(10, 100, 5, 2.0).left_s == 36.0


def test_kept_runs_are_runs(tmp_path: Path) -> None:
    """With `keep` each run has its folder; without, a sweep leaves three files."""
    kept = swept(tmp_path / "kept", planned("links.loss.bernoulli=0.5"), keep=True)
    plain = swept(tmp_path / "plain", planned("links.loss.bernoulli=0.5"))
    assert table(kept) == table(plain)
    assert {path.name for path in plain.folder.iterdir()} == {"sweep.json", "journal.jsonl", "table.parquet"}
    run = volery.load(kept.folder / "runs" / "0-1")
    assert run.metrics.quantities["estimate"].oracle_error.steady_rms == kept.rows[1].values[ERROR]


@pytest.mark.parametrize(
    ("over", "message"),
    [
        ("links.lss=0,1", r"^--over links.lss: unknown field \(did you mean 'loss'\?\)"),
        ("links.loss.bernouli=0,1", r"^--over links.loss.bernouli: .*did you mean 'bernoulli'"),
        ("agents.round=1,2", r"^--over agents.round: unknown field \(did you mean 'rounds'\?\)"),
        ("links.loss.bernoulli=0,1.5", r"^--over links.loss.bernoulli: .*1.5"),
        ("agents.rounds=1,60", "^with agents.rounds=60: .*do not fit"),
        ("links.loss.bernoulli=1:0:0.1", "the range is empty"),
    ],
)
def test_a_cell_that_cannot_be_is_refused_before_anything_runs(over: str, message: str) -> None:
    """A key that does not exist, an empty range, a value out of bounds, parts that do not fit together."""
    with pytest.raises(BadInput, match=message):
        planned(over)


def test_options_out_of_bounds() -> None:
    """No repetition, no worker, two kinds of workers, a key twice."""
    with pytest.raises(BadInput, match="at least once"):
        SweepOptions(0)
    with pytest.raises(BadInput, match="at least one process"):
        SweepOptions(1, workers=0).pool()
    with pytest.raises(BadInput, match="leave out one"):
        SweepOptions(1, workers=1, scheduler="tcp://localhost:1")
    with pytest.raises(BadInput, match="--keep is for runs on this machine"):
        SweepOptions(1, scheduler="tcp://localhost:1", keep=True)
    with pytest.raises(BadInput, match="occurs twice"):
        planned("agents.rounds=1", "agents.rounds=2")


def test_pairing_is_told() -> None:
    """Slots on every link pair channels; what half-duplex media do stays apart; a fault may undo it."""
    over = "links.loss.bernoulli=0.5"

    def pairing(*changes: str) -> str:
        (cell,) = planned(over, overrides=changes).cells
        return cell.pairing

    assert pairing() == "frame by frame"
    assert pairing("links.paired=10 ms") == "channel, half-duplex apart"
    assert pairing("links.paired=10 ms", "links.medium=full-duplex") == "channel"
    undone = "faults=[{at: 0.1 s, for: 0.1 s, where: all, set: {paired: null}}]"
    assert pairing("links.paired=10 ms", "links.medium=full-duplex", undone) == "frame by frame"


def test_paired_channels_meet_senders_of_more_rounds(tmp_path: Path) -> None:
    """On common seeds the losses of one and of three rounds are more alike over paired channels than frame by frame.

    Losses last 50 ms, as long as the three rounds of a sample. Over 12 seeds the fractions delivered are correlated by
    nearly 1 with pairing; without, by chance, |r| < 0.7 with a probability of 99 %.
    """
    over = ("agents.rounds=1,3",)
    changes = ("links.loss={bernoulli: 0.5}", "links.medium=full-duplex", "duration=0.6 s")

    def correlation(*more: str) -> float:
        done = swept(tmp_path / f"{len(more)}", planned(*over, overrides=(*changes, *more)), repeat=12)
        few, many = (list(values.values()) for values in done.values("links.delivered_fraction").values())
        return float(np.corrcoef(few, many)[0, 1])

    assert correlation("links.paired=50 ms") > 0.9
    assert correlation() < 0.7


def test_an_agent_of_ones_own(tmp_path: Path) -> None:
    """What it finds has columns, estimates that are no numbers make errors infinite, its code is part of the sweep."""
    (tmp_path / "diverging.py").write_text(
        "from volery.agents import agent\n"
        "from volery.experiments.evaluation.evaluation import Evaluation, Finding\n\n\n"
        "class Judge(Evaluation):\n"
        "    def findings(self, run):\n"
        "        return [Finding('NEES, mean', 3.0, 'm/s'), Finding('only words', text='…')]\n\n"
        "    def central_estimate(self, agent, quantity, index, time_ns):\n"
        "        return 1.0\n\n\n"
        "class Diverging(agent.Agent):\n"
        "    timers_only = True\n"
        "    evaluation = Judge\n\n"
        "    def start(self):\n"
        "        self.context.set_timer(0)\n\n"
        "    def on_timer(self, timer):\n"
        "        self.context.report('x', float('nan') if timer.index == 3 else 1.0, timer.index)\n"
        "        self.context.set_timer(timer.time_ns + 10_000_000, index=timer.index + 1)\n",
        "utf-8",
    )
    scenario = tmp_path / "own.yaml"
    scenario.write_text(
        "duration: 0.1 s\ntopology: {line: 2}\nagents: {kind: 'diverging:Diverging'}\nlinks: {latency: 1 ms}\n", "utf-8"
    )
    done = swept(tmp_path / "own", plan_sweep(scenario), repeat=1)
    assert done.rows[0].values["x.oracle_error.steady_rms"] == float("inf")
    assert mean_interval(list(done.values("x.disagreement.final")[0].values())).mean == float("inf")
    assert {name: value for name, value in done.rows[0].values.items() if "finding" in name} == {
        "findings.NEES, mean": 3.0,
        "findings.only words": None,
    }
    before = plan_sweep(scenario).digest
    with (tmp_path / "diverging.py").open("a", encoding="utf-8") as file:
        file.write("# another version\n")
    assert plan_sweep(scenario).digest != before


def test_a_run_that_fails_ends_the_sweep_and_keeps_the_others(plan: SweepPlan, tmp_path: Path) -> None:
    """The error names cell and seed."""
    last = plan.loaded[3]
    agents = tuple(replace(agent, kind="nobody") for agent in last.plan.agents)
    broken = replace(last, plan=replace(last.plan, agents=agents))
    with pytest.raises(RunFailed, match=r"cell 3, seed 4: BadInput: .*nobody"):
        swept(tmp_path / "broken", replace(plan, loaded=(*plan.loaded[:3], broken)))
    assert len(load_sweep(tmp_path / "broken").rows) == 3


def test_killed_and_interrupted_processes_leave_everything_whole(
    plan: SweepPlan, undisturbed: Sweep, tmp_path: Path
) -> None:
    """A kill -9 and Ctrl-C in the middle: no worker is left, what was finished is kept, and the table is the same."""
    words = ["sweep", "dfa4", "--set", SHORT[0], *(word for over in OVER for word in ("--over", over))]
    words += ["--repeat", "2", "--runs", str(tmp_path), "--name", "killed", "--workers", "1"]
    journal = tmp_path / "killed" / "journal.jsonl"
    for number, lines in ((signal.SIGKILL, 3), (signal.SIGINT, 6)):
        command = [sys.executable, "-m", "volery", *words]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, env={**os.environ, _MARK: str(tmp_path)})
        _wait_for_lines(journal, lines, process)
        process.send_signal(number)
        assert process.wait(DEADLINE_S) == (130 if number == signal.SIGINT else -number)
        _wait_until_none_is_left(tmp_path)
    assert 5 <= len(load_sweep(journal.parent).rows) < 8
    pool = Counting()
    assert table(swept(journal.parent, plan, pool)) == table(undisturbed)
    assert pool.carried_out <= 3


def _wait_until_none_is_left(mark: Path) -> None:
    until = time.monotonic() + DEADLINE_S
    while left := [place for place in Path("/proc").glob("[0-9]*") if _is_marked(place, mark)]:
        assert time.monotonic() < until, f"left over: {left}"
        time.sleep(0.01)


def _is_marked(place: Path, mark: Path) -> bool:
    try:
        return f"{_MARK}={mark}".encode() in (place / "environ").read_bytes().split(b"\0")
    except OSError:
        return False


def _wait_for_lines(path: Path, lines: int, process: subprocess.Popen[bytes]) -> None:
    until = time.monotonic() + DEADLINE_S
    while time.monotonic() < until and process.poll() is None:
        if path.exists() and path.read_bytes().count(b"\n") >= lines:
            return
        time.sleep(0.01)
    pytest.fail("the sweep has not come so far")


def test_a_dask_cluster_gives_the_same_table(plan: SweepPlan, undisturbed: Sweep, tmp_path: Path) -> None:
    """The same sweep on the workers of a cluster."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
    ) as cluster:
        done = swept(tmp_path / "dask", plan, dask_pool(cluster.scheduler_address))
    assert table(done) == table(undisturbed)


def test_a_scheduler_that_does_not_answer() -> None:
    """An address where nobody listens is an error after the time that it is given."""
    pytest.importorskip("distributed")
    with pytest.raises(BadInput, match=r"--scheduler .* does not answer"):
        dask_pool("tcp://127.0.0.1:9", answer_s=0.5)


@pytest.mark.parametrize("address", ["somewhere", "nonsense://127.0.0.1:9", "tcp://127.0.0.1:port", ""])
def test_what_is_no_address(address: str) -> None:
    """It is refused at once, and nothing is left behind that complains later."""
    pytest.importorskip("distributed")
    with pytest.raises(BadInput, match=r"--scheduler .*: write an address such as tcp://"):
        dask_pool(address)
