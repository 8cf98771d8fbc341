"""Errors, covariances and places of what each agent has of its own, against what is known of them in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray

from volery.agents.agent import Agent, Timer
from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.estimators.error_measures import chi_square_bounds
from volery.experiments.analysis.filter_consistency import departure
from volery.experiments.analysis.metrics import compute_metrics
from volery.experiments.evaluation.evaluation import Evaluation
from volery.experiments.figures.run_figures import draw_disagreement, draw_errors, draw_estimates, figures
from volery.experiments.record.record import Record
from volery.experiments.record.samples import samples
from volery.experiments.sweeps.sweep_runs import measure
from volery.experiments.twin import recorded
from volery.quantities import Component, Quantity
from volery.units import period_ns

RATE_HZ, DEVIATION = 20.0, 0.5
Make = Callable[..., Any]


def home(agent: str) -> NDArray[np.float64]:
    """Where an agent stands: each somewhere else."""
    return np.array([float(agent), 10.0 * float(agent)])


class RobotEvaluation(Evaluation):
    """Of robots that localise themselves; the central estimator knows them to a tenth of their deviation."""

    quantities = (
        Quantity("pose", (Component("x", "m"), Component("y", "m")), is_shared=False),
        Quantity("range", (Component("range", "m"),), role="innovation", is_shared=False),
    )

    def truth(self, agent: str, quantity: str, index: int, time_ns: int) -> NDArray[np.float64] | None:
        """Its home."""
        return home(agent) if quantity == "pose" else None

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> NDArray[np.float64] | None:
        """A tenth of a deviation off in each component, with the covariance of that."""
        if quantity == "pose":
            return home(agent) + 0.1 * DEVIATION
        return (0.1 * DEVIATION) ** 2 * np.eye(2) if quantity == "pose/covariance" else None


class Robot(Agent):
    """Reports its home with normal errors, and a covariance that is `stated` times the right one."""

    timers_only = True
    evaluation: ClassVar[str | type] = RobotEvaluation
    stated: ClassVar[float] = 1.0

    def start(self) -> None:
        """Begin."""
        self.context.set_timer(0)

    def on_timer(self, timer: Timer) -> None:
        """One report of each."""
        noise = DEVIATION * np.random.default_rng([int(self.context.name), timer.index]).normal(size=3)
        square = self.stated * DEVIATION**2
        self.context.report("pose", home(self.context.name) + noise[:2], covariance=square * np.eye(2))
        self.context.report("range", noise[2], covariance=square)
        self.context.set_timer(period_ns(RATE_HZ, timer.index + 1), index=timer.index + 1)


class Hasty(Robot):
    """Reports twice at one instant under one index, with errors of 1 and 2 and variances of 1 and 4."""

    def on_timer(self, timer: Timer) -> None:
        """Two innovations."""
        for error in (1.0, 2.0):
            self.context.report("range", error, covariance=error**2)


class Overconfident(Robot):
    """States a third of its deviation."""

    stated = 1 / 9


class Confused(Robot):
    """States a covariance of three components."""

    evaluation = Evaluation

    def on_timer(self, timer: Timer) -> None:
        """One report."""
        self.context.report("pose", [0.0, 0.0], covariance=np.eye(3))


def flown(plan_of: Make, kind: type[Agent], seconds: int = 16) -> Record:
    """Three robots, for so long."""
    plan: Plan = plan_of([("1", "2"), ("2", "3")], 1000 * seconds, kind=kind)
    return recorded(plan)


def test_normalised_squares_of_ones_own_state(plan_of: Make) -> None:
    """NEES and NIS are 1 within their bounds where the covariance is right, and 9 where a third is stated.

    Of 3 · 320 reports the last three quarters count: 720, whose mean NEES has a standard error of √(1/720) = 0.037.
    The bounds count each robot, which has its own errors, once a second: 36 times; every innovation is on its own.
    """
    for kind, expected, verdict in ((Robot, 1.0, "consistent"), (Overconfident, 9.0, "overconfident")):
        found = compute_metrics(flown(plan_of, kind)).consistency
        assert list(found) == ["pose", "range"]
        for name, test, error in (("pose", "NEES", 0.037), ("range", "NIS", math.sqrt(2 / 720))):
            one = found[name]
            assert (one.test, one.reports, one.verdict) == (test, 720, verdict)
            assert one.mean == pytest.approx(expected, abs=4 * error * expected)
        assert found["pose"].central == pytest.approx(1.0)  # (0.1 σ)² in each of two components, over two
        assert math.isnan(found["range"].central)
        bounds = (found["pose"].low, found["pose"].high, found["range"].low, found["range"].high)
        expected_bounds = [*np.divide(chi_square_bounds(2, 36), 2), *chi_square_bounds(1, 720)]
        assert bounds == pytest.approx(expected_bounds)


def test_reports_of_one_instant_have_their_own_covariances(plan_of: Make) -> None:
    """As innovations of two frames that came at once."""
    record = flown(plan_of, Hasty, 1)
    assert record.nees("range")["1"].tolist() == [1.0, 1.0]


def test_ones_own_state_has_errors_and_no_disagreement(plan_of: Make) -> None:
    """In the metrics, side by side, and in what sweeps keep; an innovation has no errors."""
    record = flown(plan_of, Robot, 4)
    metrics, values = compute_metrics(record), measure(record)
    assert list(metrics.quantities) == ["pose"]
    pose = metrics.quantities["pose"]
    assert pose.truth_error.steady_rms == pytest.approx(DEVIATION * math.sqrt(2), rel=0.2)
    assert math.isnan(pose.disagreement.steady_rms)
    assert values["pose.disagreement.steady_rms"] is None
    assert values["pose.nees"] == metrics.consistency["pose"].mean
    assert values["range.nis"] == metrics.consistency["range"].mean
    seen = samples(record, "pose")
    assert not seen.is_shared
    assert seen.truth[-1] == pytest.approx(np.array([home("1"), home("2"), home("3")]))
    assert seen.deviation == pytest.approx(DEVIATION)
    table = seen.to_dataframe()
    assert table["y_deviation"].to_numpy() == pytest.approx(DEVIATION)
    assert table.attrs["units"]["y_deviation"] == "m"


def test_places_of_ones_own_are_drawn_where_their_agent_is(plan_of: Make) -> None:
    """By the names and units of the components, with the covariance, without a view of the evaluation's own."""
    record = flown(plan_of, Robot, 1)
    assert record.evaluation is not None
    views = record.evaluation.views
    assert {agent: view.names for agent, view in views.items()} == {"1": ("1",), "2": ("2",), "3": ("3",)}
    assert views["2"].covariances[0, 0] == pytest.approx(DEVIATION**2 * np.eye(2))


