"""Worlds from the `world:` mapping of a scenario."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any

from ..errors import BadInput
from ..topologies import Position
from ..units import Unit
from .plane import PlaneWorld
from .sensors import DistanceSensor, GaussianDistance, Infrared
from .signals import Constant, Signal, Sine, Steps

_KINDS = ("plane",)
_KEYS = ("kind", "altitude", "roll", "pitch", "rate", "distance_noise", "sensor")
_SINE = ("mean", "amplitude", "frequency", "phase")


def build(spec: Mapping[str, Any], positions: Mapping[str, Position], seed: int) -> PlaneWorld:
    """The world that a scenario asks for.

    `kind` is plane; `altitude` is needed; `roll` and `pitch` default to 0, `rate` to 20 Hz. The sensor is Gaussian with
    `distance_noise`, by default 5 mm, or `sensor: {infrared: {noise: 10 mV}}`. A signal is a quantity, or
    `{steps: {"0 s": …, "5 s": …}}`, or `{sine: {mean: …, amplitude: …, frequency: …, phase: …}}`.

    Args:
        spec: the mapping, quantities as text with units.
        positions: agent → (r_X, r_Y) [m].
        seed: of the run.
    Raises:
        BadInput: with the place of the first thing that is wrong, and the remedy.
    """
    _check_keys(spec, _KEYS, "world")
    _choice(_required(spec, "kind", "world"), _KINDS, "world.kind")
    altitude = _signal(_required(spec, "altitude", "world"), "m", "world.altitude")
    roll = _signal(spec.get("roll", 0), "rad", "world.roll")
    pitch = _signal(spec.get("pitch", 0), "rad", "world.pitch")
    sensor = _sensor(spec)
    rate = _quantity(spec.get("rate", "20 Hz"), "Hz", "world.rate")
    with _at("world"):
        return PlaneWorld(altitude, roll, pitch, dict(positions), sensor, seed, rate)


def _signal(spec: Any, unit: str, place: str) -> Signal:
    if not isinstance(spec, Mapping):
        return Constant(_quantity(spec, unit, place))
    if len(spec) != 1:
        raise BadInput(f"{place}: write a quantity, or one of steps and sine")
    kind, content = next(iter(spec.items()))
    _choice(kind, ("steps", "sine"), place)
    within = f"{place}.{kind}"
    if not isinstance(content, Mapping):
        raise BadInput(f"{within}: {content!r} must be a mapping")
    return _steps(content, unit, within) if kind == "steps" else _sine(content, unit, within)


def _steps(spec: Mapping[Any, Any], unit: str, place: str) -> Steps:
    steps = sorted((int(_quantity(time, "ns", place)), _quantity(level, unit, place)) for time, level in spec.items())
    with _at(place):
        return Steps(tuple(time for time, _ in steps), tuple(level for _, level in steps))


def _sine(spec: Mapping[str, Any], unit: str, place: str) -> Sine:
    _check_keys(spec, _SINE, place)
    mean = _quantity(spec.get("mean", 0), unit, f"{place}.mean")
    amplitude = _quantity(_required(spec, "amplitude", place), unit, f"{place}.amplitude")
    frequency = _quantity(_required(spec, "frequency", place), "Hz", f"{place}.frequency")
    phase = _quantity(spec.get("phase", 0), "rad", f"{place}.phase")
    with _at(place):
        return Sine(mean, amplitude, frequency, phase)


def _sensor(spec: Mapping[str, Any]) -> DistanceSensor:
    if "sensor" not in spec:
        noise = _quantity(spec.get("distance_noise", "5 mm"), "m", "world.distance_noise")
        with _at("world.distance_noise"):
            return GaussianDistance(noise)
    if "distance_noise" in spec:
        raise BadInput("world: give either distance_noise or sensor, not both")
    sensor = spec["sensor"]
    if not isinstance(sensor, Mapping) or len(sensor) != 1:
        raise BadInput(f"world.sensor: {sensor!r} must name one sensor, as in {{infrared: {{noise: 10 mV}}}}")
    kind, content = next(iter(sensor.items()))
    _choice(kind, ("infrared",), "world.sensor")
    if not isinstance(content, Mapping):
        raise BadInput(f"world.sensor.infrared: {content!r} must be a mapping, as in {{noise: 10 mV}}")
    _check_keys(content, ("noise",), "world.sensor.infrared")
    noise = _quantity(_required(content, "noise", "world.sensor.infrared"), "V", "world.sensor.infrared.noise")
    with _at("world.sensor.infrared"):
        return Infrared(noise)


def _quantity(value: object, unit: str, place: str) -> float:
    with _at(place):
        number = Unit(unit).read(value)
    if not math.isfinite(number):
        raise BadInput(f"{place}: {value!r} is not finite")
    return number


@contextmanager
def _at(place: str) -> Iterator[None]:
    """Put the place before the message of what is refused inside."""
    try:
        yield
    except BadInput as error:
        raise BadInput(f"{place}: {error}") from None


def _required(spec: Mapping[str, Any], key: str, place: str) -> Any:
    if key not in spec:
        raise BadInput(f"{place}: {key} is missing")
    return spec[key]


def _check_keys(spec: Mapping[str, Any], known: Collection[str], place: str) -> None:
    for key in spec:
        _choice(key, known, place)


def _choice(word: object, known: Collection[str], place: str) -> None:
    if word not in known:
        close = get_close_matches(str(word), known, n=1)
        hint = f"did you mean {close[0]}?" if close else f"use {', '.join(known)}"
        raise BadInput(f"{place}: {word!r} is not known: {hint}")
