"""A run's folder, as an engine leaves it, gives metrics, figures and tables again."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from volery.errors import BadInput
from volery.experiments.analysis.export import write
from volery.experiments.analysis.metrics import write_metrics
from volery.experiments.figures.run_figures import draw
from volery.experiments.figures.space_time import plot_space_time
from volery.experiments.record.evaluation_pass import evaluate_run, evaluated
from volery.experiments.record.plan_file import write_plan
from volery.experiments.record.record import Collector, load
from volery.experiments.record.recorder import Recorder
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import Twin


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two seconds of the four-module array in the twin, with the folder that a run makes."""
    loaded = load_scenario("dfa4", ["duration=2 s"])
    write_plan(tmp_path, loaded.plan)
    (tmp_path / "run.json").write_text('{"engine": "twin"}', "utf-8")
    with Recorder(tmp_path) as recorder:
        Twin(loaded.plan, recorder).run()
    evaluate_run(load(tmp_path, evaluated=False), tmp_path)
    return tmp_path


def test_run_reads_back_as_it_was(folder: Path) -> None:
    """The plan, every entry from the record, and what the engine says of itself."""
    plan = load_scenario("dfa4", ["duration=2 s"]).plan
    collector = Collector()
    Twin(plan, collector).run()
    record = load(folder)
    assert record.batches == collector.batches
    assert list(record.events) == collector.events
    assert record.info == {"engine": "twin"}
    assert (record.end_ns, record.recovered) == (2_000_000_000, False)


def test_metrics_figures_and_tables_of_a_folder(folder: Path) -> None:
    """Metrics agree with metrics.json; figures and tables land in folders of their own."""
    record = load(folder)
    metrics = write_metrics(record, folder)
    data = json.loads((folder / "metrics.json").read_text("utf-8"))
    rms = metrics.quantities["estimate"].oracle_error.steady_rms
    assert not math.isnan(rms)
    assert data["quantities"]["estimate"]["oracle_error"]["steady_rms"] == rms
    assert all(link["closes"] for link in data["links"].values())
    assert draw(record, ["links"], folder, ["png"]) == [folder / "links.png"]
    assert write(record, "csv", folder) == [folder / "estimates.csv", folder / "frames.csv"]


def test_run_without_estimates_has_a_figure_of_its_links(folder: Path) -> None:
    """Asked for no figure by name, what there is to show is drawn."""
    (folder / "record.mcap").unlink()
    with Recorder(folder) as recorder:
        recorder.event({"event": "finished", "time_ns": 0})
    record = evaluated(load(folder, evaluated=False))
    assert draw(record, (), folder, ["png"]) == [folder / name for name in ("links.png", "age.png")]
    assert plot_space_time(record, folder, formats=["png"]) == [folder / "space-time.png"]


def test_damaged_run_information_is_named(folder: Path) -> None:
    """The message names the file and the remedy; without the file the run reads all the same."""
    (folder / "run.json").write_text("{", "utf-8")
    with pytest.raises(BadInput, match=r"run\.json is damaged .*delete it"):
        load(folder)
    (folder / "run.json").unlink()
    assert load(folder).info == {}