def test_figures_have_a_column_for_each_agent(plan_of: Make) -> None:
    """Estimate and truth of that agent, with two deviations; errors are pooled in bands, and nobody disagrees."""
    seen = samples(record := flown(plan_of, Robot, 2), "pose")
    figure = Figure()
    draw_estimates(record, seen, figure, most_agents=2)
    first, second, *_ = figure.axes
    assert [axes.get_title() for axes in figure.axes] == ["agent 1", "agent 2", "", ""]
    estimate, oracle, truth = (np.asarray(line.get_ydata(), dtype=float) for line in second.lines)
    assert estimate == pytest.approx(seen.estimate[:, 1, 0])
    assert (oracle[0], truth[0]) == pytest.approx((2.05, 2.0))
    (band,) = first.collections
    low, high = band.get_datalim(first.transData).intervaly
    assert (low, high) == pytest.approx((seen.estimate[:, 0, 0].min() - 1.0, seen.estimate[:, 0, 0].max() + 1.0))
    assert figure.axes[2].get_xlabel() == "time (s); 2 of 3 agents"
    pooled = Figure()
    draw_disagreement(record, seen, pooled)
    assert [text.get_text() for text in pooled.legends[0].get_texts()] == ["error to oracle", "error to truth"]
    assert len(pooled.axes[0].collections) == 2
    errors = Figure()
    draw_errors(record, seen, errors)
    assert len(errors.axes) == 6
    error, zero = (np.asarray(line.get_ydata(), dtype=float) for line in errors.axes[4].lines)
    assert error == pytest.approx(seen.truth_difference[:, 1, 1])
    assert set(zero) == {0.0}
    (band,) = errors.axes[4].collections
    assert tuple(band.get_datalim(errors.axes[4].transData).intervaly) == pytest.approx((-1.0, 1.0))
    assert [name for name in figures(record) if name not in ("links", "age")] == [
        "estimates",
        "disagreement",
        "overview",
        "errors",
    ]


def test_a_covariance_of_another_size_is_refused(plan_of: Make) -> None:
    """The message says what would fit."""
    with pytest.raises(BadInput, match="'pose' of agent 1: a covariance has 6 numbers: for 2 components give all 4"):
        flown(plan_of, Confused, 1)


def test_too_cautious_is_as_far_off_as_too_confident() -> None:
    """By the logarithm of the mean."""
    assert departure(1.0) == 0.0
    assert departure(0.5) == departure(2.0) == pytest.approx(math.log(2.0))
    assert departure(0.0) == math.inf
