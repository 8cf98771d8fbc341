"""Traces in scenarios: read from CSV when the scenario is read, plain numbers from then on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from volery.errors import BadInput
from volery.experiments.scenario.compile import compile_plan
from volery.experiments.scenario.explaining import read
from volery.experiments.scenario.link_schema import LinkChanges
from volery.experiments.scenario.load import load_scenario, resolved_yaml
from volery.experiments.scenario.trace_files import read_trace
from volery.transport.latency_settings import LatencyTrace
from volery.transport.loss_settings import Distance, LossTrace

from .conftest import Load, Refusal

LOSS = "loss: {gilbert-elliott: {to_bad: 0.05, to_good: 0.3, loss_bad: 0.9}}"
LATENCY = "latency: {normal: {mean: 2 ms, sd: 0.5 ms}}"
SECOND, MS = 10**9, 10**6


def test_a_trace_is_read_with_its_scenario(load: Load, tmp_path: Path) -> None:
    """Paths are relative to the scenario; the resolved one has the numbers, and reads back equal without the files."""
    folder = tmp_path / "recorded"
    folder.mkdir()
    (folder / "loss.csv").write_text("time_s,loss\n0,0.1\n0.5,1\n\n1.25,0\n", "utf-8")
    (folder / "delay.csv").write_text("\ufefftime_min, note, latency_\u03bcs\n0,start,1500\n.5,,2e3\n", "utf-8")
    scenario = load(
        replacing=(
            f"{LATENCY}\n  {LOSS}",
            """latency: {trace: recorded/delay.csv}
  loss: [0.1, {trace: {file: recorded/loss.csv, repeat: 3 s}}]
  only:
    - {where: 1-2, corruption: {trace: recorded/loss.csv}}""",
        )
    )
    losses = LossTrace((0, SECOND // 2, 5 * SECOND // 4), (0.1, 1.0, 0.0))
    assert scenario.links.base.loss[1] == LossTrace(losses.times, losses.losses, 3 * SECOND)
    assert scenario.links.base.latency == LatencyTrace((0, 30 * SECOND), (1_500_000, 2_000_000))
    assert scenario.links.only[0].changes == {"corruption": (losses,)}
    for path in folder.iterdir():
        path.unlink()
    (tmp_path / "resolved.yaml").write_text(resolved_yaml(scenario), "utf-8")
    assert load_scenario(tmp_path / "resolved.yaml").scenario == scenario


def test_traces_of_faults_and_of_the_command_line(load: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the timeline a path is relative to the scenario, in an override to where the command is given."""
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    (here / "own.csv").write_text("time_ms,loss\n0,0.25\n", "utf-8")
    (tmp_path / "own.csv").write_text("time_ms,loss\n0,0.75\n", "utf-8")
    fault = ("set: {loss: {bernoulli: 0.5}}", "set: {loss: {trace: own.csv}}")
    assert load(replacing=fault).faults[1].set_ == {"loss": (LossTrace((0,), (0.75,)),)}
    for override in ("links.loss.trace=own.csv", "links.loss={trace: {file: own.csv}}"):
        assert load(override).links.base.loss == (LossTrace((0,), (0.25,)),)
    assert load("links.loss.trace.repeat=1 s", replacing=(LOSS, "loss: {trace: {file: own.csv}}")).links.base.loss == (
        LossTrace((0,), (0.75,), SECOND),
    )


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        ("time_s,loss\n0,0\n2,0.5\n1.5,1\n", "loss", ":4: time 1.5 s is not after the one before, 2 s: put the lines"),
        ("time_s,loss\n0,0\n0,0.5\n", "loss", ":3: time 0 s is not after the one before, 0 s"),
        ("time_s,loss\n\n1,0\n", "loss", ":3: the first time is 1 s: start with 0"),
        ("time_s,loss\n-1,0\n", "loss", ":2: -1 s is below 0"),
        ("time_s,loss\n0,0\n1,1.5\n", "loss", ":3: loss is 1.5, a probability lies between 0 and 1"),
        ("time_s,loss\n0,nan\n", "loss", ":2: loss is nan"),
        ("time_s,loss\n0,a lot\n", "loss", ":2: 'a lot' is no number"),
        ("time_s,loss\nnoon,0\n", "loss", ":2: 'noon' is no number"),
        ("time_s,loss\n0\n", "loss", ":2: 1 cells, the heading has 2"),
        ("time_s,loss\n", "loss", ": no line after the heading"),
        ("", "loss", ":1: one column should be time_s, time_ms or another unit of time; the heading is empty"),
        ("0,0\n1,0.5\n", "loss", ":1: one column should be time_s"),
        ("time_s,latency_ms\n0,1\n", "loss", ":1: one column should be loss; the heading is time_s, latency_ms"),
        ("time_s,latency\n0,1\n", "latency", ":1: one column should be latency_s, latency_ms or another unit"),
        ("time_s,latency_ms,latency_us\n0,1,1\n", "latency", ":1: one column should be latency_s"),
        ("time_s,latency_ms\n0,-1\n", "latency", ":2: -1 ms is below 0"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path: Path, text: str, name: str, message: str) -> None:
    """The message has the file and the line."""
    path = tmp_path / "trace.csv"
    path.write_text(text, "utf-8")
    with pytest.raises(BadInput) as refused:
        read_trace(str(path), name)
    assert str(refused.value).startswith(f"{path}{message}")


