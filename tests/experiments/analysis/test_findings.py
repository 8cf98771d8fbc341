"""Findings of a kind of agents, what was noted, and quantities that are reported aside."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence

from rich.console import Console

from volery.agents.agent import Agent, Timer
from volery.agents.plan import Plan
from volery.experiments.analysis.metrics import Metrics, compute_metrics
from volery.experiments.cli.metric_tables import metrics_tables
from volery.experiments.evaluation.evaluation import Evaluation, Finding, RunData
from volery.experiments.record.record import Record
from volery.quantities import Quantity
from volery.units import period_ns


class CounterEvaluation(Evaluation):
    """Doubts are no estimates."""

    quantities = (Quantity("doubt", role="diagnostic"),)

    def findings(self, run: RunData) -> Sequence[Finding]:
        """The largest count, and that it was counted."""
        most = max(float(mine.value.max()) for mine in run.estimates("count").values())
        return [
            Finding("largest count", most, "times"),
            Finding("thousandths", 1000 * most + 876),
            Finding("counting", text=f"{len(self.plan.agents)} agents counted"),
        ]


class Counter(Agent):
    """Counts its timers, notes every third, and reports its doubts aside."""

    evaluation = CounterEvaluation

    def start(self) -> None:
        """Begin."""
        self.context.set_timer(0)

    def on_timer(self, timer: Timer) -> None:
        """Count."""
        self.context.report("count", [timer.index], timer.index)
        self.context.report("doubt", [0.5, 0.25, timer.index], timer.index)
        if timer.index % 3 == 0:
            self.context.note("third", count=timer.index)
        self.context.set_timer(period_ns(10.0, timer.index + 1), index=timer.index + 1)


def _printed(metrics: Metrics) -> str:
    console = Console(width=200, record=True, file=io.StringIO())
    for table in metrics_tables(metrics):
        console.print(table)
    return console.export_text()


def _counted(plan_of: Callable[..., Plan], twin_run: Callable[[Plan], Record]) -> Metrics:
    return compute_metrics(twin_run(plan_of([("1", "2")], kind=Counter)))


def test_a_kind_says_what_it_found(plan_of: Callable[..., Plan], twin_run: Callable[[Plan], Record]) -> None:
    """Numbers and sentences stand in the metrics, their JSON and a table, counts with all digits; notes are counted."""
    metrics = _counted(plan_of, twin_run)
    found = {one.name: (one.value, one.unit, one.text) for one in metrics.findings}
    assert found["largest count"] == (9.0, "times", "")
    assert found["counting"][2] == "2 agents counted"
    assert found["noted: third"] == (8, "", "first by 1 at 0.000 s")
    written = json.loads(metrics.to_json())["findings"]
    assert {"name": "counting", "value": None, "unit": "", "text": "2 agents counted"} in written
    text = _printed(metrics)
    assert "largest count" in text
    assert "9 times" in text
    assert "9,876" in text


def test_what_is_reported_aside_has_no_errors(plan_of: Callable[..., Plan], twin_run: Callable[[Plan], Record]) -> None:
    """It is in the record, and neither in the metrics nor among the figures."""
    metrics = _counted(plan_of, twin_run)
    assert list(metrics.quantities) == ["count"]
