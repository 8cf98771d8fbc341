"""A vehicle over a room from the `world:` mapping of a scenario: `kind: altitude`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...errors import BadInput
from ...topologies import Position
from ..written import at, check_keys, choice, quantity, required
from .altitude_sensors import AltitudeSensor, BarometerSensor, ImuSensor, RangeSensor
from .altitude_world import AltitudeWorld
from .room import Obstacle, Room
from .tour import Tour

_FLIGHT = {
    "altitude": "m",
    "speed": "m/s",
    "wait": "ns",
    "take_off": "ns",
    "landing": "ns",
    "drop": "m",
    "sway": "m",
    "sway_period": "ns",
}
_OBSTACLES: Mapping[str, Mapping[str, Any]] = {
    "table": {"size": (1.2, 0.8), "height": 0.75},
    "chair": {"size": (0.5, 0.5), "height": 0.45, "roughness": 0.1, "uneven": True},
    "platform": {"size": (1.4, 1.4), "height": 0.47},
}
_SENSORS: Mapping[str, tuple[type[Any], Mapping[str, str]]] = {
    "imu": (
        ImuSensor,
        {
            "rate": "Hz",
            "acceleration_noise": "m/s²",
            "attitude_noise": "rad",
            "gyro_noise": "rad/s",
            "bias": "m/s²",
            "bias_walk": "m/s²/√s",
            "saturation": "m/s²",
        },
    ),
    "barometer": (
        BarometerSensor,
        {"rate": "Hz", "noise": "m", "bias": "m", "bias_walk": "m/√s", "shift": "m", "resolution": "m"},
    ),
    "range": (RangeSensor, {"rate": "Hz", "noise": "m", "resolution": "m", "farthest": "m"}),
}


def build_altitude(
    spec: Mapping[str, Any], _positions: Mapping[str, Position], seed: int, agents: Sequence[str]
) -> AltitudeWorld:
    """A vehicle that flies over a room, with its sensors on agents.

    - `flight: {waypoints: [[0 m, 0 m], [4 m, 0 m]], altitude: 1.4 m, speed: 0.5 m/s, …}`
    - `obstacles: [{table: {centre: [2 m, 0 m]}}, {chair: …}, {platform: …}]`, each perhaps with size and height
    - `sensors: {NAME: imu, OTHER: {barometer: {bias: 35 cm}}, …}`: agent → its sensor

    Args:
        spec: the mapping, quantities as text with units.
        seed: of the run.
        agents: those of the topology.
    Raises:
        BadInput: with the place of the first thing that is wrong, and the remedy.
    """
    check_keys(spec, ("kind", "flight", "obstacles", "sensors"), "world")
    listed = spec.get("obstacles", ())
    if not isinstance(listed, list | tuple):
        raise BadInput(f"world.obstacles: {listed!r} must be a list, as in [{{table: {{centre: [2 m, 0 m]}}}}]")
    obstacles = tuple(_obstacle(item, f"world.obstacles.{number}") for number, item in enumerate(listed))
    room = Room(obstacles, seed)
    flight = _flight(_mapping(required(spec, "flight", "world"), "world.flight"), room)
    carried = _mapping(required(spec, "sensors", "world"), "world.sensors")
    _check_agents(carried, agents)
    sensors = tuple((str(agent), _sensor(item, f"world.sensors.{agent}")) for agent, item in carried.items())
    with at("world"):
        return AltitudeWorld(flight, room, sensors, seed)


def _check_agents(carried: Mapping[Any, Any], agents: Sequence[str]) -> None:
    """Refuse sensors of somebody who is not there."""
    for agent in carried:
        choice(str(agent), agents, "world.sensors")


def _flight(spec: Mapping[str, Any], room: Room) -> Tour:
    place = "world.flight"
    check_keys(spec, ("waypoints", *_FLIGHT), place)
    listed = required(spec, "waypoints", place)
    if not isinstance(listed, list | tuple) or not listed:
        raise BadInput(f"{place}.waypoints: {listed!r} must be a list of points, as in [[0 m, 0 m], [4 m, 0 m]]")
    waypoints = tuple(_pair(point, f"{place}.waypoints.{number}") for number, point in enumerate(listed))
    fields = {name: quantity(spec[name], unit, f"{place}.{name}") for name, unit in _FLIGHT.items() if name in spec}
    fields = {name: value / 1e9 if _FLIGHT[name] == "ns" else value for name, value in fields.items()}
    ground = room.surface(*waypoints[0])[0], room.surface(*waypoints[-1])[0]
    with at(place):
        return Tour(waypoints, ground, **fields)


def _obstacle(item: object, place: str) -> Obstacle:
    kind, content = _named(item, tuple(_OBSTACLES), place)
    within = f"{place}.{kind}"
    check_keys(content, ("centre", "size", "height", "roughness"), within)
    fields: dict[str, Any] = {"centre": _pair(required(content, "centre", within), f"{within}.centre")}
    if "size" in content:
        fields["size"] = _pair(content["size"], f"{within}.size")
    for name in ("height", "roughness"):
        if name in content:
            fields[name] = quantity(content[name], "m", f"{within}.{name}")
    with at(within):
        return Obstacle(**{**_OBSTACLES[kind], **fields})


def _sensor(item: object, place: str) -> AltitudeSensor:
    kind, content = _named({item: {}} if isinstance(item, str) else item, tuple(_SENSORS), place)
    make, units = _SENSORS[kind]
    within = f"{place}.{kind}"
    check_keys(content, units, within)
    fields = {name: quantity(value, units[name], f"{within}.{name}") for name, value in content.items()}
    with at(within):
        sensor: AltitudeSensor = make(**fields)
    return sensor


def _named(item: object, kinds: Sequence[str], place: str) -> tuple[str, Mapping[str, Any]]:
    """The one key of a mapping, and what stands under it."""
    if not isinstance(item, Mapping) or len(item) != 1:
        raise BadInput(f"{place}: {item!r} must name one of {', '.join(kinds)}, as in {{{kinds[0]}: {{…}}}}")
    kind, content = next(iter(item.items()))
    choice(kind, kinds, place)
    return str(kind), _mapping(content, f"{place}.{kind}")


def _mapping(value: object, place: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise BadInput(f"{place}: {value!r} must be a mapping")
    return value


def _pair(value: object, place: str) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise BadInput(f"{place}: {value!r} must be two lengths, as in [1 m, 2 m]")
    return quantity(value[0], "m", place), quantity(value[1], "m", place)
