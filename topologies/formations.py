"""Reference shapes of formations: positions of N vehicles about their centroid, in natural order of their names.

Inertial axes: x north, y west, z up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from ..units import BareMetres, Bounds, Radians
from .graphs import Position

Floats = NDArray[np.float64]
Place = tuple[BareMetres, ...]
"""Two or three lengths."""
_Spacing = Annotated[BareMetres, Bounds(above=0.0)]


@dataclass(frozen=True)
class Formation:
    """A shape, exactly one of the first six fields, changed by the last three in their order.

    triangle: side of an equilateral triangle of three vehicles, the first in front.
    line: spacing of a line along x, the last vehicle in front.
    ring: side of a regular polygon, anticlockwise, the first vehicle in front.
    grid: spacing of a square grid with as many vehicles per row as rows, the last row possibly shorter.
    vee: spacing along the arms of a V, the first vehicle in front, then left and right alternately, 45° back.
    places: position of each vehicle, two or three lengths.
    order: which of the shape's positions the first, second and third vehicle takes, as in [2, 1, 3].
    moved: number of a vehicle → its displacement from its position, as in {1: [45 cm, 0 m, 0 m]}.
    turned: rotation of the shape, anticlockwise seen from above.

    Raises:
        BadInput: no shape or more than one, a length that is not above 0, or a position without two or three lengths.
    """

    json_schema: ClassVar[Mapping[str, Any]] = {
        "oneOf": [{"required": [name]} for name in ("triangle", "line", "ring", "grid", "vee", "places")]
    }

    triangle: _Spacing | None = None
    line: _Spacing | None = None
    ring: _Spacing | None = None
    grid: _Spacing | None = None
    vee: _Spacing | None = None
    places: tuple[Place, ...] | None = None
    order: tuple[int, ...] | None = None
    moved: Mapping[str, Place] | None = None
    turned: Radians = 0.0

    def __post_init__(self) -> None:
        """Check everything that does not depend on the number of vehicles."""
        shapes = (*_SHAPES, "places")
        given = [name for name in shapes if getattr(self, name) is not None]
        if len(given) != 1:
            raise BadInput(f"{' and '.join(given) or 'no shape'}: write one of {', '.join(shapes)}")
        for name in _SHAPES:
            spacing = getattr(self, name)
            if spacing is not None and not 0.0 < spacing < math.inf:
                raise BadInput(f"it is {spacing:g} m, it must be above 0", (name,))
        for name, listed in (("places", enumerate(self.places or ())), ("moved", (self.moved or {}).items())):
            for key, place in listed:
                if len(place) not in {2, 3}:
                    text = f"{list(place)} is no place: write 2 or 3 lengths, as in [1 m, 0 m, 0 m]"
                    raise BadInput(text, (name, key))

    def of(self, count: int) -> Floats:
        """Positions of `count` vehicles about their centroid, (N, 3) [m].

        Raises:
            BadInput: the shape does not allow this number of vehicles, or two have the same position.
        """
        if count < 2:
            raise BadInput(f"a formation has at least 2 vehicles, not {count}")
        places = self._listed(count) if self.places is not None else self._shape(count)
        changed = self._changed(places)
        _check_apart(changed)
        return np.asarray(changed - changed.mean(axis=0))

    def _shape(self, count: int) -> Floats:
        name = next(name for name in _SHAPES if getattr(self, name) is not None)
        try:
            flat = _SHAPES[name](count)
        except BadInput as error:
            raise BadInput(str(error), (name,)) from None
        return np.column_stack((getattr(self, name) * flat, np.zeros(count)))

    def _listed(self, count: int) -> Floats:
        assert self.places is not None
        if len(self.places) != count:
            text = f"{len(self.places)} places for {count} vehicles: give each one"
            raise BadInput(text, ("places",))
        return np.array([_point(place) for place in self.places])

    def _changed(self, places: Floats) -> Floats:
        count = len(places)
        if self.order is not None:
            if sorted(self.order) != list(range(1, count + 1)):
                text = f"{list(self.order)} must have each number from 1 to {count} once"
                raise BadInput(text, ("order",))
            places = places[[number - 1 for number in self.order]]
        for key, shift in (self.moved or {}).items():
            if key not in map(str, range(1, count + 1)):
                raise BadInput(f"{key} is none of the vehicles 1 to {count}", ("moved", key))
            places[int(key) - 1] += _point(shift)
        cosine, sine = math.cos(self.turned), math.sin(self.turned)
        return np.asarray(places @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]))


def _triangle(count: int) -> Floats:
    if count != 3:
        raise BadInput(f"a triangle has 3 vehicles, not {count}: use ring, vee, grid or places")
    return _ring(count)


def _ring(count: int) -> Floats:
    if count < 3:
        raise BadInput(f"a ring has at least 3 vehicles, not {count}: use line")
    angles = 2.0 * math.pi * np.arange(count) / count
    circle: Floats = np.column_stack((np.cos(angles), np.sin(angles)))
    return circle * (0.5 / math.sin(math.pi / count))


def _line(count: int) -> Floats:
    return np.column_stack((np.arange(count, dtype=np.float64), np.zeros(count)))


def _grid(count: int) -> Floats:
    side = math.isqrt(count - 1) + 1
    rows, columns = np.divmod(np.arange(count), side)
    return np.column_stack((columns, rows)).astype(np.float64)


def _vee(count: int) -> Floats:
    numbers = np.arange(count)
    back = (numbers + 1) // 2
    side = np.where(numbers % 2 == 1, 1.0, -1.0)
    arms: Floats = np.column_stack((-back, side * back))
    return arms * math.sqrt(0.5)


_SHAPES: Mapping[str, Callable[[int], Floats]] = {
    "triangle": _triangle,
    "line": _line,
    "ring": _ring,
    "grid": _grid,
    "vee": _vee,
}


def _check_apart(places: Floats) -> None:
    for second in range(1, len(places)):
        distances = np.linalg.norm(places[:second] - places[second], axis=1)
        first = int(distances.argmin())
        if not distances[first] > 0.0:
            raise BadInput(f"vehicles {first + 1} and {second + 1} are in one place: move one of them")


def _point(place: Position) -> Floats:
    return np.array((*place, 0.0)[:3])
