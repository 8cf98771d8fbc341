"""Figures of sweeps: what is drawn for which axes, and the Pareto front."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from volery.errors import BadInput
from volery.experiments.figures import run_figures as figures
from volery.experiments.sweeps import sweep_figures
from volery.experiments.sweeps.sweep_figures import BYTES, chart_of, pareto_front, plot_sweep
from volery.experiments.sweeps.sweep_plan import SweepPlan, SweptAxis, SweptCell
from volery.experiments.sweeps.sweep_results import Row, Sweep

ERROR = "x.oracle_error.steady_rms"
LOSS = SweptAxis("links.loss", ("0", "0.5"), (0.0, 0.5), "")
FILTER = SweptAxis("agents.filter", ("a", "b"), None, "")
ROUNDS = SweptAxis("agents.rounds", ("1", "3"), (1.0, 3.0), "")


def sweep(*axes: SweptAxis) -> Sweep:
    """Three runs of each cell; error 100 / (cell + 1) and as many bytes as the cell has rounds."""
    places: list[tuple[str, ...]] = [()]
    for axis in axes:
        places = [(*place, label) for place in places for label in axis.labels]
    cells = tuple(SweptCell(place, "", "channel") for place in places)
    rows = tuple(
        Row(cell, number, number, {ERROR: 100 / (cell + 1) + number, BYTES: float(cell % 2)})
        for cell in range(len(cells))
        for number in range(3)
    )
    return Sweep(Path("none"), SweepPlan("s", 0, "twin", axes, cells, {}), 3, rows)


def points(line: Line2D) -> list[tuple[float, float]]:
    """What a line goes through."""
    return [(float(x), float(y)) for x, y in np.asarray(line.get_xydata(), dtype=float).tolist()]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> dict[str, Figure]:
    """Figures by name, as they are when they are saved."""
    saved: dict[str, Figure] = {}

    def save(draw_into: Callable[[Figure], None], name: str, out: Path, formats: Sequence[str]) -> list[Path]:
        def keep(figure: Figure) -> None:
            draw_into(figure)
            saved[name] = figure

        return figures.save(keep, name, out, formats)

    monkeypatch.setattr(sweep_figures, "save", save)
    return saved


def test_curves_have_bands(drawn: dict[str, Figure], tmp_path: Path) -> None:
    """Numbers run across, filters have lines, what is left has panels; the bands are the intervals."""
    plot_sweep(chart_of(sweep(LOSS, FILTER, ROUNDS), ERROR), ["curves"], tmp_path, ["png"])
    panels = drawn["sweep-curves"].axes
    assert [panel.get_title("left") for panel in panels] == ["agents.rounds = 1", "agents.rounds = 3"]
    assert points(panels[0].lines[0]) == [(0.0, 101.0), (0.5, 21.0)]  # cells 0 and 4, plus the mean of 0, 1, 2
    half = 4.302653 / 3**0.5  # Student's t of two degrees, standard deviation 1
    band = panels[0].collections[0].get_paths()[0].get_extents()
    assert (band.y0, band.y1) == pytest.approx((21 - half, 101 + half), rel=1e-5)
    assert (tmp_path / "sweep-curves.png").stat().st_size > 0


def test_who_runs_across_can_be_said(drawn: dict[str, Figure], tmp_path: Path) -> None:
    """An axis without numbers has its labels across."""
    chart = chart_of(sweep(LOSS, FILTER), ERROR, across="agents.filter", by="links.loss")
    plot_sweep(chart, ["curves"], tmp_path, ["png"])
    (panel,) = drawn["sweep-curves"].axes
    assert [text.get_text() for text in panel.get_xticklabels()] == ["a", "b"]
    for across, by, message in (
        ("loss", None, "links.loss"),
        (None, "x", "no such axis"),
        ("links.loss",) * 2 + ("two",),
    ):
        with pytest.raises(BadInput, match=message):
            chart_of(sweep(LOSS, FILTER), ERROR, across, by)


def test_heat_maps_have_a_cell_for_each_cell(drawn: dict[str, Figure], tmp_path: Path) -> None:
    """One axis across, one upwards; a run that diverged everywhere leaves its cell empty."""
    done = sweep(LOSS, FILTER)
    rows = tuple(row._replace(values={ERROR: float("inf")}) if row.cell == 3 else row for row in done.rows)
    plot_sweep(chart_of(replace(done, rows=rows), ERROR), ["heat"], tmp_path, ["png"])
    image = drawn["sweep-heat"].axes[0].images[0].get_array()
    assert image is not None
    assert np.asarray(image).ravel().tolist()[:3] == pytest.approx([101, 100 / 3 + 1, 51])
    assert not np.isfinite(np.ma.filled(image, np.nan).ravel()[3])
    everywhere = tuple(row._replace(values={ERROR: float("inf")}) for row in done.rows)
    with pytest.raises(BadInput, match="finite nowhere"):
        plot_sweep(chart_of(replace(done, rows=everywhere), ERROR), ["heat"], tmp_path, ["png"])


def test_settings_have_panels_and_choices_a_front(drawn: dict[str, Figure], tmp_path: Path) -> None:
    """Loss is nobody's choice, so that each has a front of its own; rounds and filters are."""
    plot_sweep(chart_of(sweep(LOSS, FILTER, ROUNDS), ERROR), ["pareto"], tmp_path, ["png"])
    panels = drawn["sweep-pareto"].axes
    assert [panel.get_title("left") for panel in panels] == ["links.loss = 0", "links.loss = 0.5"]
    assert points(panels[0].lines[-1]) == [(0.0, 100 / 3 + 1), (1.0, 26.0)]


def test_the_front_is_what_nothing_beats() -> None:
    """Less error for more bytes, and nothing that costs more for no less."""
    assert pareto_front([(3, 1), (1, 5), (2, 5), (2, 2), (2, 3), (4, 1), (5, 0.5)]) == [
        (1, 5),
        (2, 2),
        (3, 1),
        (5, 0.5),
    ]
    assert pareto_front([]) == []


def test_what_cannot_be_drawn_is_refused(tmp_path: Path) -> None:
    """No such figure, and too few axes for one; by default only what there is something for."""
    single = sweep(LOSS)
    assert {path.stem for path in plot_sweep(chart_of(single, ERROR), [], tmp_path, ["png"])} == {
        "sweep-curves",
        "sweep-pareto",
    }
    with pytest.raises(BadInput, match="too few axes for heat"):
        plot_sweep(chart_of(single, ERROR), ["heat"], tmp_path, ["png"])
    with pytest.raises(BadInput, match="one of curves, heat, pareto"):
        plot_sweep(chart_of(single, ERROR), ["curve"], tmp_path, ["png"])
    with pytest.raises(BadInput, match="format"):
        plot_sweep(chart_of(single, ERROR), ["curves"], tmp_path, ["doc"])
