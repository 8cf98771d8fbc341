"""Cameras of vehicles that look at each other: which vehicles are in view, and what is measured of them.

A camera looks along its vehicle's body x axis. Arrays of pairs have the seer first and the seen second.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import compress, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...randomness import Stream
from ...rotation_columns import conjugates, dots, exponentials, norms, products, turned_back
from ...units import Hertz, Metres, Probability, Radians, check_above_zero

Floats = NDArray[np.float64]
DRAWS = 8
"""Draws for one seen vehicle in one frame: a miss, three for its place, three for its orientation, one spare."""


@dataclass(frozen=True)
class Camera:
    """Field of view and noise of a camera.

    Attributes:
        rate: frames per second [Hz].
        horizontal, vertical: full angles of view [rad], in azimuth and elevation about the body's x axis.
        range: largest distance at which it recognises a vehicle [m].
        depth_noise: standard deviation along the line of sight [m] at 1 m; it grows with the square of the distance.
        lateral_noise: standard deviation on each axis across [m] at 1 m; it grows with the distance.
        orientation_noise: standard deviation of the relative orientation on each axis [rad].
        misses: probability that a vehicle in view is not recognised in a frame.
        occlusion: whether vehicles hide those behind them.

    Raises:
        BadInput: one of them is out of its bounds.
    """

    rate: Hertz = 30.0
    horizontal: Radians = math.radians(67.0)
    vertical: Radians = math.radians(53.0)
    range: Metres = 5.0
    depth_noise: Metres = 0.02
    lateral_noise: Metres = 0.02
    orientation_noise: Radians = math.radians(1.0)
    misses: Probability = 0.02
    occlusion: bool = True

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_above_zero("camera.rate", self.rate, "Hz")
        check_above_zero("camera.range", self.range, "m")
        for name, angle, most in (("horizontal", self.horizontal, 360.0), ("vertical", self.vertical, 180.0)):
            if not 0.0 < angle <= math.radians(most):
                raise BadInput(f"camera.{name} is {math.degrees(angle):g} deg, it must be above 0 and at most {most:g}")
        for name, value, unit in (
            ("depth_noise", self.depth_noise, "m"),
            ("lateral_noise", self.lateral_noise, "m"),
            ("orientation_noise", self.orientation_noise, "rad"),
        ):
            if not 0.0 <= value < math.inf:
                raise BadInput(f"camera.{name} is {value:g} {unit}, it must be at least 0")
        if not 0.0 <= self.misses <= 1.0:
            raise BadInput(f"camera.misses is {self.misses:g}, a probability lies between 0 and 1")

    def exact(self) -> Camera:
        """The same without noise and misses."""
        return replace(self, depth_noise=0.0, lateral_noise=0.0, orientation_noise=0.0, misses=0.0)


class View(NamedTuple):
    """All lines of sight at one instant.

    `seen` (N, N): whether the second is in view of the first. `relative` (3, N, N): the second's place in the body
    coordinates of the first [m].
    """

    seen: NDArray[np.bool_]
    relative: Floats


def view(camera: Camera, radius: float, places: Floats, matrices: Floats) -> View:
    """Which vehicles see each other: within the angles and the range, and not hidden by another vehicle.

    A vehicle hides another one if it is nearer and the line of sight to the other's centre meets its sphere.

    Args:
        camera: the same on all vehicles.
        radius: of a vehicle's sphere [m].
        places: (3, N) [m], inertial.
        matrices: rotation matrices of the attitudes, (3, 3, N).
    """
    apart = places[:, None, :] - places[:, :, None]
    relative = turned_back(matrices[..., None], apart)
    x, y, z = relative
    distance = norms(apart)
    seen = (distance > 0.0) & (distance <= camera.range)
    seen &= np.abs(np.arctan2(y, x)) <= 0.5 * camera.horizontal
    seen &= np.abs(np.arctan2(z, np.hypot(x, y))) <= 0.5 * camera.vertical
    if camera.occlusion:
        first, second = np.nonzero(seen)
        seen[first, second] = ~_hidden(radius, apart, distance, first, second)
    return View(seen, relative)


def _hidden(
    radius: float, apart: Floats, distance: Floats, first: NDArray[np.intp], second: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Whether a third vehicle is in the line of sight, for each pair of `first` and `second`."""
    range_m = distance[first, second]
    sight = apart[:, first, second] / range_m
    others = apart[:, first, :]
    along = dots(sight[:, :, None], others)
    across = dots(others, others) - along * along
    between = (along > 0.0) & (along < range_m[:, None]) & (across < radius * radius)
    between[np.arange(len(second)), second] = False
    return np.asarray(between.any(axis=1))


def frames(
    camera: Camera, sights: View, attitudes: Floats, index: int, draws: Callable[[int, int], Stream]
) -> list[Floats | None]:
    """Measurements of all cameras in one frame.

    Args:
        camera: the same on all vehicles.
        sights: lines of sight now.
        attitudes: (4, N).
        index: of the frame; noise is a function of it.
        draws: seer and seen → stream of the pair.
    Returns:
        For each camera a row for each recognised vehicle, (n, 8): its index, its place in the camera's body
        coordinates [m], its attitude relative to the camera's, ξ = R_seerᵀ R_seen, as a quaternion with w ≥ 0. None
        for a camera that recognises nobody.
    """
    first, second = sights.seen.nonzero()
    streams = [draws(*pair) for pair in zip(first.tolist(), second.tolist(), strict=True)]
    if camera.misses > 0.0:
        recognised = [each.uniform(DRAWS * index) >= camera.misses for each in streams]
        first, second, streams = first[recognised], second[recognised], list(compress(streams, recognised))
    if not streams:
        return [None] * len(sights.seen)
    places = sights.relative[:, first, second]
    relative = products(conjugates(attitudes[:, first]), attitudes[:, second])
    if camera.depth_noise > 0.0 or camera.lateral_noise > 0.0 or camera.orientation_noise > 0.0:
        noise = _normals(streams, index)
        places = places + _place_noise(camera, places, noise[:3])
        relative = products(relative, exponentials(camera.orientation_noise * noise[3:]))
    relative *= np.where(relative[0] < 0.0, -1.0, 1.0)
    rows = np.concatenate((second[np.newaxis], places, relative), dtype=np.float64).T
    ends = np.searchsorted(first, np.arange(len(sights.seen) + 1)).tolist()
    return [rows[start:end].copy() if end > start else None for start, end in pairwise(ends)]


def _normals(streams: Sequence[Stream], index: int) -> Floats:
    return np.array([each.normals(DRAWS * index + 1, 6) for each in streams]).T


def _place_noise(camera: Camera, places: Floats, noise: Floats) -> Floats:
    """Standard normal noise (3, n) stretched along and across the lines of sight."""
    distance = norms(places)
    sight = places / distance
    along = dots(sight, noise)
    across = camera.lateral_noise * distance
    return np.asarray(across * noise + (camera.depth_noise * distance * distance - across) * along * sight)
