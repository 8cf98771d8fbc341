"""Trackers: agents that follow a target by a distributed filter, each seeing one coordinate of it or nothing.

Letters: x = (p_x, p_y, v_x, v_y) position [m] and velocity [m/s] of the target.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...estimators.distributed.gaussian import Gaussian, Measurement, Step
from ...estimators.information import unpack_symmetric
from ...units import Metres, MetresPerSecondPerRootSecond, check_fields_above_zero, period_ns
from ...worlds.target.target_world import COORDINATES, TargetWorld, process_noise, transition
from ..agent import Finding, RunData, View
from ..plan import Plan
from .fusion_agent import COVARIANCE, ESTIMATE, SETTLED, FusingAgent
from .fusion_settings import FusingParameters
from .problem import Problem, Readings, whole


@dataclass(frozen=True)
class TrackerParameters(FusingParameters):
    """Parameters of a tracker: those of its filter, and what it takes for true of the target.

    manoeuvre: by how much the velocity wanders; as in the world unless given.
    noise: standard deviation of a measurement; as in the world unless given.
    """

    manoeuvre: MetresPerSecondPerRootSecond | None = None
    noise: Metres | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        super().__post_init__()
        check_fields_above_zero(self, "manoeuvre", "noise")


@dataclass(frozen=True)
class TargetProblem:
    """A target of constant velocity under white acceleration, of which each sensor sees one coordinate."""

    world: TargetWorld
    manoeuvre: float
    noise: float

    @property
    def rate(self) -> float:
        """That of the sensors [Hz]."""
        return self.world.rate

    @property
    def prior(self) -> Gaussian:
        """About zero, with the standard deviations of the world."""
        spread = np.repeat([self.world.position, self.world.velocity], 2)
        return Gaussian(np.zeros(4), np.diag(spread**2))

    def step(self, readings: Sequence[Readings], mean: NDArray[np.float64]) -> Step:
        """Always the same."""
        period_s = self.world.period_s
        return Step(transition(period_s), process_noise(period_s, self.manoeuvre), np.zeros(4))

    def measurement(self, agent: str, readings: Readings, mean: NDArray[np.float64]) -> Measurement | None:
        """The coordinate that the agent sees."""
        for sensor, value in readings.items():
            if value is not None:
                return Measurement(np.eye(4)[[COORDINATES.index(sensor)]], np.eye(1) * self.noise**2, value)
        return None

    def truth(self, sample: int) -> NDArray[np.float64]:
        """The state at a sample."""
        return self.world.state(sample)


class Tracker(FusingAgent):
    """One agent that follows the target."""

    Parameters = TrackerParameters

    @classmethod
    def problem(cls, plan: Plan) -> Problem:
        """The target of the world, as the agents take it to be."""
        assert isinstance(plan.world, TargetWorld), "unfit() refuses other worlds"
        parameters: TrackerParameters = plan.agents[0].parameters
        return TargetProblem(
            plan.world,
            plan.world.manoeuvre if parameters.manoeuvre is None else parameters.manoeuvre,
            plan.world.noise if parameters.noise is None else parameters.noise,
        )

    @classmethod
    def unfit(cls, plan: Plan) -> Sequence[str]:
        """A world without a target."""
        if not isinstance(plan.world, TargetWorld):
            return ["tracker needs a target to follow: add `world: {kind: target}`"]
        return []

    @classmethod
    def labels(cls, plan: Plan, quantity: str) -> Sequence[tuple[str, str, float]]:
        """Position in metres, velocity in metres per second."""
        if quantity != ESTIMATE:
            return ()
        return (
            ("position x", "m", 1.0),
            ("position y", "m", 1.0),
            ("velocity x", "m/s", 1.0),
            ("velocity y", "m/s", 1.0),
        )

    @classmethod
    def view(cls, plan: Plan, reports: Mapping[str, NDArray[np.float64]]) -> View | None:
        """Where the target is."""
        if ESTIMATE not in reports:
            return None
        stated = {"target": unpack_symmetric(reports[COVARIANCE])[:2, :2]} if COVARIANCE in reports else {}
        return View({"target": reports[ESTIMATE][:2]}, stated)

    @classmethod
    def findings(cls, plan: Plan, run: RunData) -> Sequence[Finding]:
        """Errors of the position, and consistency."""
        return [*_position_errors(plan, run), *super().findings(plan, run)]


def _position_errors(plan: Plan, run: RunData) -> Iterator[Finding]:
    run_of = whole(plan, Tracker.problem)
    own, best = [], []
    for told in run.estimates(ESTIMATE).values() if ESTIMATE in run.quantities() else ():
        for sample, mean in zip(told.sample.tolist(), told.value, strict=True):
            if period_ns(run_of.problem.rate, sample) >= SETTLED * run.last_ns:
                truth = run_of.problem.truth(sample)
                own.append((mean - truth)[:2])
                best.append((run_of.belief(sample).mean - truth)[:2])
    if own:
        yield Finding("position error", _rms(own), "m", "rms over agents and samples after a quarter of the run")
        yield Finding("position error, centralised", _rms(best), "m", "of the Kalman filter on all measurements")


def _rms(errors: list[NDArray[np.float64]]) -> float:
    return math.sqrt(float(np.mean(np.sum(np.square(errors), axis=1))))
