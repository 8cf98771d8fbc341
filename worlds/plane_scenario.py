"""A plane from the `world:` mapping of a scenario: `kind: plane`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..errors import BadInput
from ..topologies import Position
from .plane import PlaneWorld
from .sensors import DistanceSensor, GaussianDistance, Infrared
from .signals import Constant, Signal, Sine, Steps
from .written import at, check_keys, choice, quantity, required

_KEYS = ("kind", "altitude", "roll", "pitch", "rate", "distance_noise", "sensor")
_SINE = ("mean", "amplitude", "frequency", "phase")


def build_plane(
    spec: Mapping[str, Any], positions: Mapping[str, Position], seed: int, _agents: Sequence[str] = ()
) -> PlaneWorld:
    """A rigid body over a plane.

    `altitude` is needed; `roll` and `pitch` default to 0, `rate` to 20 Hz. The sensor is Gaussian with
    `distance_noise`, by default 5 mm, or `sensor: {infrared: {noise: 10 mV}}`. A signal is a quantity, or
    `{steps: {"0 s": …, "5 s": …}}`, or `{sine: {mean: …, amplitude: …, frequency: …, phase: …}}`.

    Args:
        spec: the mapping, quantities as text with units.
        positions: agent → (r_X, r_Y) [m].
        seed: of the run.
    Raises:
        BadInput: with the place of the first thing that is wrong, and the remedy.
    """
    check_keys(spec, _KEYS, "world")
    altitude = _signal(required(spec, "altitude", "world"), "m", "world.altitude")
    roll = _signal(spec.get("roll", 0), "rad", "world.roll")
    pitch = _signal(spec.get("pitch", 0), "rad", "world.pitch")
    sensor = _sensor(spec)
    rate = quantity(spec.get("rate", "20 Hz"), "Hz", "world.rate")
    with at("world"):
        return PlaneWorld(altitude, roll, pitch, dict(positions), sensor, seed, rate)


def _signal(spec: Any, unit: str, place: str) -> Signal:
    if not isinstance(spec, Mapping):
        return Constant(quantity(spec, unit, place))
    if len(spec) != 1:
        raise BadInput(f"{place}: write a quantity, or one of steps and sine")
    kind, content = next(iter(spec.items()))
    choice(kind, ("steps", "sine"), place)
    within = f"{place}.{kind}"
    if not isinstance(content, Mapping):
        raise BadInput(f"{within}: {content!r} must be a mapping")
    return _steps(content, unit, within) if kind == "steps" else _sine(content, unit, within)


def _steps(spec: Mapping[Any, Any], unit: str, place: str) -> Steps:
    steps = sorted((int(quantity(time, "ns", place)), quantity(level, unit, place)) for time, level in spec.items())
    with at(place):
        return Steps(tuple(time for time, _ in steps), tuple(level for _, level in steps))


def _sine(spec: Mapping[str, Any], unit: str, place: str) -> Sine:
    check_keys(spec, _SINE, place)
    mean = quantity(spec.get("mean", 0), unit, f"{place}.mean")
    amplitude = quantity(required(spec, "amplitude", place), unit, f"{place}.amplitude")
    frequency = quantity(required(spec, "frequency", place), "Hz", f"{place}.frequency")
    phase = quantity(spec.get("phase", 0), "rad", f"{place}.phase")
    with at(place):
        return Sine(mean, amplitude, frequency, phase)


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
