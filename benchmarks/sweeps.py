"""The sweep that is measured: twin runs of ten flying-array modules, over losses and estimators."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from volery.experiments.sweeps.sweep import SweepOptions, run_sweep
from volery.experiments.sweeps.sweep_plan import SweepPlan, plan_sweep

LOSSES = "links.loss.bernoulli=0:0.45:0.05"
ESTIMATORS = "agents.estimator=running-sum,metropolis-least-squares"
TEN_NODES = ("topology={hexagonal: 10}", "duration=0.5 s")
CELLS = 20


def planned() -> SweepPlan:
    """Twenty cells."""
    return plan_sweep("dfa16", TEN_NODES, (LOSSES, ESTIMATORS))


def whole_sweep(workers: int, repeat: int) -> dict[str, float]:
    """Seconds from the start of the workers to the table."""
    with tempfile.TemporaryDirectory() as folder:
        plan, began = planned(), time.perf_counter()
        done = run_sweep(plan, SweepOptions(repeat, runs=Path(folder), workers=workers))
        return {"seconds": time.perf_counter() - began, "runs": float(len(done.rows))}
