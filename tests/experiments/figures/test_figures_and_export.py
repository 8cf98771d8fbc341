"""Figures show what the record says, and exported tables read back exactly."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from volery.agents.journal import Batch, Estimate
from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.analysis import export
from volery.experiments.analysis.ages import age_courses, age_metrics
from volery.experiments.figures import run_figures as figures
from volery.experiments.record.frame_fates import frame_fates
from volery.experiments.record.record import Record
from volery.experiments.record.samples import samples
from volery.transport.faults import LinkFault
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings
from volery.transport.loss_settings import Bernoulli

MS = 1_000_000
Make = Callable[..., Any]


@pytest.fixture
def record(plan_of: Make, twin_run: Callable[[Plan], Record]) -> Record:
    """Three agents in a line for a second, with loss and a cut in the middle."""
    links = LinkSettings(latency=Constant(5 * MS), loss=(Bernoulli(0.3),))
    cut = LinkFault("t1", 400 * MS, 600 * MS, (("1", "2"), ("2", "1")), {"cut": True})
    return twin_run(plan_of([("1", "2"), ("2", "3")], 1000, settings=links, faults=(cut,)))


def test_every_figure_is_drawn_in_every_format(tmp_path: Path, record: Record) -> None:
    """Files of the asked names; fonts in PDF are embedded as TrueType, which journals ask for."""
    paths = figures.draw(record, figures.FIGURES, tmp_path / "new", ("png", "pdf"))
    assert [path.name for path in paths] == [
        f"{name}.{kind}"
        for name in ("estimates", "disagreement", "links", "age", "overview", "errors")
        for kind in ("png", "pdf")
    ]
    assert all(path.stat().st_size > 1000 for path in paths)
    pdf = (tmp_path / "new" / "disagreement.pdf").read_bytes()
    assert b"/Type3" not in pdf
    assert b"/FontFile2" in pdf


def test_estimates_show_agents_oracle_and_truth(record: Record) -> None:
    """One panel a component, in the component's unit: a line for each agent, one for the oracle, one for the truth."""
    figure = Figure()
    seen = samples(record, "estimate")
    figures.draw_estimates(record, seen, figure)
    altitude, roll = figure.axes
    assert (altitude.get_ylabel(), roll.get_ylabel(), roll.get_xlabel()) == ("altitude (mm)", "roll (deg)", "time (s)")
    lines = [np.asarray(line.get_ydata()) for line in altitude.lines]
    assert len(lines) == 5
    np.testing.assert_array_equal(np.stack(lines[:3], axis=1), 1e3 * seen.estimate[:, :, 0])
    assert set(lines[3]) == {2000.0}
    assert set(lines[4]) == {3000.0}
    assert [text.get_text() for text in altitude.texts] == ["cut 1–2"]


def test_names_of_faults_stand_apart_and_within_the_panel(plan_of: Make, twin_run: Callable[[Plan], Record]) -> None:
    """None of many cuts is named over another or past the end; those that find no room on four levels are left out."""
    cuts = [LinkFault(f"t{k}", k * 40 * MS, None, (("1", "2"), ("2", "1")), {"cut": True}) for k in range(24)]
    record = twin_run(plan_of([("1", "2"), ("2", "3")], 1000, faults=tuple(cuts)))
    figure = Figure(figsize=(2.0, 2.0))
    figures.draw_disagreement(record, samples(record, "estimate"), figure)
    FigureCanvasAgg(figure).draw()  # type: ignore[no-untyped-call]
    (axes,) = figure.axes
    boxes = [text.get_window_extent() for text in axes.texts]
    assert 12 <= len(boxes) < 24
    assert len({round(box.y0) for box in boxes}) == 4
    assert all(not one.overlaps(other) for one, other in combinations(boxes, 2))
    assert max(box.x1 for box in boxes) <= axes.bbox.x1


def test_of_many_components_the_first_are_drawn_and_their_number_is_said(record: Record) -> None:
    """Those of a formation of thirty would be a figure as long as a house."""
    seen = samples(record, "estimate")
    wide = replace(
        seen,
        components=10 * seen.components,
        estimate=np.tile(seen.estimate, 10),
        oracle=np.tile(seen.oracle, 10),
        truth=np.tile(seen.truth, 10),
    )
    figure = Figure()
    figures.draw_estimates(record, wide, figure)
    assert len(figure.axes) == 12
    assert figure.axes[-1].get_xlabel() == "time (s); 12 of 20 components"


def test_disagreement_shades_the_faults(record: Record) -> None:
    """A logarithmic axis, the span of the fault in seconds, no estimate drawn beyond the run."""
    figure = Figure()
    figures.draw_disagreement(record, samples(record, "estimate"), figure)
    (axes,) = figure.axes
    assert axes.get_yscale() == "log"
    (span,) = axes.patches
    assert span.get_extents().transformed(axes.transData.inverted()).intervalx.tolist() == pytest.approx([0.4, 0.6])
    assert axes.get_xlim() == (0.0, 1.0)


def test_links_show_what_came_through(record: Record) -> None:
    """A row for the sender and a column for the receiver, in per cent; where there is no link there is no value."""
    figure = Figure()
    figures.draw_links(record, figure)
    array = figure.axes[0].images[0].get_array()
    assert array is not None
    shown = np.ma.filled(array, np.nan)
    frames = frame_fates(record)["1", "2"]
    assert shown[0, 1] == pytest.approx(100 * np.mean([frame.fate == "delivered" for frame in frames]))
    assert np.isnan(shown).tolist() == [[True, False, True], [False, True, False], [True, False, True]]