def test_what_is_no_csv_is_refused(tmp_path: Path) -> None:
    """No file, and one that is not text."""
    with pytest.raises(BadInput, match=r"nowhere\.csv: cannot be read as CSV: No such file"):
        read_trace(str(tmp_path / "nowhere.csv"), "loss")
    (tmp_path / "bytes.csv").write_bytes(b"time_s,loss\n0,\xff\n")
    with pytest.raises(BadInput, match=r"bytes\.csv: cannot be read as CSV: 'utf-8'"):
        read_trace(str(tmp_path / "bytes.csv"), "loss")


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ({}, "write a file, or times and losses: one of the two, not neither"),
        ({"file": "a.csv", "losses": [0.1]}, "one of the two, not both"),
        ({"times": ["0 s"]}, "times and losses belong together"),
        ({"losses": [0.5]}, "times and losses belong together"),
        ({"fil": "a.csv"}, "trace.fil: unknown field (did you mean 'file'?)"),
        ({"times": ["0 s", "1"], "losses": [0, 0]}, "'1' is not a quantity"),
        ({"times": ["0 s"], "losses": [2.0]}, "loss probability is 2"),
    ],
)
def test_a_trace_is_a_file_or_numbers(written: dict[str, Any], message: str) -> None:
    """Exactly one of them, and nothing half."""
    with pytest.raises(BadInput) as refused:
        read(LinkChanges, {"loss": {"trace": written}})
    assert message in str(refused.value)


def test_errors_in_a_file_stand_at_the_field(refusal: Refusal, tmp_path: Path) -> None:
    """Scenario, line and column, then the file of the trace with its own line."""
    (tmp_path / "back.csv").write_text("time_s,loss\n0,0\n2,1\n1,0\n", "utf-8")
    said = refusal(replacing=(LOSS, "loss: {trace: back.csv}"))
    assert said.startswith("example.yaml:14:17: links.loss.trace: back.csv:4: time 1 s is not after")


def test_loss_by_distance_needs_places(load: Load, refusal: Refusal) -> None:
    """Agents without positions have no distance: refused for all links, for some, for corruption, and in a fault."""
    model = "{distance: {exponent: 2.7, sensitivity: -60 dBm}}"
    wanted = "have no positions, so there is no distance between them: use a topology that has positions"
    for old, new, place in [
        (LOSS, f"loss: {model}", "links.loss"),
        (LOSS, f"corruption: {model}", "links.corruption"),
        ("{bernoulli: 0.5}", model, "faults.1.set.loss"),
    ]:
        assert load(replacing=(old, new))
        said = refusal("topology={complete: 3}", "faults.0.cut=1-2", replacing=(old, new))
        assert place in said
        assert wanted in said
    plan = compile_plan(load(replacing=(LOSS, f"loss: {model}")))
    assert plan.links["1", "2"].loss == (Distance(2.7, -60.0),)
    assert plan.distance_m("1", "2", 0) == 1.0
