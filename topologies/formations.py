"""Reference shapes of formations: where N vehicles stand about their common centre, in natural order of their names.

Inertial axes: x north, y west, z up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import units
from ..errors import BadInput

Floats = NDArray[np.float64]
_CHANGES = ("order", "moved", "turned")


def formation(spec: Mapping[str, Any], count: int, place: str = "formation") -> Floats:
    """The places of `count` vehicles about their centroid, (N, 3) [m].

    One key names the shape, with a length:

    - `{triangle: 0.9 m}`: three vehicles, this far apart, the first ahead;
    - `{line: 1 m}`: one after another along x, this far apart, the last ahead;
    - `{ring: 1 m}`: a regular polygon with such sides, anticlockwise, the first ahead;
    - `{grid: 1 m}`: rows along x, as many in each as there are rows, the last row perhaps shorter;
    - `{vee: 1 m}`: the first ahead, then left and right by turns, each arm 45° back, this far apart;
    - `{places: [[0 m, 1 m, 0 m], …]}`: as written, two or three lengths a vehicle.

    Beside it may stand, applied in this order: `order: [2, 1, 3]`, which of the shape's places the first, second and
    third vehicle takes; `moved: {1: [45 cm, 0 m, 0 m]}`, vehicles by number and how far each is out of its place;
    `turned: 90 deg` anticlockwise, seen from above.

    Raises:
        BadInput: no shape or more than one, a length that is not above 0, a number of vehicles that the shape cannot
            have, two vehicles in one place; with the place of the field.
    """
    if not isinstance(spec, Mapping):
        raise BadInput(f"{place}: {spec!r} is no formation: write one such as {{triangle: 0.9 m}}")
    for key in spec:
        if key not in (*_SHAPES, "places", *_CHANGES):
            raise BadInput(f"{place}: {key!r} is not known: use one of {', '.join((*_SHAPES, 'places', *_CHANGES))}")
    kinds = [key for key in spec if key not in _CHANGES]
    if len(kinds) != 1:
        said = " and ".join(kinds) or "no shape"
        raise BadInput(f"{place}: {said}: write one of {', '.join((*_SHAPES, 'places'))}")
    if count < 2:
        raise BadInput(f"{place}: a formation has at least 2 vehicles, not {count}")
    kind = kinds[0]
    within = f"{place}.{kind}"
    places = _places(spec[kind], count, within) if kind == "places" else _shape(kind, spec[kind], count, within)
    changed = _changed(places, spec, place)
    _apart(changed, place)
    return np.asarray(changed - changed.mean(axis=0))


def formation_state(places: Floats) -> Floats:
    """The formation's state when it is at rest in these places, [r₁, 0, r₂, 0, …] with r_i = p_i − p_(i+1).

    Args:
        places: (N, 3) [m].
    Returns:
        (6 (N − 1),) [m, m/s].
    """
    differences = places[:-1] - places[1:]
    return np.hstack((differences, np.zeros_like(differences))).ravel()


def _shape(kind: str, size: Any, count: int, place: str) -> Floats:
    spacing = _length(size, place)
    if not 0.0 < spacing < math.inf:
        raise BadInput(f"{place} is {spacing:g} m, it must be above 0")
    flat = _SHAPES[kind](count, place)
    return np.column_stack((spacing * flat, np.zeros(count)))


def _triangle(count: int, place: str) -> Floats:
    if count != 3:
        raise BadInput(f"{place}: a triangle has 3 vehicles, not {count}: use ring, vee, grid or places")
    return _ring(count, place)


def _ring(count: int, place: str) -> Floats:
    if count < 3:
        raise BadInput(f"{place}: a ring has at least 3 vehicles, not {count}: use line")
    angles = 2.0 * math.pi * np.arange(count) / count
    circle: Floats = np.column_stack((np.cos(angles), np.sin(angles)))
    return circle * (0.5 / math.sin(math.pi / count))


def _line(count: int, _place: str) -> Floats:
    return np.column_stack((np.arange(count, dtype=np.float64), np.zeros(count)))


def _grid(count: int, _place: str) -> Floats:
    side = math.isqrt(count - 1) + 1
    rows, columns = np.divmod(np.arange(count), side)
    return np.column_stack((columns, rows)).astype(np.float64)


def _vee(count: int, _place: str) -> Floats:
    numbers = np.arange(count)
    back = (numbers + 1) // 2
    side = np.where(numbers % 2 == 1, 1.0, -1.0)
    arms: Floats = np.column_stack((-back, side * back))
    return arms * math.sqrt(0.5)


_SHAPES: Mapping[str, Callable[[int, str], Floats]] = {
    "triangle": _triangle,
    "line": _line,
    "ring": _ring,
    "grid": _grid,
    "vee": _vee,
}


def _places(listed: Any, count: int, place: str) -> Floats:
    if not isinstance(listed, Sequence) or isinstance(listed, str):
        raise BadInput(f"{place}: {listed!r} is not a list of places, as in [[0 m, 0 m, 0 m], [1 m, 0 m, 0 m]]")
    if len(listed) != count:
        raise BadInput(f"{place}: {len(listed)} places for {count} vehicles: give each one")
    return np.array([_point(one, f"{place}.{index}") for index, one in enumerate(listed)])


def _changed(places: Floats, spec: Mapping[str, Any], place: str) -> Floats:
    count = len(places)
    if "order" in spec:
        order = spec["order"]
        if not isinstance(order, Sequence) or sorted(map(str, order)) != sorted(map(str, range(1, count + 1))):
            raise BadInput(f"{place}.order: {order!r} must have each number from 1 to {count} once")
        places = places[[int(number) - 1 for number in order]]
    moved = spec.get("moved", {})
    if not isinstance(moved, Mapping):
        raise BadInput(f"{place}.moved: {moved!r} must be a mapping, as in {{1: [45 cm, 0 m, 0 m]}}")
    for key, shift in moved.items():
        if str(key) not in map(str, range(1, count + 1)):
            raise BadInput(f"{place}.moved: {key!r} is none of the vehicles 1 to {count}")
        places[int(key) - 1] += _point(shift, f"{place}.moved.{key}")
    angle = _angle(spec.get("turned", 0), f"{place}.turned")
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.asarray(places @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]))


def _apart(places: Floats, place: str) -> None:
    for second in range(1, len(places)):
        distances = np.linalg.norm(places[:second] - places[second], axis=1)
        first = int(distances.argmin())
        if not distances[first] > 0.0:
            raise BadInput(f"{place}: vehicles {first + 1} and {second + 1} are in one place: move one of them")


def _point(value: Any, place: str) -> Floats:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) not in {2, 3}:
        raise BadInput(f"{place}: {value!r} is no place: write 2 or 3 lengths, as in [1 m, 0 m, 0 m]")
    lengths = [_length(part, place) for part in value]
    if not all(map(math.isfinite, lengths)):
        raise BadInput(f"{place}: {value!r} is not finite")
    return np.array((*lengths, 0.0)[:3])


def _length(value: Any, place: str) -> float:
    """Text with a unit, or a number in metres."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return _read(value, "m", place)


def _angle(value: Any, place: str) -> float:
    return _read(value, "rad", place)


def _read(value: Any, unit: str, place: str) -> float:
    try:
        return float(units.Unit(unit).read(value))
    except BadInput as error:
        raise BadInput(f"{place}: {error}") from None
