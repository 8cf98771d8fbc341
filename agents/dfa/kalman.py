"""Flying-array modules with rate gyros: predicted with the gyros, corrected with the distance sensors of all modules.

Kriegleder 2012 estimates each sample by itself and leaves the fusion with gyroscopes open. Here a module predicts its
state by its own gyros, and a distributed filter fuses predictions and distances over the links. Letters: state
x = (z, γ, β) altitude [m], roll and pitch [rad]; (p, q, r) rates of turning about the body's axes [rad/s]; Δ time
between samples [s]; (r_X, r_Y) place of a module [m].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...estimators.distributed.gaussian import Gaussian, Measurement, Step
from ...topologies import Position
from ...units import Metres, MetresPerRootSecond, Radians, check_fields_above_zero
from ...worlds.plane.plane_world import GYROSCOPE, SENSOR, PlaneModel, PlaneWorld, distances
from ..fusion.fusion_agent import FusingAgent
from ..fusion.fusion_settings import FusingParameters
from ..fusion.problem import Problem, Readings
from ..plan import Plan, PublicPlan

_STEP = 1e-6
"""Step of central differences [m, rad]: their error is about 1e-10."""
_STEEPEST = 1.4
"""Largest roll and pitch at which the model is linearised [rad]: the distance has a pole at 90°."""


@dataclass(frozen=True)
class DfaKalmanParameters(FusingParameters):
    """Parameters of such a module: those of its filter, and its model of the body.

    altitude, altitude_spread: of the prior. tilt_spread: standard deviation of roll and pitch in it.
    climb: random walk of the altitude. turn: random walk of roll and pitch in addition to the gyros' noise.
    distance_noise: standard deviation; by default that of the world.
    """

    altitude: Metres = 0.25
    altitude_spread: Metres = 0.2
    tilt_spread: Radians = 0.2
    climb: MetresPerRootSecond = 0.05
    turn: Radians = 0.001
    distance_noise: Metres | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        super().__post_init__()
        check_fields_above_zero(self, "altitude_spread", "tilt_spread", "climb", "turn", "distance_noise")


@dataclass(frozen=True)
class ArrayProblem:
    """Model of an array's tilt and altitude and of their measurements; `rate` is that of all sensors [Hz]."""

    rate: float
    positions: Mapping[str, Position]
    parameters: DfaKalmanParameters
    distance_noise: float
    gyroscope_noise: float

    @property
    def prior(self) -> Gaussian:
        """Level, at the altitude of the parameters, with their standard deviations."""
        own = self.parameters
        return Gaussian(
            np.array([own.altitude, 0.0, 0.0]),
            np.diag([own.altitude_spread**2, own.tilt_spread**2, own.tilt_spread**2]),
        )

    def step(self, readings: Sequence[Readings], mean: NDArray[np.float64]) -> Step:
        """Rotation by the mean of the available gyros.

        γ̇ = p + tan β (q sin γ + r cos γ),  β̇ = q cos γ − r sin γ            kinematics of roll and pitch
        A = I + Δ ∂(ż, γ̇, β̇)/∂x; the noise of n gyros moves the angles by Δ σ / √n, and the altitude wanders.
        """
        period_s = 1.0 / self.rate
        gyros = [value for each in readings if (value := each.get(GYROSCOPE)) is not None]
        rates = np.mean(gyros, axis=0) if gyros else np.zeros(3)
        here = np.clip(mean, [-np.inf, -_STEEPEST, -_STEEPEST], [np.inf, _STEEPEST, _STEEPEST])
        A = np.eye(3) + period_s * _jacobian(lambda x: _turning(x, rates), here)
        moved = here + period_s * _turning(here, rates)
        tilt = self.parameters.turn**2 * period_s
        if gyros:
            tilt += (period_s * self.gyroscope_noise) ** 2 / len(gyros)
        noise = np.diag([self.parameters.climb**2 * period_s, tilt, tilt])
        return Step(A, noise, moved - A @ here)

    def measurement(self, agent: str, readings: Readings, mean: NDArray[np.float64]) -> Measurement | None:
        """The distance, linearised about the mean: m = h(x̄) + H (x − x̄), h being Kriegleder 2012, (6)."""
        seen = readings.get(SENSOR)
        if seen is None:
            return None
        place = [self.positions[agent]]
        here = np.clip(mean, [-np.inf, -_STEEPEST, -_STEEPEST], [np.inf, _STEEPEST, _STEEPEST])
        H = _jacobian(lambda x: distances(x, place), here)
        return Measurement(H, np.eye(1) * self.distance_noise**2, seen - distances(here, place) + H @ here)


class DfaKalman(FusingAgent):
    """One module."""

    Parameters = DfaKalmanParameters
    evaluation = "volery.experiments.evaluation.fusion_evaluation:DfaKalmanEvaluation"

    @classmethod
    def problem(cls, plan: PublicPlan) -> Problem:
        """The array of a plan, with the sensors of its world."""
        model, parameters = plan.model, plan.agents[0].parameters
        assert isinstance(model, PlaneModel), "unfit() refuses other worlds"
        noise = model.distance_noise if parameters.distance_noise is None else parameters.distance_noise
        assert noise is not None, "unfit() asks for a noise where the world has none"
        positions = {agent.name: agent.position for agent in plan.agents if agent.position is not None}
        return ArrayProblem(model.rate, positions, parameters, noise, model.gyroscope_noise or 0.0)

    @classmethod
    def unfit(cls, plan: Plan) -> Sequence[str]:
        """Problems: no plane, positions or gyroscope, or an unknown noise of the distances."""
        if not isinstance(plan.world, PlaneWorld):
            return ["dfa-kalman needs a plane to look at: add `world: {kind: plane, …}`"]
        if any(agent.position is None for agent in plan.agents):
            return ["dfa-kalman needs positions: use a topology that has them, such as hexagonal or cells"]
        if plan.world.gyroscope is None:
            return ["dfa-kalman needs rate gyros: add `gyroscope: {noise: 1 deg/s}` to the world"]
        if plan.agents[0].parameters.distance_noise is None and not plan.world.model.distance_noise:
            return ["the world does not say the noise of a distance: set agents.distance_noise, for example to 5 mm"]
        return []


def _turning(state: NDArray[np.float64], rates: NDArray[np.float64]) -> NDArray[np.float64]:
    """(ż, γ̇, β̇) without a climb."""
    _, roll, pitch = state.tolist()
    p, q, r = rates.tolist()
    sine, cosine = math.sin(roll), math.cos(roll)
    return np.array([0.0, p + math.tan(pitch) * (q * sine + r * cosine), q * cosine - r * sine])


def _jacobian(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]], at: NDArray[np.float64]
) -> NDArray[np.float64]:
    """∂f/∂x by central differences, shape (m, n)."""
    moves = _STEP * np.eye(len(at))
    return np.column_stack([(function(at + move) - function(at - move)) / (2 * _STEP) for move in moves])
