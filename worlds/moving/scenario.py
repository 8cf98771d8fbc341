"""Worlds in which agents move, from the `world:` mapping of a scenario."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ...errors import BadInput
from ...topologies import Position, natural_key
from ..written import at, check_keys, quantity, required
from .motions import Circle, Motion, MovingWorld, Paths, RandomWaypoint

_SENSOR = "position"


def build_moving(
    spec: Mapping[str, Any], _positions: Mapping[str, Position], seed: int, agents: Sequence[str]
) -> MovingWorld:
    """A world in which agents move, in one of three ways, and perhaps sense where they are.

    - `random-waypoint: {area: [100 m, 80 m], speed: [1 m/s, 3 m/s], pause: 2 s, count: 12}`
    - `paths: {1: {0 s: [0 m, 0 m], 5 s: [10 m, 0 m]}, 2: …}`
    - `circle: {radius: 20 m, period: 60 s, centre: [0 m, 0 m], count: 8}`
    - `position: {rate: 10 Hz, noise: 0.5 m}`; without it there is no sensor.

    Args:
        spec: the mapping.
        seed: of the run.
        agents: those of the topology; where there are none `count` says how many there are.
    Raises:
        BadInput: with the place of the first thing that is wrong, and the remedy.
    """
    check_keys(spec, ("kind", *_MOTIONS, _SENSOR), "world")
    kinds = [kind for kind in _MOTIONS if kind in spec]
    if len(kinds) != 1:
        raise BadInput(f"world: {' and '.join(kinds) or 'nobody moves'}: write one of {', '.join(_MOTIONS)}")
    place = f"world.{kinds[0]}"
    motion = _MOTIONS[kinds[0]](_mapping(spec[kinds[0]], place), agents, place)
    if agents and set(motion.agents) != set(agents):
        raise BadInput(
            f"{place}: it moves agents {', '.join(motion.agents)}, the topology has {', '.join(agents)}: "
            "make them the same"
        )
    sensor = _mapping(spec.get(_SENSOR, {}), f"world.{_SENSOR}")
    check_keys(sensor, ("rate", "noise"), f"world.{_SENSOR}")
    rate = quantity(sensor.get("rate", "10 Hz"), "Hz", f"world.{_SENSOR}.rate") if _SENSOR in spec else None
    noise = quantity(sensor.get("noise", 0), "m", f"world.{_SENSOR}.noise")
    with at("world"):
        return MovingWorld(motion, seed, rate, noise)


def _random_waypoint(spec: Mapping[str, Any], agents: Sequence[str], place: str) -> RandomWaypoint:
    check_keys(spec, ("area", "speed", "pause", "count"), place)
    names = _names(spec, agents, place)
    area = _point(required(spec, "area", place), f"{place}.area")
    speed = required(spec, "speed", place)
    slowest, fastest = speed if isinstance(speed, list | tuple) and len(speed) == 2 else (speed, speed)
    pause_ns = int(quantity(spec.get("pause", 0), "ns", f"{place}.pause"))
    speeds = quantity(slowest, "m/s", f"{place}.speed"), quantity(fastest, "m/s", f"{place}.speed")
    with at(place):
        return RandomWaypoint(names, area, *speeds, pause_ns)


def _paths(spec: Mapping[str, Any], _agents: Sequence[str], place: str) -> Paths:
    points = {}
    for agent in sorted(spec, key=natural_key):
        within = f"{place}.{agent}"
        listed = _mapping(spec[agent], within).items()
        points[agent] = tuple(sorted((int(quantity(time, "ns", within)), _point(at_, within)) for time, at_ in listed))
    with at(place):
        return Paths(points)


def _circle(spec: Mapping[str, Any], agents: Sequence[str], place: str) -> Circle:
    check_keys(spec, ("radius", "period", "centre", "count"), place)
    names = _names(spec, agents, place)
    radius = quantity(required(spec, "radius", place), "m", f"{place}.radius")
    period_ns = int(quantity(required(spec, "period", place), "ns", f"{place}.period"))
    centre = _point(spec.get("centre", [0, 0]), f"{place}.centre")
    with at(place):
        return Circle(names, radius, period_ns, centre)


_MOTIONS: Mapping[str, Callable[[Mapping[str, Any], Sequence[str], str], Motion]] = {
    "random-waypoint": _random_waypoint,
    "paths": _paths,
    "circle": _circle,
}


def _names(spec: Mapping[str, Any], agents: Sequence[str], place: str) -> tuple[str, ...]:
    if "count" not in spec:
        if not agents:
            raise BadInput(f"{place}: count is missing: the topology does not say how many agents there are")
        return tuple(agents)
    count = spec["count"]
    if not isinstance(count, int) or isinstance(count, bool) or count < 1:
        raise BadInput(f"{place}.count: {count!r} is not a whole number from 1 on")
    return tuple(str(number) for number in range(1, count + 1))


def _mapping(value: Any, place: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise BadInput(f"{place}: {value!r} must be a mapping")
    return value


def _point(value: Any, place: str) -> Position:
    """Lengths with a unit, or numbers in metres."""
    if not isinstance(value, list | tuple) or len(value) not in {2, 3}:
        raise BadInput(f"{place}: {value!r} is no place: write 2 or 3 lengths, as in [10 m, 0 m]")
    numbers = (f"{part} m" if isinstance(part, int | float) and not isinstance(part, bool) else part for part in value)
    return tuple(quantity(part, "m", place) for part in numbers)
