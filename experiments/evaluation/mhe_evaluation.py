"""Attitude and altitude by moving horizon: the same windows with every measurement in time, and counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...agents.agent import Sample
from ...agents.mhe.estimator import ALTITUDE, ATTITUDE, COUNT_NAMES, COUNTS, DISTURBANCE, EKF, reported, tracks
from ...agents.mhe.mhe_settings import MheParameters
from ...agents.plan import Plan
from ...quantities import Component, Floats, Quantity
from ...rotations import quaternion_to_euler
from ...units import period_ns
from ...worlds.quadrotor.quadrotor_sensors import QuadrotorWorld
from .evaluation import Evaluation, Finding, RunData, Series

_ANGLES = tuple(Component(angle, "mrad", 1000.0) for angle in ("roll", "pitch", "yaw"))


class MheEvaluation(Evaluation):
    """Estimates belong to points; the central estimator has every sample in time, as have the Kalman filters."""

    quantities = (
        *(Quantity(f"{ATTITUDE} {kind}{suffix}", _ANGLES) for kind in "AB" for suffix in ("", EKF)),
        *(Quantity(f"{ALTITUDE} A{suffix}", (Component("altitude", "m"),)) for suffix in ("", EKF)),
        *(Quantity(f"{DISTURBANCE} {kind}", role="diagnostic") for kind in "AB"),
        Quantity(COUNTS, tuple(map(Component, COUNT_NAMES)), role="diagnostic"),
    )

    def __init__(self, plan: Plan, world_reports: Mapping[str, Series]) -> None:
        super().__init__(plan, world_reports)
        self._parameters: MheParameters = next(
            agent.parameters for agent in plan.agents if isinstance(agent.parameters, MheParameters)
        )
        self._tracks = tracks(self._parameters, 0)
        self._point = -1
        self._central: dict[str, Floats] = {}

    def instant(self, agent: str, quantity: str, index: int, time_ns: int) -> int:
        """That of the point."""
        return period_ns(self._parameters.rate, index)

    def truth(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats | None:
        """Roll, pitch and yaw, or the altitude, at the point's instant."""
        if not isinstance(self.plan.world, QuadrotorWorld):
            return None
        state = self.plan.world.truth(time_ns)
        if quantity.startswith(ATTITUDE):
            return quaternion_to_euler(state[:4])
        return np.array([-state[7]]) if quantity.startswith(ALTITUDE) else None

    def sampled(self, agent: str, sample: Sample) -> None:
        """Write it down at its point."""
        assert self.plan.world is not None
        if sample.value is not None and sample.sensor in self._parameters.sensors.get(agent, ()):
            rate = self.plan.world.sensors(agent)[sample.sensor]
            assert isinstance(rate, float)
            each = round(self._parameters.rate / rate)
            for track in self._tracks.values():
                track.put(sample.sensor, sample.index * each, sample.value)

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats | None:
        """What the same window says that has every measurement in time; of the filter, what the filter then says."""
        while self._point < index:
            self._point += 1
            self._central = {
                name: value
                for configuration, track in self._tracks.items()
                for name, value in reported(configuration, track.estimate(self._point))
            }
        return self._central.get(quantity)

    def findings(self, run: RunData) -> Sequence[Finding]:
        """How many measurements were of use, and how often a bound was active."""
        return [
            Finding(f"{agent}: {name}", float(value))
            for agent, series in (run.estimates(COUNTS) if COUNTS in run.quantities() else {}).items()
            for name, value in zip(COUNT_NAMES, series.value[-1], strict=True)
        ]