def test_ages_peak_in_the_cut(record: Record) -> None:
    """All links, their median and the oldest, in ms: 1–2 is cut for 0.2 s and hears nothing new."""
    figure = Figure()
    ages = age_courses(record)
    figures.draw_ages(record, figure)
    (axes,) = figure.axes
    assert (axes.get_yscale(), axes.get_ylabel()) == ("log", "age of information (ms)")
    median, oldest = (np.asarray(line.get_ydata(), dtype=float) for line in axes.lines)
    peaks = {link: age_metrics(course) for link, course in ages.items()}
    worst = max(peaks, key=lambda link: peaks[link].mean_ns)
    assert np.nanmax(oldest) == pytest.approx(peaks[worst].peak_ns / 1e6)
    assert np.nanmax(oldest) > 200 > np.nanmedian(median)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["all links", "median", f"oldest: {'→'.join(worst)}"]


def test_a_run_without_frames_and_references_can_be_drawn(tmp_path: Path, record_of: Make) -> None:
    """No oracle, no truth, one agent, no frame: what there is is drawn, without a warning."""
    record = record_of(Batch("1", 0, [Estimate(k * MS, "x", k, [1.0, float("nan")]) for k in range(3)]))
    assert len(figures.draw(record, figures.FIGURES, tmp_path, ["png"])) == 6
    assert len(figures.draw(record, (), tmp_path, ["png"])) == 5


@pytest.mark.parametrize(
    ("which", "formats", "message"),
    [(["graph"], ("png",), "figure 'graph' is not known"), (["links"], ("bmp2",), "figure format 'bmp2' is not known")],
)
def test_unknown_figure_or_format(
    tmp_path: Path, record: Record, which: list[str], formats: tuple[str, ...], message: str
) -> None:
    """The message lists what there is, and nothing is left behind."""
    with pytest.raises(BadInput, match=message):
        figures.draw(record, which, tmp_path / "out", formats)
    assert not (tmp_path / "out").exists()


def test_nothing_to_draw(tmp_path: Path, record_of: Make) -> None:
    """Without any estimate only the links can be drawn."""
    with pytest.raises(BadInput, match="no agent reported"):
        figures.draw(record_of(), ["estimates"], tmp_path)


def test_csv_and_parquet_hold_the_same_rows(tmp_path: Path, record: Record) -> None:
    """Every float reads back with its bits, in both formats; frames come with their whole story."""
    expected = list(export.estimate_rows(record))
    for kind in ("csv", "parquet"):
        assert [path.name for path in export.write(record, kind, tmp_path)] == [f"estimates.{kind}", f"frames.{kind}"]
    with (tmp_path / "estimates.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == list(export.ESTIMATE_COLUMNS)
    first = (tmp_path / "estimates.csv").read_text("utf-8").splitlines()[1].split(",")
    assert (first[0], first[2]) == ('"1"', '"estimate"')  # a text, though it looks like a number
    assert [float(row["value"]).hex() for row in rows] == [row[6].hex() for row in expected]
    with duckdb.connect() as database:
        assert database.read_parquet(str(tmp_path / "estimates.parquet")).fetchall() == expected
        found = database.read_parquet(str(tmp_path / "frames.parquet"))
        assert found.columns == list(export.FRAME_COLUMNS)
        assert found.fetchall() == list(export.frame_rows(record))


def test_numbers_that_are_not_finite_are_exported(tmp_path: Path, record_of: Make) -> None:
    """NaN and infinities of an estimate stay what they are in each format; an oracle that does not exist is NaN."""
    values = [float("nan"), float("inf"), float("-inf"), 5e-324]
    record = record_of(Batch("1", 0, [Estimate(0, "x", 0, values)]))
    for kind in export.FORMATS:
        export.write(record, kind, tmp_path)
    with duckdb.connect() as database:
        parquet = database.read_parquet(str(tmp_path / "estimates.parquet")).project("value, oracle").fetchall()
    np.testing.assert_array_equal([value for value, _ in parquet], values)
    assert all(np.isnan(oracle) for _, oracle in parquet)
    with np.load(tmp_path / "run.npz") as arrays:
        np.testing.assert_array_equal(arrays["x.value"], [values])


def test_npz_holds_flat_arrays(tmp_path: Path, record: Record) -> None:
    """A row for each report and each frame, loadable without pickle; −1 and empty text for what is not known."""
    (path,) = export.write(record, "npz", tmp_path)
    reports = sum(len(batch.estimates) for batch in record.batches.values())
    with np.load(path) as arrays:
        assert arrays["estimate.value"].shape == arrays["estimate.truth"].shape == (reports, 2)
        assert set(arrays["estimate.agent"]) == {"1", "2", "3"}
        frames = [frame for link in frame_fates(record).values() for frame in link]
        assert arrays["frames.fate"].tolist() == [frame.fate for frame in frames]
        assert set(arrays["frames.dropped_ns"]) == {-1}


def test_unknown_export_format(tmp_path: Path, record: Record) -> None:
    """The message lists the formats."""
    with pytest.raises(BadInput, match="'xlsx' is not known: one of csv, parquet, npz"):
        export.write(record, "xlsx", tmp_path)  # type: ignore[arg-type]
