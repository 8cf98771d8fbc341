"""The agent that estimates the altitude from what its neighbours, nodes with sensors, tell: Bavle 2017 as a network.

Measurements are used in the order of their stamps, however late they come; an estimate is a prediction to the instant
at which it is asked for, and changes nothing. The oracle is the same filter with links that neither lose nor lag.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..estimators.modular_filter import GROUND, Belief, ModularFilter
from ..estimators.replay import Replay, Stamped
from ..units import first_period, period_ns
from ..worlds import AltitudeWorld
from . import measurements
from .agent import Agent, Context, Received, Timer
from .altitude_parameters import AltitudeEkfParameters
from .measurements import Measurement
from .payloads import DamagedPayload
from .plan import Plan
from .same_plan import Same
from .sensor_node import SensorNodeParameters, numbers, widths

ALTITUDE, BIAS, COUNTS = "altitude", "barometer bias", "measurements"
_OUTCOMES = ("in order", "replayed", "repeated", "too old", "ahead", "refused")
"""What can become of a measurement; one that is ahead of the own clock is used too, as if it were of now."""


def component_name(node: str, sensor: int) -> str:
    """The name of the component for a sensor of a node."""
    return f"{node}.{sensor}" if sensor else node


class AltitudeEkf(Agent):
    """The hub of a star of sensor nodes; it never sends."""

    Parameters = AltitudeEkfParameters
    timers_only = True

    parameters: AltitudeEkfParameters

    def __init__(self, context: Context, parameters: AltitudeEkfParameters) -> None:
        super().__init__(context, parameters)
        self._filter = parameters.filter()
        self._replay = self._from(self._filter.start(context.now_ns, lost=context.now_ns > 0))
        self._counts = dict.fromkeys(_OUTCOMES, 0)

    def _from(self, belief: Belief) -> Replay[Belief]:
        def step(before: Belief, measurement: Stamped) -> Belief:
            return self._filter.take(before, measurement.time_ns, measurement.source, measurement.values)

        return Replay(belief, belief.time_ns, step, self.parameters.history)

    def start(self) -> None:
        """The first estimate is at the next instant of the rate."""
        self._wait(first_period(self.parameters.rate, self.context.now_ns))

    def _wait(self, index: int) -> None:
        self.context.set_timer(period_ns(self.parameters.rate, index), index=index)

    def on_frame(self, frame: Received) -> None:
        """Use the measurement where its stamp belongs."""
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
        stamp_ns = min(measurement.stamp_ns, frame.time_ns)
        self._counts[self._replay.take(Stamped(stamp_ns, name, measurement.values))] += 1

    def _fits(self, name: str, measurement: Measurement) -> bool:
        size = self._filter.size(name) if name in self._filter.sensors else None
        return measurement.values.size == size and bool(np.isfinite(measurement.values).all())

    def on_timer(self, timer: Timer) -> None:
        """Say what is believed of this instant."""
        latest = self._replay.latest
        belief = self._filter.predict(latest, max(timer.time_ns, latest.time_ns))
        for quantity, value in _reported(self.parameters, self._filter, belief):
            self.context.report(quantity, value, timer.index)
        self.context.report(COUNTS, [*self._counts.values(), belief.jumps], timer.index)
        self._wait(timer.index + 1)

    def save(self) -> Any:
        """What is believed, and the counts; the history is not kept."""
        latest = self._replay.latest
        belief = [latest.time_ns, latest.mean.tolist(), latest.covariance.tolist(), latest.jumps]
        return [belief, list(self._counts.values())]

    def restore(self, state: Any) -> None:
        """Go on from there; the next measurement predicts over the gap."""
        (time_ns, mean, covariance, jumps), counts = state
        self._replay = self._from(Belief(time_ns, np.array(mean), np.array(covariance), jumps))
        self._counts = dict(zip(_OUTCOMES, counts, strict=True))

    @classmethod
    def sends_per_second(cls, parameters: AltitudeEkfParameters) -> float:
        """It only listens."""
        return 0.0

    @classmethod
    def oracle(cls, plan: Plan, quantity: str, index: int) -> NDArray[np.float64] | None:
        """What the same filter says that has every measurement at the instant at which it was taken."""
        return _courses(Same(plan)).get(quantity, {}).get(index)

    @classmethod
    def truth(cls, plan: Plan, quantity: str, index: int, time_ns: int) -> NDArray[np.float64] | None:
        """Height of the vehicle and of the ground and climb rate, or the biases of the barometers, at the instant."""
        world = plan.world
        if not isinstance(world, AltitudeWorld) or quantity == COUNTS:
            return None
        if quantity == ALTITUDE:
            return world.truth(time_ns)
        biases = [world.bias(name, time_ns) for name in _parameters(plan).barometers]
        return np.array([np.nan if bias is None else bias for bias in biases])

    @classmethod
    def labels(cls, quantity: str) -> Sequence[tuple[str, str, float]]:
        """Metres, but for the counts."""
        if quantity == ALTITUDE:
            return (("altitude", "m", 1.0), ("ground", "m", 1.0), ("climb rate", "m/s", 1.0))
        return tuple((name, "", 1.0) for name in (*_OUTCOMES, "jumps of the ground")) if quantity == COUNTS else ()

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """Components without a node, and nodes without a component or with another number of values."""
        hubs = [agent.name for agent in plan.agents if isinstance(agent.parameters, AltitudeEkfParameters)]
        if len(hubs) > 1:
            return [f"agents {', '.join(hubs)} are altitude-ekf: a scenario has one, with sensor nodes around it"]
        return list(_misfits(plan, hubs[0]))


def _parameters(plan: Plan) -> AltitudeEkfParameters:
    parameters = (agent.parameters for agent in plan.agents)
    return next(each for each in parameters if isinstance(each, AltitudeEkfParameters))


def _reported(
    parameters: AltitudeEkfParameters, of: ModularFilter, belief: Belief
) -> Iterator[tuple[str, NDArray[np.float64]]]:
    yield ALTITUDE, belief.mean[[0, GROUND, 1]]
    biases = [of.names.index(f"barometer bias of {name}") for name in parameters.barometers]
    if biases:
        yield BIAS, belief.mean[biases]


def _misfits(plan: Plan, hub: str) -> Iterator[str]:
    neighbours, parts = plan.agent(hub).neighbours, dict(_parameters(plan).components())
    of = _parameters(plan).filter()
    for name in parts:
        if name.partition(".")[0] not in neighbours:
            yield (
                f"component {name} is of no neighbour of {hub}, whose neighbours are {', '.join(neighbours)}: "
                "name it after the node that sends its measurements"
            )
    for node in neighbours:
        if not isinstance(plan.agent(node).parameters, SensorNodeParameters):
            continue
        told = {component_name(node, number): widths(plan, node)[sensor] for sensor, number in numbers(plan, node)}
        for name, width in told.items():
            if name not in parts:
                yield f"what {name} measures would be refused: add a component {name} to {hub}, or remove the sensor"
            elif width is not None and width != of.size(name):
                yield (
                    f"{name} measures {width} values, its component in {hub} takes {of.size(name)}: "
                    "put it under imus, barometers or range_finders as the sensor is"
                )
        for name in parts:
            if name.partition(".")[0] == node and name not in told:
                yield f"component {name} has no sensor: node {node} has {', '.join(told) or 'none'}"


@lru_cache(maxsize=2)
def _courses(same: Same) -> dict[str, dict[int, NDArray[np.float64]]]:
    """Quantity → index → what the filter says at that estimate's instant, with all that was measured until then."""
    plan, parameters = same.plan, _parameters(same.plan)
    of = parameters.filter()
    belief = of.start()
    courses: dict[str, dict[int, NDArray[np.float64]]] = {ALTITUDE: {}, BIAS: {}}
    index = 0
    for measurement in [*measured(plan, of.sensors), None]:
        until_ns = plan.duration_ns if measurement is None else measurement.time_ns
        while (time_ns := period_ns(parameters.rate, index)) < until_ns:
            for quantity, value in _reported(parameters, of, of.predict(belief, time_ns)):
                courses[quantity][index] = value
            index += 1
        if measurement is not None:
            belief = of.take(belief, measurement.time_ns, measurement.source, measurement.values)
    return courses


def measured(plan: Plan, components: Sequence[str]) -> list[Stamped]:
    """All that the sensors of these components see in a run, in the order of their instants."""
    assert plan.world is not None
    found = []
    for agent in plan.agents:
        if not isinstance(agent.parameters, SensorNodeParameters):
            continue
        rates = plan.world.sensors(agent.name)
        for sensor, number in numbers(plan, agent.name):
            name = component_name(agent.name, number)
            for index in range(first_period(rates[sensor], plan.duration_ns) if name in components else 0):
                value = plan.measure(agent.name, sensor, index)
                if value is not None:
                    found.append(Stamped(period_ns(rates[sensor], index), name, value))
    return sorted(found, key=lambda measurement: measurement.key)
