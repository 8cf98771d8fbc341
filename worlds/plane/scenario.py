"""A plane from the `world:` mapping of a scenario: `kind: plane`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...errors import BadInput
from ...topologies import Position
from ..written import at, check_keys, choice, quantity, required
from ..written_signals import signal
from .distance_sensors import DistanceSensor, GaussianDistance, Infrared
from .plane_world import PlaneWorld

_KEYS = ("kind", "altitude", "roll", "pitch", "rate", "distance_noise", "sensor", "gyroscope")


def build_plane(
    spec: Mapping[str, Any], positions: Mapping[str, Position], seed: int, _agents: Sequence[str] = ()
) -> PlaneWorld:
    """A rigid body over a plane.

    `altitude` is needed; `roll` and `pitch` default to 0, `rate` to 20 Hz. The sensor is Gaussian with
    `distance_noise`, by default 5 mm, or `sensor: {infrared: {noise: 10 mV}}`. For signals see `written_signals`.
    `gyroscope: {noise: 1 deg/s}` gives every module rate gyros too, none unless given.

    Args:
        spec: the mapping, quantities as text with units.
        positions: agent → (r_X, r_Y) [m].
        seed: of the run.
    Raises:
        BadInput: with the place of the first thing that is wrong, and the remedy.
    """
    check_keys(spec, _KEYS, "world")
    altitude = signal(required(spec, "altitude", "world"), "m", "world.altitude")
    roll = signal(spec.get("roll", 0), "rad", "world.roll")
    pitch = signal(spec.get("pitch", 0), "rad", "world.pitch")
    sensor = _sensor(spec)
    rate = quantity(spec.get("rate", "20 Hz"), "Hz", "world.rate")
    gyroscope = _gyroscope(spec)
    with at("world"):
        return PlaneWorld(altitude, roll, pitch, dict(positions), sensor, seed, rate, gyroscope)


def _gyroscope(spec: Mapping[str, Any]) -> float | None:
    if "gyroscope" not in spec:
        return None
    written = spec["gyroscope"]
    if not isinstance(written, Mapping):
        raise BadInput(f"world.gyroscope: {written!r} must be a mapping, as in {{noise: 1 deg/s}}")
    check_keys(written, ("noise",), "world.gyroscope")
    return quantity(required(written, "noise", "world.gyroscope"), "rad/s", "world.gyroscope.noise")


def _sensor(spec: Mapping[str, Any]) -> DistanceSensor:
    if "sensor" not in spec:
        noise = quantity(spec.get("distance_noise", "5 mm"), "m", "world.distance_noise")
        with at("world.distance_noise"):
            return GaussianDistance(noise)
    if "distance_noise" in spec:
        raise BadInput("world: give either distance_noise or sensor, not both")
    sensor = spec["sensor"]
    if not isinstance(sensor, Mapping) or len(sensor) != 1:
        raise BadInput(f"world.sensor: {sensor!r} must name one sensor, as in {{infrared: {{noise: 10 mV}}}}")
    kind, content = next(iter(sensor.items()))
    choice(kind, ("infrared",), "world.sensor")
    if not isinstance(content, Mapping):
        raise BadInput(f"world.sensor.infrared: {content!r} must be a mapping, as in {{noise: 10 mV}}")
    check_keys(content, ("noise",), "world.sensor.infrared")
    noise = quantity(required(content, "noise", "world.sensor.infrared"), "V", "world.sensor.infrared.noise")
    with at("world.sensor.infrared"):
        return Infrared(noise)
