"""A sweep over Zenoh says what the sweep in the twin says."""

from __future__ import annotations

from pathlib import Path

from volery.experiments.sweeps.sweep import SweepOptions, sweep

OVER = {"links.loss.bernoulli": [0.3]}
SHORT = ("duration=0.5 s",)


def test_a_cell_over_zenoh_equals_its_twin(tmp_path: Path) -> None:
    """Real processes in lockstep pace, started by a worker of the pool: every number of the run is the twin's."""
    rows = [
        sweep("dfa4", OVER, SHORT, options=SweepOptions(1, engine, tmp_path, engine, workers=1)).rows
        for engine in ("zenoh", "twin")
    ]
    assert rows[0] == rows[1]
    assert 0.5 < (rows[0][0].values["links.delivered_fraction"] or 0) < 0.9
    assert not list((tmp_path / "zenoh").glob("runs/*"))
