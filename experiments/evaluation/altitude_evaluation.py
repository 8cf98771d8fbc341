"""The altitude over a floor with obstacles: the filter with links that neither lose nor lag, errors and counts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...agents.agent import Sample
from ...agents.altitude.altitude_network import (
    ALTITUDE,
    BIAS,
    COUNTS,
    DEVIATION,
    OUTCOMES,
    component_name,
    parameters_of,
    reported,
)
from ...agents.plan import Plan
from ...agents.sensor_node import SensorNodeParameters, numbers
from ...estimators.altitude.replay import Stamped
from ...quantities import Component, Floats, Quantity
from ...worlds.altitude.altitude_world import AltitudeWorld
from .evaluation import Evaluation, Finding, RunData, Series

JUMPS = "jumps of the ground"
_CM = 100.0


class AltitudeEvaluation(Evaluation):
    """The central estimator is the same filter that has every measurement at the instant at which it was taken."""

    quantities = (
        Quantity(ALTITUDE, (Component("altitude", "m"), Component("ground", "m"), Component("climb rate", "m/s"))),
        Quantity(COUNTS, tuple(Component(name) for name in (*OUTCOMES, JUMPS)), role="diagnostic"),
        Quantity(DEVIATION, (Component("altitude", "m"), Component("ground", "m")), role="diagnostic"),
    )

    def __init__(self, plan: Plan, world_reports: Mapping[str, Series]) -> None:
        super().__init__(plan, world_reports)
        self._parameters = parameters_of(plan)
        self._filter = self._parameters.filter()
        self._belief = self._filter.start()
        self._components = {
            (agent.name, sensor): name
            for agent in plan.agents
            if isinstance(agent.parameters, SensorNodeParameters)
            for sensor, number in numbers(plan, agent.name)
            if (name := component_name(agent.name, number)) in self._filter.sensors
        }
        self._taken: list[Stamped] = []

    def truth(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats | None:
        """Height of the vehicle and of the ground and climb rate, or the biases of the barometers, at the instant."""
        world = self.plan.world
        if not isinstance(world, AltitudeWorld) or quantity not in (ALTITUDE, BIAS):
            return None
        if quantity == ALTITUDE:
            return world.truth(time_ns)
        biases = [world.bias(name, time_ns) for name in self._parameters.barometers]
        return np.array([np.nan if bias is None else bias for bias in biases])

    def sampled(self, agent: str, sample: Sample) -> None:
        """Keep it until all of its instant are there."""
        name = self._components.get((agent, sample.sensor))
        if name is not None and sample.value is not None:
            self._taken.append(Stamped(sample.time_ns, name, sample.value))

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats | None:
        """What the filter predicts for the instant."""
        for one in sorted(self._taken, key=lambda measurement: measurement.key):
            self._belief = self._filter.take(self._belief, one.time_ns, one.source, one.values)
        self._taken = []
        belief = self._filter.predict(self._belief, time_ns)
        return dict(reported(self._parameters, self._filter, belief)).get(quantity)

    def findings(self, run: RunData) -> Sequence[Finding]:
        """Errors of the altitude, and the fates of the measurements."""
        return list(self._findings(run)) if ALTITUDE in run.quantities() else []

    def _findings(self, run: RunData) -> Iterator[Finding]:
        """Mean errors of altitude and ground, how often the altitude is as near as the filter believes, the counts."""
        ((hub, reports),) = run.estimates(ALTITUDE).items()
        truth = run.truth(ALTITUDE)[hub]
        if np.isfinite(truth).all():
            altitude, ground = _CM * np.abs(reports.value - truth).T[:2]
            yield Finding(
                "mean error of the altitude", float(altitude.mean()), "cm", f"largest {altitude.max():.1f} cm"
            )
            for over, where in ((truth[:, 1] > 0.0, "obstacles"), (truth[:, 1] == 0.0, "the floor")):
                if over.any():
                    yield Finding(f"mean error of the altitude over {where}", float(altitude[over].mean()), "cm")
            yield Finding("mean error of the ground", float(ground.mean()), "cm")
            believed = _CM * run.estimates(DEVIATION)[hub].value[:, 0]
            text = "of the time; a consistent Gaussian filter has 95 %"
            yield Finding("altitude within two deviations", 100 * float((altitude < 2 * believed).mean()), "%", text)
        counts = run.estimates(COUNTS)[hub].value[-1].tolist()
        named = (f"{int(count):,} {name}" for name, count in zip((*OUTCOMES, JUMPS), counts, strict=True))
        yield Finding("measurements at the hub", text=", ".join(named))
