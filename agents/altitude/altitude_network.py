"""The star around the agent that estimates the altitude: whether it fits together, its oracle, truth and findings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...estimators.altitude.modular_filter import GROUND, Belief, ModularFilter
from ...estimators.altitude.replay import Stamped
from ...units import first_period, period_ns
from ...worlds.altitude.altitude_world import AltitudeWorld
from ..agent import Finding, RunData
from ..plan import Plan
from ..plan_identity import PlanIdentity
from ..sensor_node import SensorNodeParameters, numbers, own_sensors, widths
from .altitude_ekf_settings import AltitudeEkfParameters

ALTITUDE, BIAS, COUNTS, DEVIATION = "altitude", "barometer bias", "measurements", "altitude deviation"
OUTCOMES = ("in order", "replayed", "repeated", "too old", "ahead", "refused")
"""What can become of a measurement; one that is ahead of the own clock is used too, as if it were of now."""
JUMPS = "jumps of the ground"
_CM = 100.0


def component_name(node: str, sensor: int) -> str:
    """The name of the component for a sensor of a node."""
    return f"{node}.{sensor}" if sensor else node


def parameters_of(plan: Plan) -> AltitudeEkfParameters:
    """Of the one agent of this kind."""
    parameters = (agent.parameters for agent in plan.agents)
    return next(each for each in parameters if isinstance(each, AltitudeEkfParameters))


def reported(
    parameters: AltitudeEkfParameters, of: ModularFilter, belief: Belief
) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """The quantities that are reported of a belief, and their values."""
    yield ALTITUDE, belief.mean[[0, GROUND, 1]]
    biases = [of.names.index(f"barometer bias of {name}") for name in parameters.barometers]
    if biases:
        yield BIAS, belief.mean[biases]


def problems(plan: Plan) -> Sequence[str]:
    """Several hubs, own sensors, components without a node, nodes without one or with another number of values."""
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


def oracle(plan: Plan, quantity: str, index: int) -> NDArray[np.float64] | None:
    """What the same filter says that has every measurement at the instant at which it was taken."""
    return _courses(PlanIdentity(plan)).get(quantity, {}).get(index)


@lru_cache(maxsize=2)
def _courses(same: PlanIdentity) -> dict[str, dict[int, NDArray[np.float64]]]:
    """Quantity → index → what the filter says at that estimate's instant, with all that was measured until then."""
    plan, parameters = same.plan, parameters_of(same.plan)
    of = parameters.filter()
    belief = of.start()
    courses: dict[str, dict[int, NDArray[np.float64]]] = {ALTITUDE: {}, BIAS: {}}
    index = 0
    for measurement in [*measured(plan, of.sensors), None]:
        until_ns = plan.duration_ns if measurement is None else measurement.time_ns
        while (time_ns := period_ns(parameters.rate, index)) < until_ns:
            for quantity, value in reported(parameters, of, of.predict(belief, time_ns)):
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


def truth(plan: Plan, quantity: str, time_ns: int) -> NDArray[np.float64] | None:
    """Height of the vehicle and of the ground and climb rate, or the biases of the barometers, at an instant."""
    world = plan.world
    if not isinstance(world, AltitudeWorld) or quantity not in (ALTITUDE, BIAS):
        return None
    if quantity == ALTITUDE:
        return world.truth(time_ns)
    biases = [world.bias(name, time_ns) for name in parameters_of(plan).barometers]
    return np.array([np.nan if bias is None else bias for bias in biases])


def findings(plan: Plan, run: RunData) -> Iterator[Finding]:
    """Mean errors of altitude and ground, how often the altitude is as near as the filter believes, and the counts."""
    if ALTITUDE not in run.quantities():
        return
    ((hub, said),) = run.estimates(ALTITUDE).items()
    if isinstance(plan.world, AltitudeWorld):
        true = np.array([plan.world.truth(time_ns) for time_ns in said.time_ns.tolist()])
        altitude, ground = _CM * np.abs(said.value - true).T[:2]
        yield Finding("mean error of the altitude", float(altitude.mean()), "cm", f"largest {altitude.max():.1f} cm")
        for over, where in ((true[:, 1] > 0.0, "obstacles"), (true[:, 1] == 0.0, "the floor")):
            if over.any():
                yield Finding(f"mean error of the altitude over {where}", float(altitude[over].mean()), "cm")
        yield Finding("mean error of the ground", float(ground.mean()), "cm")
        believed = _CM * run.estimates(DEVIATION)[hub].value[:, 0]
        text = "of the time; a consistent Gaussian filter has 95 %"
        yield Finding("altitude within two deviations", 100 * float((altitude < 2 * believed).mean()), "%", text)
    counts = run.estimates(COUNTS)[hub].value[-1].tolist()
    named = (f"{int(count):,} {name}" for name, count in zip((*OUTCOMES, JUMPS), counts, strict=True))
    yield Finding("measurements at the hub", text=", ".join(named))
