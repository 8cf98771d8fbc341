"""A formation of vehicles from the `world:` mapping of a scenario: `kind: formation`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...topologies import Position, formation
from ..written import at, check_keys, choice, quantity, required
from .air import Gust, Gusts, Random, Scripted, Turbulence
from .camera import Camera
from .formation_world import FormationWorld, headings_to
from .imu import Imu
from .vehicles import Vehicle

Floats = NDArray[np.float64]
_VEHICLE = {
    "mass": "kg",
    "radius": "m",
    "attitude_response": "ns",
    "rate_response": "ns",
    "drag": "/s",
    "tilt": "rad",
    "command_timeout": "ns",
}
_CAMERA = {
    "rate": "Hz",
    "horizontal": "rad",
    "vertical": "rad",
    "range": "m",
    "depth_noise": "m",
    "lateral_noise": "m",
    "orientation_noise": "rad",
}
_IMU = {
    "rate": "Hz",
    "gyro_noise": "rad/s",
    "accelerometer_noise": "m/s²",
    "magnetometer_noise": "",
    "gyro_bias": "rad/s",
    "accelerometer_bias": "m/s²",
    "magnetometer_bias": "",
    "miscalibration": "rad",
    "inclination": "rad",
}
_DELAYS = {"sense_delay": "ns", "act_delay": "ns"}
_RATES = {"steps": "Hz", "truth_rate": "Hz"}
_SECOND_NS = 1e9
_KEYS = (
    "kind",
    "start",
    "altitude",
    "facing",
    "vehicle",
    "camera",
    "imu",
    "turbulence",
    "gusts",
    "ground",
    "undisturbed",
    *_DELAYS,
    *_RATES,
)


def build_formation(
    spec: Mapping[str, Any], _positions: Mapping[str, Position], seed: int, agents: Sequence[str]
) -> FormationWorld:
    """A formation of micro aerial vehicles, one for each agent of the topology.

    `start` is needed: the shape in which they hover in the beginning, as in {triangle: 0.9 m}. All else has defaults.

    Args:
        spec: the mapping, quantities as text with units.
        seed: of the run.
        agents: those of the topology, in natural order.
    Raises:
        BadInput: with the place of the first thing that is wrong, and the remedy.
    """
    check_keys(spec, _KEYS, "world")
    places = formation(required(spec, "start", "world"), len(agents), "world.start")
    places[:, 2] += quantity(spec.get("altitude", "1.5 m"), "m", "world.altitude")
    headings = _headings(spec.get("facing", "next"), agents, places)
    parts: dict[str, Any] = {
        "vehicle": _vehicle(_mapping(spec.get("vehicle", {}), "world.vehicle")),
        "camera": _camera(spec.get("camera", {})),
        "imu": _imu(spec.get("imu", {})),
        "turbulence": _turbulence(_mapping(spec.get("turbulence", {}), "world.turbulence")),
        "gusts": _gusts(spec.get("gusts", [])),
        "ground": _flag(spec, "ground", "world"),
        **{f"{name}_ns": int(value) for name, value in _quantities(spec, _DELAYS, "world").items()},
        **_quantities(spec, _RATES, "world"),
    }
    rows = tuple((x, y, z) for x, y, z in places.tolist())
    with at("world"):
        world = FormationWorld(agents=tuple(agents), places=rows, headings=headings, seed=seed, **parts)
    return world.undisturbed() if _flag(spec, "undisturbed", "world") else world


def _headings(facing: Any, agents: Sequence[str], places: Floats) -> tuple[float, ...]:
    """The next vehicle (the last one the first), the centre, an angle for all, or for some by name another vehicle."""
    following = np.roll(places, -1, axis=0)
    if facing == "centre":
        return headings_to(places, np.broadcast_to(places.mean(axis=0), places.shape))
    if facing == "next":
        return headings_to(places, following)
    if not isinstance(facing, Mapping):
        if isinstance(facing, str) and facing.isalpha():
            raise BadInput(f"world.facing: {facing!r} is not known: use next, centre, an angle, or {{1: 2, …}}")
        return (quantity(facing, "rad", "world.facing"),) * len(agents)
    numbers = {agent: number for number, agent in enumerate(agents)}
    for seer, seen in facing.items():
        for name in (str(seer), str(seen)):
            choice(name, numbers, "world.facing")
        if str(seer) == str(seen):
            raise BadInput(f"world.facing: vehicle {seer} cannot face itself")
        following[numbers[str(seer)]] = places[numbers[str(seen)]]
    return headings_to(places, following)


def _vehicle(spec: Mapping[str, Any]) -> Vehicle:
    place = "world.vehicle"
    check_keys(spec, (*_VEHICLE, "inertia", "thrust_to_weight"), place)
    values = _quantities(spec, _VEHICLE, place)
    for name in ("attitude_response", "rate_response"):
        if name in values:
            values[name] /= _SECOND_NS
    if "thrust_to_weight" in spec:
        values["thrust_to_weight"] = _number(spec["thrust_to_weight"], f"{place}.thrust_to_weight")
    given: dict[str, Any] = dict(values)
    if "command_timeout" in values:
        given["command_timeout_ns"] = int(given.pop("command_timeout"))
    if "inertia" in spec:
        given["inertia"] = _triple(spec["inertia"], "kg m²", f"{place}.inertia")
    with at(place):
        return Vehicle(**given)


def _camera(spec: Any) -> Camera | None:
    if spec == "none":
        return None
    place = "world.camera"
    check_keys(_mapping(spec, place), (*_CAMERA, "misses", "occlusion"), place)
    given: dict[str, Any] = _quantities(spec, _CAMERA, place)
    if "misses" in spec:
        given["misses"] = _number(spec["misses"], f"{place}.misses")
    if "occlusion" in spec:
        given["occlusion"] = _flag(spec, "occlusion", place)
    with at("world"):
        return Camera(**given)


def _imu(spec: Any) -> Imu | None:
    if spec == "none":
        return None
    check_keys(_mapping(spec, "world.imu"), _IMU, "world.imu")
    given = _quantities(spec, _IMU, "world.imu")
    with at("world"):
        return Imu(**given)


def _turbulence(spec: Mapping[str, Any]) -> Turbulence:
    place = "world.turbulence"
    units = {"acceleration": "m/s²", "correlation": "ns", "vertical": ""}
    check_keys(spec, units, place)
    given = _quantities(spec, units, place)
    if "correlation" in given:
        given["correlation"] /= _SECOND_NS
    with at("world"):
        return Turbulence(**given)


def _gusts(spec: Any) -> Gusts:
    """A list of gusts, each with start, duration and acceleration, or how they come at random."""
    place = "world.gusts"
    if isinstance(spec, Mapping):
        check_keys(spec, ("every", "duration", "acceleration"), place)
        every, duration = (
            quantity(required(spec, key, place), "ns", f"{place}.{key}") for key in ("every", "duration")
        )
        strength = quantity(required(spec, "acceleration", place), "m/s²", f"{place}.acceleration")
        with at("world"):
            return Random(int(every), int(duration), strength)
    if not isinstance(spec, Sequence) or isinstance(spec, str):
        raise BadInput(f"{place}: {spec!r} must be a list of gusts, or {{every: …, duration: …, acceleration: …}}")
    return Scripted(
        tuple(_gust(_mapping(one, f"{place}.{index}"), f"{place}.{index}") for index, one in enumerate(spec))
    )


def _gust(spec: Mapping[str, Any], place: str) -> Gust:
    check_keys(spec, ("start", "duration", "acceleration"), place)
    start, duration = (quantity(required(spec, key, place), "ns", f"{place}.{key}") for key in ("start", "duration"))
    acceleration = _triple(required(spec, "acceleration", place), "m/s²", f"{place}.acceleration")
    with at(place):
        return Gust(int(start), int(duration), acceleration)


def _quantities(spec: Mapping[str, Any], units: Mapping[str, str], place: str) -> dict[str, float]:
    """Those of some quantities that are given; a unit of "" is a plain number."""
    return {
        name: quantity(spec[name], unit, f"{place}.{name}") if unit else _number(spec[name], f"{place}.{name}")
        for name, unit in units.items()
        if name in spec
    }


def _triple(value: Any, unit: str, place: str) -> tuple[float, float, float]:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 3:
        raise BadInput(f"{place}: {value!r} must be a list of three quantities in {unit}")
    first, second, third = (quantity(part, unit, f"{place}.{index}") for index, part in enumerate(value))
    return first, second, third


def _number(value: Any, place: str) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    raise BadInput(f"{place}: {value!r} must be a number without a unit")


def _flag(spec: Mapping[str, Any], key: str, place: str) -> bool:
    value = spec.get(key, False)
    if isinstance(value, bool):
        return value
    raise BadInput(f"{place}.{key}: {value!r} must be true or false")


def _mapping(value: Any, place: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise BadInput(f"{place}: {value!r} must be a mapping")
    return value
