"""Trackers: agents that track a target with a distributed filter; each measures one coordinate of it, or nothing.

Letters: x = (p_x, p_y, v_x, v_y) position [m] and velocity [m/s] of the target.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...estimators.distributed.gaussian import Gaussian, Measurement, Step
from ...units import Metres, MetresPerSecondPerRootSecond, check_fields_above_zero
from ...worlds.target.target_world import COORDINATES, TargetModel, TargetWorld, process_noise, transition
from ..plan import Plan, PublicPlan
from .fusion_agent import FusingAgent
from .fusion_settings import FusingParameters
from .problem import Problem, Readings


@dataclass(frozen=True)
class TrackerParameters(FusingParameters):
    """Parameters of a tracker: those of its filter, and its model of the target.

    manoeuvre: random walk of the velocity; by default that of the world.
    noise: standard deviation of a measurement; by default that of the world.
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

    model: TargetModel

    @property
    def rate(self) -> float:
        """That of the sensors [Hz]."""
        return self.model.rate

    @property
    def prior(self) -> Gaussian:
        """Zero mean, with the standard deviations of the world."""
        spread = np.repeat([self.model.position, self.model.velocity], 2)
        return Gaussian(np.zeros(4), np.diag(spread**2))

    def step(self, readings: Sequence[Readings], mean: NDArray[np.float64]) -> Step:
        """The same constant-velocity step for every sample."""
        period_s = 1.0 / self.rate
        return Step(transition(period_s), process_noise(period_s, self.model.manoeuvre), np.zeros(4))

    def measurement(self, agent: str, readings: Readings, mean: NDArray[np.float64]) -> Measurement | None:
        """The measured coordinate."""
        for sensor, value in readings.items():
            if value is not None:
                return Measurement(np.eye(4)[[COORDINATES.index(sensor)]], np.eye(1) * self.model.noise**2, value)
        return None


class Tracker(FusingAgent):
    """One agent that follows the target."""

    Parameters = TrackerParameters
    evaluation = "volery.experiments.evaluation.fusion_evaluation:TrackerEvaluation"

    @classmethod
    def problem(cls, plan: PublicPlan) -> Problem:
        """The target as the agents model it."""
        model, parameters = plan.model, plan.agents[0].parameters
        assert isinstance(model, TargetModel), "unfit() refuses other worlds"
        manoeuvre = model.manoeuvre if parameters.manoeuvre is None else parameters.manoeuvre
        noise = model.noise if parameters.noise is None else parameters.noise
        return TargetProblem(replace(model, manoeuvre=manoeuvre, noise=noise))

    @classmethod
    def unfit(cls, plan: Plan) -> Sequence[str]:
        """Problem: a world without a target."""
        if not isinstance(plan.world, TargetWorld):
            return ["tracker needs a target to follow: add `world: {kind: target}`"]
        return []
