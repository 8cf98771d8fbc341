"""What a sweep goes over: ranges of a scenario's fields as they are written, and the cells that they span.

0:0.8:0.1              from, to and step, both ends included
lin(1 ms, 9 ms, 5)     so many values at equal distances, ends included; log(…) at equal ratios
a, b, {ring: 8}        a list of values as in a scenario, or of ranges
0:0.8   log(1, 100)    without step or count: any value in between, for random sweeps
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import product
from typing import Any

from ...errors import BadInput
from ...randomness import Stream, stream

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*([^\s\d:,()][^:,()]*?)?\s*")
_SPACE = re.compile(r"\s*(lin|log)\((.*)\)\s*", re.DOTALL)
_OPEN, _CLOSED = "([{", ")]}"
_DIGITS = 6
"""Significant digits of values that are no round numbers by themselves."""
_MOST_VALUES = 100_000
_TRIES = 20
"""Draws for each cell that is asked for, before there are held to be no more."""


@dataclass(frozen=True)
class Point:
    """One value of an axis: how it is called, and what it sets, as `KEY=VALUE`."""

    label: str
    overrides: tuple[str, ...]


@dataclass(frozen=True)
class Between:
    """Any value between two, evenly or, with `log`, evenly in its logarithm; `unit` as in "ms"."""

    low: float
    high: float
    unit: str
    log: bool

    def at(self, part: float) -> str:
        """The value at a part of the way, from 0 to 1, as it is written."""
        ratio, span = self.high / self.low if self.log else 1.0, self.high - self.low
        value = self.low * ratio**part if self.log else self.low + part * span
        return _written(value, self.unit)


@dataclass(frozen=True)
class Axis:
    """What is varied together: its name, and its points; or, for random sweeps, what its values lie between."""

    name: str
    points: tuple[Point, ...] = ()
    between: Between | None = None

    @property
    def numbers(self) -> tuple[list[float], str] | None:
        """The values and their unit, where all are quantities in one unit."""
        matches = [_QUANTITY.fullmatch(point.label) for point in self.points]
        units = {match[2] or "" for match in matches if match}
        if not all(matches) or len(units) != 1:
            return None
        return [float(match[1]) for match in matches if match], units.pop()

    def draw(self, draws: Stream, index: int) -> Point:
        """A random point: the index-th draw."""
        part = draws.uniform(index)
        if self.between is None:
            return self.points[int(part * len(self.points))]
        value = self.between.at(part)
        return Point(value, (f"{self.name}={value}",))


@dataclass(frozen=True)
class Cell:
    """One combination: a point of each axis."""

    points: tuple[Point, ...]

    @property
    def overrides(self) -> tuple[str, ...]:
        """What it sets."""
        return tuple(override for point in self.points for override in point.overrides)


Over = Mapping[str, str | Sequence[Any] | Mapping[str, Sequence[str]]]
"""Name → a range as text, values, or named points with what each sets, as {"plain": ["agents.rounds=3"], …}."""


def axis_of(word: str) -> Axis:
    """The axis of `KEY=RANGE`.

    Raises:
        BadInput: no such range, or an empty one.
    """
    key, equals, text = word.partition("=")
    if not equals or not key.strip():
        raise BadInput(f"--over {word}: write KEY=RANGE, for example links.loss.bernoulli=0:0.8:0.1")
    return read_axis(key.strip(), text)


def read_axis(name: str, written: str | Sequence[Any] | Mapping[str, Sequence[str]]) -> Axis:
    """The axis of a range as text, of values, or of named points.

    Raises:
        BadInput: no such range, an empty one, or a value twice.
    """
    if name == "seed":
        raise BadInput("--over seed: seeds are what repetitions vary, the same in all cells: use --repeat")
    if isinstance(written, Mapping):
        points = [Point(str(label), tuple(overrides)) for label, overrides in written.items()]
    elif isinstance(written, str):
        try:
            values = _values(written)
        except BadInput as error:
            raise BadInput(f"--over {name}={written}: {error}") from error
        if isinstance(values, Between):
            return Axis(name, between=values)
        points = [Point(value, (f"{name}={value}",)) for value in values]
    else:
        points = [Point(_text(value), (f"{name}={_text(value)}",)) for value in written]
    if not points:
        raise BadInput(f"--over {name}={written}: the range is empty")
    labels = [point.label for point in points]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice is not None:
        raise BadInput(f"--over {name}: the value {twice} occurs twice")
    return Axis(name, tuple(points))


def _text(value: Any) -> str:
    """A value of Python as YAML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_text(item) for item in value) + "]"
    return "null" if value is None else str(value)


def _values(text: str) -> list[str] | Between:
    items = [item for item in _split(text) if item]
    if len(items) == 1 and isinstance(only := _item(items[0]), Between):
        return only
    found: list[str] = []
    for item in items:
        values = _item(item)
        if isinstance(values, Between):
            raise BadInput(f"{item} has no step, which is for random sweeps, where it stands alone")
        found += values
    return found


