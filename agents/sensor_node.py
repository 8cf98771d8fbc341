"""Sensor nodes: agents that send each sample of their sensors to all neighbours, stamped by their own clock."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from ..errors import BadInput
from ..units import SampleTimes
from . import measurements
from .agent import Agent, Offer, Sample
from .measurements import Measurement
from .payloads import Precision
from .plan import Plan

_LOOKED_AT = 100
"""Number of samples searched for one in which a sensor sees something."""


@dataclass(frozen=True)
class SensorNodeParameters:
    """Settings of a sensor node.

    sensors: names of its sensors; their places in this list are their numbers on the wire. A node with one sensor
        needs no list.
    payload: precision of the values.
    """

    sensors: tuple[str, ...] = ()
    payload: Precision = "float32"

    def __post_init__(self) -> None:
        """Check the names."""
        if len(set(self.sensors)) < len(self.sensors):
            raise BadInput(f"sensors names {', '.join(self.sensors)}, and one of them twice: each has one number")

    def number(self, sensor: str) -> int:
        """The number of a sensor on the wire."""
        return self.sensors.index(sensor) if self.sensors else 0


class SensorNode(Agent):
    """A node that estimates nothing, and sends nothing where its sensor sees nothing."""

    Parameters = SensorNodeParameters
    timers_only = True

    parameters: SensorNodeParameters

    def on_sample(self, sample: Sample) -> None:
        """Send it at once, in one transmission where the neighbours share a radio."""
        if sample.value is not None:
            measurement = Measurement(sample.time_ns, self.parameters.number(sample.sensor), sample.value)
            payload = measurements.encode(measurement, self.parameters.payload)
            self.context.broadcast(payload, stream=sample.sensor)

    @classmethod
    def offers(cls, plan: Plan, name: str) -> Offer:
        """A frame a sample of each sensor; the largest payload is that of the sensor with the most values."""
        times, found = _sensors(plan, name), widths(plan, name)
        parameters: SensorNodeParameters = plan.agent(name).parameters
        sizes = [
            measurements.largest_size(number, width, parameters.payload)
            for sensor, number in numbers(plan, name)
            if (width := found[sensor]) is not None
        ]
        rates = [rate for rate in times.values() if isinstance(rate, float)]
        return Offer(
            max(sizes) if len(sizes) == len(times) > 0 else None, sum(rates) if len(rates) == len(times) else None
        )

    @classmethod
    def broadcasts(cls, parameters: SensorNodeParameters) -> bool:
        """Always."""
        return True

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """Nodes without sensors, and lists that are not those of the world's sensors."""
        nodes = [agent for agent in plan.agents if isinstance(agent.parameters, SensorNodeParameters)]
        found = (_problem(agent.name, agent.parameters, _sensors(plan, agent.name)) for agent in nodes)
        return [text for text in found if text is not None]


def _problem(name: str, parameters: SensorNodeParameters, sensors: Collection[str]) -> str | None:
    has = ", ".join(sensors)
    if not sensors:
        return f"sensor node {name} has no sensor: add a world that gives it one, or another kind of agent for it"
    if not parameters.sensors and len(sensors) > 1:
        return f"sensor node {name} has several sensors, and no numbers for them: write sensors: [{has}]"
    if parameters.sensors and set(parameters.sensors) != set(sensors):
        return f"sensor node {name} lists {', '.join(parameters.sensors)}, the world gives it {has}: list just those"
    return None


def own_sensors(plan: Plan, hub: str) -> Iterator[str]:
    """Problem, with the remedy, of an agent that uses sensor nodes only but has sensors of its own."""
    if has := _sensors(plan, hub):
        yield f"{hub} has {', '.join(has)} of its own, and uses what its neighbours send only: give it to a sensor node"


def numbers(plan: Plan, name: str) -> list[tuple[str, int]]:
    """The sensors of a node that it lists, and their numbers on the wire."""
    parameters: SensorNodeParameters = plan.agent(name).parameters
    listed = [sensor for sensor in _sensors(plan, name) if sensor in parameters.sensors or not parameters.sensors]
    return [(sensor, parameters.number(sensor)) for sensor in listed]


def widths(plan: Plan, name: str) -> dict[str, int | None]:
    """Sensor of a node → values in a sample, None where the first hundred samples see nothing."""
    return {sensor: _width(plan, name, sensor) for sensor in _sensors(plan, name)}


def _sensors(plan: Plan, name: str) -> Mapping[str, SampleTimes]:
    """Sensor → when it samples, of one agent."""
    return {} if plan.world is None else plan.world.sensors(name)


def _width(plan: Plan, name: str, sensor: str) -> int | None:
    """Values in a sample, None where the first hundred samples see nothing."""
    assert plan.world is not None
    samples = (plan.world.measure(name, sensor, index) for index in range(_LOOKED_AT))
    return next((sample.size for sample in samples if sample is not None), None)
