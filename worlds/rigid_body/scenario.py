"""A rigid body with measurement units from the `world:` mapping of a scenario: `kind: rigid-body`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...errors import BadInput
from ...rotations import euler_to_quaternion
from ...topologies import Position, natural_key
from ..written import at, check_keys, quantity, required
from ..written_signals import signal
from .body import RigidBody, Triple
from .measurement_units import MeasurementUnit, RigidBodyWorld

_KEYS = ("kind", "inertia", "attitude", "rates", "torque", "rate", "units")
_UNIT_KEYS = ("mounting", "noise", "sensors")
_INERTIA = ("0.02 kg m²", "0.03 kg m²", "0.04 kg m²")
_LEVEL = (0, 0, 0)


def build_rigid_body(
    spec: Mapping[str, Any], _positions: Mapping[str, Position], seed: int, agents: Sequence[str]
) -> RigidBodyWorld:
    """A body that turns, with measurement units on it.

    - `inertia: [0.02 kg m², 0.03 kg m², 0.04 kg m²]`: principal moments, these unless given
    - `attitude: [30 deg, 30 deg, 0]`: roll, pitch and yaw at the beginning, level unless given
    - `rates: [0, 0, 1 deg/s]`: about the body's axes at the beginning, at rest unless given
    - `torque: [0, 0, {sine: {amplitude: 1 mN m, frequency: 0.1 Hz}}]`: signals of time, none unless given
    - `rate: 10 Hz`: of all sensors
    - `units: {1: {mounting: [135 deg, 0, 0], noise: 0.02 rad, sensors: [accelerometer, magnetometer]}}`: needed; a
      mounting is aligned with the body, noise 0 and the sensors both unless given

    Args:
        spec: the mapping.
        seed: of the run.
        agents: those of the topology.
    Raises:
        BadInput: with the place of the first thing that is wrong, and the remedy.
    """
    check_keys(spec, _KEYS, "world")
    units = {str(agent): _unit(unit, f"world.units.{agent}") for agent, unit in _units(spec).items()}
    for agent in units:
        if agent not in agents:
            raise BadInput(f"world.units: there is no agent {agent!r}: the topology has {', '.join(agents)}")
    x, y, z = _three(spec.get("torque", _LEVEL), "world.torque")
    torque = signal(x, "N m", "world.torque.0"), signal(y, "N m", "world.torque.1"), signal(z, "N m", "world.torque.2")
    inertia = _quantities(spec.get("inertia", _INERTIA), "kg m²", "world.inertia")
    w, i, j, k = euler_to_quaternion(*_quantities(spec.get("attitude", _LEVEL), "rad", "world.attitude")).tolist()
    rates = _quantities(spec.get("rates", _LEVEL), "rad/s", "world.rates")
    rate = quantity(spec.get("rate", "10 Hz"), "Hz", "world.rate")
    with at("world"):
        return RigidBodyWorld(
            RigidBody(inertia, (w, i, j, k), rates, torque),
            {agent: units[agent] for agent in sorted(units, key=natural_key)},
            seed,
            rate,
        )


def _units(spec: Mapping[str, Any]) -> Mapping[Any, Any]:
    units = required(spec, "units", "world")
    if not isinstance(units, Mapping):
        raise BadInput(f"world.units: {units!r} must be a mapping, as in {{1: {{noise: 0.02 rad}}}}")
    return units


def _unit(spec: Any, place: str) -> MeasurementUnit:
    if not isinstance(spec, Mapping):
        raise BadInput(f"{place}: {spec!r} must be a mapping, as in {{noise: 0.02 rad}}")
    check_keys(spec, _UNIT_KEYS, place)
    mounting = _quantities(spec.get("mounting", _LEVEL), "rad", f"{place}.mounting")
    noise = quantity(spec.get("noise", 0), "rad", f"{place}.noise")
    sensors = spec.get("sensors", MeasurementUnit.sensors)
    if isinstance(sensors, str) or not isinstance(sensors, Sequence):
        raise BadInput(f"{place}.sensors: {sensors!r} must be a list, as in [accelerometer]")
    with at(place):
        return MeasurementUnit(mounting, noise, tuple(map(str, sensors)))


def _quantities(values: Any, unit: str, place: str) -> Triple:
    x, y, z = (quantity(value, unit, f"{place}.{axis}") for axis, value in enumerate(_three(values, place)))
    return x, y, z


def _three(values: Any, place: str) -> Sequence[Any]:
    if isinstance(values, str) or not isinstance(values, Sequence) or len(values) != 3:
        raise BadInput(f"{place}: {values!r} must be a list of three, one for each axis")
    return values
