"""Errors of quantities that are no vectors, by what their kind says of two values' difference."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.agents.agent import Agent, Timer
from volery.agents.plan import Plan
from volery.experiments.analysis.metrics import compute_metrics
from volery.experiments.evaluation.evaluation import Evaluation
from volery.experiments.record.record import Record
from volery.experiments.record.samples import samples
from volery.quantities import Component, Quantity
from volery.units import period_ns

TURN = 2 * math.pi


def shorter_way(estimate: NDArray[np.float64], reference: NDArray[np.float64]) -> NDArray[np.float64]:
    """The shorter way round, and a component that is always 0."""
    apart = np.remainder(estimate - reference + math.pi, TURN) - math.pi
    return np.concatenate([apart, 0.0 * apart], axis=-1)


class CompassEvaluation(Evaluation):
    """Headings, whose differences are in mrad."""

    quantities = (
        Quantity(
            "heading",
            difference=shorter_way,
            difference_components=(Component("turn", "mrad", 1000.0), Component("nothing")),
        ),
        Quantity("bearing", is_shared=False),
    )

    def truth(self, agent: str, quantity: str, index: int, time_ns: int) -> NDArray[np.float64] | None:
        """180°."""
        return np.array([math.pi]) if quantity == "heading" else None


class Compass(Agent):
    """Reports a heading of 180° and some tenths, as a number from −π to π, and a bearing of its own."""

    evaluation = CompassEvaluation

    def start(self) -> None:
        """Begin."""
        self.context.set_timer(0)

    def on_timer(self, timer: Timer) -> None:
        """Report."""
        off = 0.3 if self.context.name == "1" else -0.1
        self.context.report("heading", math.remainder(math.pi + off, TURN), timer.index)
        self.context.report("bearing", off, timer.index)
        self.context.set_timer(period_ns(10.0, timer.index + 1), index=timer.index + 1)


def test_errors_are_measured_by_the_difference(
    plan_of: Callable[..., Plan], twin_run: Callable[[Plan], Record]
) -> None:
    """0.3 and 0.1 across the cut at 180°, where subtraction would say 6; they are 0.2 from their mean each."""
    record = twin_run(plan_of([("1", "2")], kind=Compass))
    seen = samples(record, "heading")
    np.testing.assert_allclose(seen.truth_error, np.broadcast_to([0.3, 0.1], seen.truth_error.shape))
    np.testing.assert_allclose(seen.disagreement, 0.2)
    found = compute_metrics(record).quantities["heading"]
    assert found.disagreement.steady_rms == pytest.approx(0.2)
    turn, nothing = found.components
    assert (turn.name, turn.unit, nothing.truth_rms) == ("turn", "mrad", 0.0)
    assert turn.truth_rms == pytest.approx(1000 * math.sqrt((0.3**2 + 0.1**2) / 2))


def test_nobody_disagrees_on_what_is_ones_own(plan_of: Callable[..., Plan], twin_run: Callable[[Plan], Record]) -> None:
    """Bearings of 0.3 and −0.1 are both right, as each agent has its own."""
    assert np.isnan(samples(twin_run(plan_of([("1", "2")], kind=Compass)), "bearing").disagreement).all()