def _split(text: str) -> list[str]:
    """The parts between commas that stand in no bracket."""
    parts, depth, start = [], 0, 0
    for place, sign in enumerate(text):
        depth += (sign in _OPEN) - (sign in _CLOSED)
        if sign == "," and depth == 0:
            parts.append(text[start:place].strip())
            start = place + 1
    return [*parts, text[start:].strip()]


def _item(item: str) -> list[str] | Between:
    """One part of a list: a range, or a value as it stands."""
    if space := _SPACE.fullmatch(item):
        return _space(space[1], [part.strip() for part in space[2].split(",")])
    ends = item.split(":")
    matches = [_QUANTITY.fullmatch(end) for end in ends]
    if len(ends) == 1 or not all(matches):
        return [item]
    if len(ends) > 3:
        raise BadInput("write from:to:step")
    unit = _common_unit([match[2] or "" for match in matches if match])
    numbers = [Decimal(match[1]) for match in matches if match]
    if len(numbers) == 2:
        return Between(float(numbers[0]), float(numbers[1]), unit, log=False)
    return _steps(numbers[0], numbers[1], numbers[2], unit)


def _common_unit(units: Sequence[str]) -> str:
    """The unit of quantities of which some may leave it away."""
    named = {unit for unit in units if unit}
    if len(named) > 1:
        raise BadInput(f"the units {', '.join(sorted(named))} are different: write one of them")
    return named.pop() if named else ""


def _steps(low: Decimal, high: Decimal, step: Decimal, unit: str) -> list[str]:
    if step == 0:
        raise BadInput("the step is 0")
    count = int((high - low) / step)
    if (high - low) / step < 0:
        raise BadInput(f"the range is empty: steps of {step} lead away from {high}")
    if count > _MOST_VALUES:
        raise BadInput(f"{count} values are too many")
    return [_with_unit(low + number * step, unit) for number in range(count + 1)]


def _space(name: str, parts: Sequence[str]) -> list[str] | Between:
    matches = [_QUANTITY.fullmatch(part) for part in parts]
    if len(parts) not in (2, 3) or not all(matches):
        raise BadInput(f"write {name}(from, to, count)")
    unit = _common_unit([match[2] or "" for match in matches[:2] if match])
    low, high = (float(match[1]) for match in matches[:2] if match)
    if name == "log" and not 0 < low <= high:
        raise BadInput("a range at equal ratios goes up, and starts above 0")
    between = Between(low, high, unit, log=name == "log")
    if len(parts) == 2:
        return between
    if not parts[2].isdecimal() or not 2 <= int(parts[2]) <= _MOST_VALUES:
        raise BadInput(f"{parts[2]} values make no range: at least 2")
    last = int(parts[2]) - 1
    return [between.at(number / last) for number in range(last + 1)]


def _written(value: float, unit: str) -> str:
    return _with_unit(Decimal(f"{value:.{_DIGITS}g}"), unit)


def _with_unit(value: Decimal, unit: str) -> str:
    number = format(value.normalize(), "f") if value else "0"
    return f"{number} {unit}" if unit else number


def grid(axes: Sequence[Axis]) -> list[Cell]:
    """Every combination of the points of all axes; the last axis varies fastest.

    Raises:
        BadInput: an axis without points.
    """
    for axis in axes:
        if axis.between is not None:
            low, high = axis.between.at(0.0), axis.between.at(1.0)
            raise BadInput(f"--over {axis.name}: {low} to {high} in which steps? Write from:to:step, or add --random N")
    return [Cell(points) for points in product(*(axis.points for axis in axes))]


def random_cells(axes: Sequence[Axis], count: int, seed: int) -> list[Cell]:
    """So many different cells, drawn independently for each axis; the same seed gives the same, and more begin alike.

    Raises:
        BadInput: no cells, nothing to draw for, or fewer combinations than asked for.
    """
    if count < 1 or not axes:
        raise BadInput(f"--random {count}: at least one cell, over at least one KEY=RANGE")
    draws = [stream(seed, "sweep", axis.name) for axis in axes]
    drawn: dict[Cell, None] = {}
    for index in range(_TRIES * count):
        drawn[Cell(tuple(axis.draw(own, index) for axis, own in zip(axes, draws, strict=True)))] = None
        if len(drawn) == count:
            return list(drawn)
    raise BadInput(
        f"--random {count}: the ranges have hardly more than {len(drawn)} combinations: leave it out, or ask less"
    )


def spanned(axes: Iterable[Axis], cells: Sequence[Cell]) -> Iterator[Axis]:
    """The axes with the points that the cells have, those that were drawn in ascending order."""
    for number, axis in enumerate(axes):
        if axis.between is None:
            yield axis
            continue
        points = {cell.points[number] for cell in cells}
        yield Axis(axis.name, tuple(sorted(points, key=lambda point: _sort_key(point.label))))


def _sort_key(label: str) -> float:
    match = _QUANTITY.fullmatch(label)
    return float(match[1]) if match else math.nan
