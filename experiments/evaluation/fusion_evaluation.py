"""Agents with a distributed filter: the Kalman filter on the measurements of all, and consistency."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...agents.agent import Sample
from ...agents.fusion.fusion_agent import COVARIANCE, ESTIMATE, FusingAgent
from ...agents.plan import Plan
from ...agents.registry import find
from ...estimators.distributed.gaussian import corrected, measured_information, predict
from ...estimators.information import pack_symmetric, unpack_symmetric
from ...quantities import Component, Floats, Quantity
from ...units import period_ns
from ...worlds.plane.plane_world import PlaneWorld
from ...worlds.target.target_world import TargetWorld
from .dfa_evaluation import ATTITUDE
from .evaluation import Evaluation, Finding, RunData, Series, View

SETTLED = 0.25
"""Part of the run at its begin that says more of the start than of the filter."""
Readings = dict[str, dict[str, Floats | None]]


class FusionEvaluation(Evaluation):
    """Estimates belong to samples; the central estimator is a Kalman filter on all measurements of all agents.

    Kalman 1960, linearised where the problem is not linear.
    """

    quantities: Sequence[Quantity] = (Quantity(ESTIMATE, covariance=COVARIANCE),)

    def __init__(self, plan: Plan, world_reports: Mapping[str, Series]) -> None:
        super().__init__(plan, world_reports)
        kind = find(plan.agents[0].kind)
        assert issubclass(kind, FusingAgent)
        self.problem = kind.problem(plan.public)
        self._belief = self.problem.prior
        self._sample = -1
        self._readings: dict[int, Readings] = {}

    @abstractmethod
    def state(self, sample: int) -> Floats:
        """The true state at a sample."""

    def instant(self, agent: str, quantity: str, index: int, time_ns: int) -> int:
        """That of the sample."""
        return period_ns(self.problem.rate, index)

    def truth(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats | None:
        """The state when the sample was taken."""
        return self.state(index) if quantity == ESTIMATE else None

    def sampled(self, agent: str, sample: Sample) -> None:
        """Keep it until all of the sample are there."""
        self._readings.setdefault(sample.index, {}).setdefault(agent, {})[sample.sensor] = sample.value

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats | None:
        """Mean or covariance of the filter after a sample."""
        while self._sample < index:
            self._go_on()
        return self._belief.mean if quantity == ESTIMATE else pack_symmetric(self._belief.covariance)

    def _go_on(self) -> None:
        """Predict to the next sample and take in what everybody measured; who measured nothing has empty readings."""
        self._sample += 1
        read = self._readings.pop(self._sample, {})
        seen = {agent.name: read.get(agent.name, {}) for agent in self.plan.agents}
        belief = self._belief
        if self._sample:
            belief = predict(belief, self.problem.step(list(seen.values()), belief.mean))
        measurements = [self.problem.measurement(name, readings, belief.mean) for name, readings in seen.items()]
        pairs = [measured_information(one, len(belief.mean)) for one in measurements if one is not None]
        self._belief = corrected(belief, pairs)

    def findings(self, run: RunData) -> Sequence[Finding]:
        """Consistency: the mean NEES over the dimension, of the agents and of the centralised filter."""
        return list(self._consistency(run)) if COVARIANCE in run.quantities() else []

    def _consistency(self, run: RunData) -> Iterator[Finding]:
        values: list[float] = []
        best: list[float] = []
        for agent, reports in run.estimates(ESTIMATE).items():
            settled = np.array([self.has_settled(sample, run) for sample in reports.sample.tolist()])
            own, central = run.nees(ESTIMATE)[agent], run.central_nees(ESTIMATE)[agent]
            known = settled & ~np.isnan(own)
            values += (own[known] / reports.value.shape[1]).tolist()
            best += (central[known] / reports.value.shape[1]).tolist()
        if values:
            text = (
                "mean NEES over the dimension after a quarter of the run: 1 where the covariance is right, "
                "above if it lies"
            )
            yield Finding("ANEES", float(np.mean(values)), "", text)
            yield Finding("ANEES, centralised", float(np.mean(best)), "", "of the Kalman filter on all measurements")

    def has_settled(self, sample: int, run: RunData) -> bool:
        """Whether a sample says more of the filter than of the start."""
        return period_ns(self.problem.rate, sample) >= SETTLED * run.last_ns


class TrackerEvaluation(FusionEvaluation):
    """Trackers of a target."""

    quantities = (
        Quantity(
            ESTIMATE,
            (
                Component("position x", "m"),
                Component("position y", "m"),
                Component("velocity x", "m/s"),
                Component("velocity y", "m/s"),
            ),
            covariance=COVARIANCE,
        ),
    )

    def state(self, sample: int) -> Floats:
        """Of the target, position and velocity."""
        assert isinstance(self.plan.world, TargetWorld)
        return self.plan.world.state(sample)

    def view(self, agent: str, reports: Mapping[str, Floats]) -> View | None:
        """Where the target is."""
        if ESTIMATE not in reports:
            return None
        stated = {"target": unpack_symmetric(reports[COVARIANCE])[:2, :2]} if COVARIANCE in reports else {}
        return View({"target": reports[ESTIMATE][:2]}, stated)

    def findings(self, run: RunData) -> Sequence[Finding]:
        """Errors of the position, and consistency."""
        return [*self._position_errors(run), *super().findings(run)]

    def _position_errors(self, run: RunData) -> Iterator[Finding]:
        own, best = [], []
        for agent, reports in run.estimates(ESTIMATE).items() if ESTIMATE in run.quantities() else ():
            settled = [self.has_settled(sample, run) for sample in reports.sample.tolist()]
            truth, central = run.truth(ESTIMATE)[agent], run.central(ESTIMATE)[agent]
            own += list((reports.value - truth)[settled, :2])
            best += list((central - truth)[settled, :2])
        if own:
            yield Finding("position error", _rms(own), "m", "rms over agents and samples after a quarter of the run")
            yield Finding("position error, centralised", _rms(best), "m", "of the Kalman filter on all measurements")


class DfaKalmanEvaluation(FusionEvaluation):
    """Flying-array modules with rate gyros."""

    quantities = (Quantity(ESTIMATE, ATTITUDE, covariance=COVARIANCE),)

    def state(self, sample: int) -> Floats:
        """Altitude, roll and pitch."""
        assert isinstance(self.plan.world, PlaneWorld)
        return self.plan.world.truth(period_ns(self.problem.rate, sample))


def _rms(errors: list[Floats]) -> float:
    return math.sqrt(float(np.mean(np.sum(np.square(errors), axis=1))))
