"""The star around the agent that estimates the altitude: reported quantities and checks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ...estimators.altitude.modular_filter import GROUND, Belief, ModularFilter
from ..plan import Plan
from ..sensor_node import SensorNodeParameters, numbers, own_sensors, widths
from .altitude_ekf_settings import AltitudeEkfParameters

ALTITUDE, BIAS, COUNTS, DEVIATION = "altitude", "barometer bias", "measurements", "altitude deviation"
OUTCOMES = ("in order", "replayed", "repeated", "too old", "ahead", "refused")
"""Outcomes of a measurement; one that is ahead of the own clock is used as if it were of the present instant."""


def component_name(node: str, sensor: int) -> str:
    """Name of the component of a node's sensor."""
    return f"{node}.{sensor}" if sensor else node


def parameters_of(plan: Plan) -> AltitudeEkfParameters:
    """Parameters of the only agent of this kind."""
    parameters = (agent.parameters for agent in plan.agents)
    return next(each for each in parameters if isinstance(each, AltitudeEkfParameters))


def reported(
    parameters: AltitudeEkfParameters, of: ModularFilter, belief: Belief
) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Reported quantities of an estimate and their values."""
    yield ALTITUDE, belief.mean[[0, GROUND, 1]]
    biases = [of.names.index(f"barometer bias of {name}") for name in parameters.barometers]
    if biases:
        yield BIAS, belief.mean[biases]


def problems(plan: Plan) -> Sequence[str]:
    """Problems: several hubs, sensors of the hub, components and nodes that do not match."""
    hubs = [agent.name for agent in plan.agents if isinstance(agent.parameters, AltitudeEkfParameters)]
    if len(hubs) > 1:
        return [f"agents {', '.join(hubs)} are altitude-ekf: a scenario has one, with sensor nodes around it"]
    return [*own_sensors(plan, hubs[0]), *_misfits(plan, hubs[0])]


def _misfits(plan: Plan, hub: str) -> Iterator[str]:
    neighbours, parts = plan.agent(hub).neighbours, dict(parameters_of(plan).components())
    of = parameters_of(plan).filter()
    for name in parts:
        if name.partition(".")[0] not in neighbours:
            yield (
                f"component {name} is of no neighbour of {hub}, whose neighbours are {', '.join(neighbours)}: "
                "name it after the node that sends its measurements"
            )
    for node in neighbours:
        if not isinstance(plan.agent(node).parameters, SensorNodeParameters):
            continue
        measured = {component_name(node, number): widths(plan, node)[sensor] for sensor, number in numbers(plan, node)}
        for name, width in measured.items():
            if name not in parts:
                yield f"what {name} measures would be refused: add a component {name} to {hub}, or remove the sensor"
            elif width is not None and width != of.size(name):
                yield (
                    f"{name} measures {width} values, its component in {hub} takes {of.size(name)}: "
                    "put it under imus, barometers or range_finders as the sensor is"
                )
        for name in parts:
            if name.partition(".")[0] == node and name not in measured:
                yield f"component {name} has no sensor: node {node} has {', '.join(measured) or 'none'}"
