"""Signals of time as a scenario writes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ..errors import BadInput
from .signals import Constant, Ramp, Signal, Sine, Steps
from .written import at, check_keys, choice, quantity, required

_RAMP = ("from", "to", "at", "over")
_SINE = ("mean", "amplitude", "frequency", "phase")


def signal(spec: Any, unit: str, place: str) -> Signal:
    """A signal whose values have a unit.

    It is a quantity, `{steps: {"0 s": …, "5 s": …}}`, `{ramp: {from: …, to: …, at: 5 s, over: 1 s}}`, or
    `{sine: {mean: …, amplitude: …, frequency: …, phase: …}}`.

    Raises:
        BadInput: with the place of the first thing that is wrong.
    """
    if not isinstance(spec, Mapping):
        return Constant(quantity(spec, unit, place))
    if len(spec) != 1:
        raise BadInput(f"{place}: write a quantity, or one of {', '.join(_READERS)}")
    kind, content = next(iter(spec.items()))
    choice(kind, _READERS, place)
    within = f"{place}.{kind}"
    if not isinstance(content, Mapping):
        raise BadInput(f"{within}: {content!r} must be a mapping")
    return _READERS[kind](content, unit, within)


def _steps(spec: Mapping[Any, Any], unit: str, place: str) -> Steps:
    steps = sorted((int(quantity(time, "ns", place)), quantity(level, unit, place)) for time, level in spec.items())
    with at(place):
        return Steps(tuple(time for time, _ in steps), tuple(level for _, level in steps))


def _ramp(spec: Mapping[str, Any], unit: str, place: str) -> Ramp:
    check_keys(spec, _RAMP, place)
    first, last = (quantity(required(spec, end, place), unit, f"{place}.{end}") for end in ("from", "to"))
    begin, over = (int(quantity(required(spec, time, place), "ns", f"{place}.{time}")) for time in ("at", "over"))
    with at(place):
        return Ramp(first, last, begin, over)


def _sine(spec: Mapping[str, Any], unit: str, place: str) -> Sine:
    check_keys(spec, _SINE, place)
    mean = quantity(spec.get("mean", 0), unit, f"{place}.mean")
    amplitude = quantity(required(spec, "amplitude", place), unit, f"{place}.amplitude")
    frequency = quantity(required(spec, "frequency", place), "Hz", f"{place}.frequency")
    phase = quantity(spec.get("phase", 0), "rad", f"{place}.phase")
    with at(place):
        return Sine(mean, amplitude, frequency, phase)


_Reader = Callable[[Mapping[str, Any], str, str], Signal]
_READERS: Mapping[str, _Reader] = {
    "steps": _steps,
    "ramp": _ramp,
    "sine": _sine,
}
