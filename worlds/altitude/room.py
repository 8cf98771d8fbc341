"""Obstacles on the floor of a room: tables, platforms, and chairs with uneven surfaces. Lengths in metres."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

from ...errors import BadInput
from ...randomness import stream

_CELL = 0.1
_BACK, _GAP = 0.2, 0.4
"""Fractions of a chair's cells: a fifth is back rest, another fifth a gap to the floor."""
_BACK_HEIGHT = 1.9
"""Height of a back rest relative to the seat."""


@dataclass(frozen=True)
class Obstacle:
    """A box on the floor: centre, size along x and y, height [m].

    `uneven` ones are chairs: cells of 10 cm that are the seat at this height, the back rest at 1.9 times of it or a gap
    to the floor, as the seed draws. `roughness`: standard deviation that it adds to the readings of range finders [m].

    Raises:
        BadInput: a size not above 0, or a roughness below 0.
    """

    centre: tuple[float, float]
    size: tuple[float, float]
    height: float
    uneven: bool = False
    roughness: float = 0.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        if not (min(self.size) > 0 and self.height > 0):
            raise BadInput(f"size {self.size} m and height {self.height:g} m must be above 0")
        if self.roughness < 0:
            raise BadInput(f"roughness is {self.roughness:g} m, it must be at least 0")

    @property
    def top(self) -> float:
        """Largest height anywhere on it."""
        return self.height * (_BACK_HEIGHT if self.uneven else 1.0)

    def is_at(self, x: float, y: float) -> bool:
        """Whether it covers a place."""
        return abs(x - self.centre[0]) <= self.size[0] / 2 and abs(y - self.centre[1]) <= self.size[1] / 2


@dataclass(frozen=True)
class Room:
    """A floor at height 0 with obstacles; the highest counts where some overlap."""

    obstacles: tuple[Obstacle, ...]
    seed: int

    def surface(self, x: float, y: float) -> tuple[float, float]:
        """Height of the surface [m], and its additional noise of range finders [m]."""
        surfaces = [
            (self._height(number, obstacle, x, y), obstacle.roughness)
            for number, obstacle in enumerate(self.obstacles)
            if obstacle.is_at(x, y)
        ]
        return max(surfaces, default=(0.0, 0.0))

    def beam(self, position: tuple[float, float, float], direction: tuple[float, float, float]) -> tuple[float, float]:
        """Length of a beam to the surface that it meets [m], and the additional noise of that surface [m].

        Args:
            position: start of the beam, above the surface [m].
            direction: of unit length, pointing down.

        The sides of obstacles reflect nothing: a beam that only they would meet goes on to the surface below.
        """
        (x, y, z), (along_x, along_y, along_z) = position, direction
        heights = {0.0, *(height for obstacle in self.obstacles for height in _levels(obstacle))}
        for height in sorted(heights, reverse=True):
            length = (height - z) / along_z
            surface, roughness = self.surface(x + length * along_x, y + length * along_y)
            if length >= 0 and math.isclose(surface, height):
                return length, roughness
        return max(0.0, -z / along_z), 0.0

    def _height(self, number: int, obstacle: Obstacle, x: float, y: float) -> float:
        if not obstacle.uneven:
            return obstacle.height
        share = _draw(self.seed, number, math.floor(x / _CELL), math.floor(y / _CELL))
        return _levels(obstacle)[0 if share < _BACK else 2 if share < _GAP else 1]


def _levels(obstacle: Obstacle) -> tuple[float, ...]:
    """Heights of its surface: back rest, seat and gap of a chair."""
    return (obstacle.top, obstacle.height, 0.0) if obstacle.uneven else (obstacle.height,)


@lru_cache(maxsize=4096)
def _draw(seed: int, obstacle: int, column: int, row: int) -> float:
    return stream(seed, "chair", str(obstacle), str(column), str(row)).uniform(0)
