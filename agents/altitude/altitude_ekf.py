"""The agent that estimates the altitude from the measurements of its neighbours, sensor nodes: Bavle 2017.

Measurements are used in the order of their stamps, however late they arrive; an estimate is a prediction to the
instant of the report, and does not change the filter.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...estimators.altitude.modular_filter import GROUND, Belief
from ...estimators.altitude.replay import Replay, Stamped
from ...units import first_period, period_ns
from .. import measurements
from ..agent import Agent, Context, Received, Timer
from ..measurements import Measurement
from ..payloads import DamagedPayload
from ..plan import Plan
from . import altitude_network as network
from .altitude_ekf_settings import AltitudeEkfParameters
from .altitude_network import COUNTS, DEVIATION, OUTCOMES, component_name, reported


class AltitudeEkf(Agent):
    """The hub of a star of sensor nodes; it never sends."""

    Parameters = AltitudeEkfParameters
    evaluation = "volery.experiments.evaluation.altitude_evaluation:AltitudeEvaluation"
    timers_only = True

    parameters: AltitudeEkfParameters

    def __init__(self, context: Context, parameters: AltitudeEkfParameters) -> None:
        super().__init__(context, parameters)
        self._filter = parameters.filter()
        self._replay = self._from(self._filter.start(context.now_ns, lost=context.now_ns > 0))
        self._counts = dict.fromkeys(OUTCOMES, 0)

    def _from(self, belief: Belief) -> Replay[Belief]:
        def step(before: Belief, measurement: Stamped) -> Belief:
            return self._filter.take(before, measurement.time_ns, measurement.source, measurement.values)

        return Replay(belief, belief.time_ns, step, self.parameters.history)

    def start(self) -> None:
        """Set the timer of the first estimate, at the next instant of the rate."""
        self._wait(first_period(self.parameters.rate, self.context.now_ns))

    def _wait(self, index: int) -> None:
        self.context.set_timer(period_ns(self.parameters.rate, index), index=index)

    def on_frame(self, frame: Received) -> None:
        """Use the measurement at its stamp."""
        try:
            measurement = measurements.decode(frame.payload)
        except DamagedPayload:
            self._counts["refused"] += 1
            return
        name = component_name(frame.source, measurement.sensor)
        if not self._fits(name, measurement):
            self._counts["refused"] += 1
            return
        self._counts["ahead"] += measurement.stamp_ns > frame.time_ns
        time_ns = min(measurement.stamp_ns, frame.time_ns)
        self._counts[self._replay.take(Stamped(time_ns, name, measurement.values, measurement.stamp_ns))] += 1

    def _fits(self, name: str, measurement: Measurement) -> bool:
        size = self._filter.size(name) if name in self._filter.sensors else None
        return measurement.values.size == size and bool(np.isfinite(measurement.values).all())

    def on_timer(self, timer: Timer) -> None:
        """Report the estimate of this instant."""
        latest = self._replay.latest
        belief = self._filter.predict(latest, max(timer.time_ns, latest.time_ns))
        for quantity, value in reported(self.parameters, self._filter, belief):
            self.context.report(quantity, value, timer.index)
        self.context.report(DEVIATION, [belief.deviation(0), belief.deviation(GROUND)], timer.index)
        self.context.report(COUNTS, [*self._counts.values(), belief.jumps], timer.index)
        self._wait(timer.index + 1)

    def save(self) -> Any:
        """Estimate and counts; the history is not kept."""
        latest = self._replay.latest
        belief = [latest.time_ns, latest.mean.tolist(), latest.covariance.tolist(), latest.jumps]
        return [belief, list(self._counts.values())]

    def restore(self, state: Any) -> None:
        """Restore them; the next measurement predicts over the gap."""
        (time_ns, mean, covariance, jumps), counts = state
        self._replay = self._from(Belief(time_ns, np.array(mean), np.array(covariance), jumps))
        self._counts = dict(zip(OUTCOMES, counts, strict=True))

    @classmethod
    def sends_per_second(cls, parameters: AltitudeEkfParameters) -> float:
        """It never sends."""
        return 0.0

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """See `altitude_network.problems`."""
        return network.problems(plan)
