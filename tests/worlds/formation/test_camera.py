"""Cameras that look at other vehicles: who is in view, and what is said of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.errors import BadInput
from volery.randomness import Stream, stream
from volery.rotation_columns import matrices
from volery.rotations import conjugate, euler_to_quaternion, log_quaternion, quaternion_product, to_matrix
from volery.worlds.formation.camera import Camera, View, frames
from volery.worlds.formation.camera import view as view_of

Floats = NDArray[np.float64]
RADIUS = 0.2
LEVEL = (1.0, 0.0, 0.0, 0.0)
EXACT = Camera(horizontal=math.radians(60), vertical=math.radians(40), range=3.0).exact()


def view(camera: Camera, radius: float, places: Floats, attitudes: Floats) -> View:
    """The lines of sight of vehicles in attitudes that are given as quaternions."""
    return view_of(camera, radius, places, matrices(attitudes))


def draws(first: int, second: int) -> Stream:
    """The stream of a pair."""
    return stream(1, "test", str(first), str(second))


def seen_from_the_first(*others: tuple[float, float, float], camera: Camera = EXACT) -> list[int]:
    """Which of the others are in view of a level vehicle at the origin that looks along x."""
    places = np.array([(0.0, 0.0, 0.0), *others]).T
    attitudes = np.tile(LEVEL, (len(others) + 1, 1)).T
    return np.flatnonzero(view(camera, RADIUS, places, attitudes).seen[0]).tolist()


def around(azimuth: float, elevation: float, distance: float = 1.0) -> tuple[float, float, float]:
    """A place in these directions [deg] from the origin."""
    a, e = math.radians(azimuth), math.radians(elevation)
    return distance * math.cos(e) * math.cos(a), distance * math.cos(e) * math.sin(a), distance * math.sin(e)


@pytest.mark.parametrize(
    ("place", "visible"),
    [
        (around(0, 0), True),
        (around(29.9, 0), True),
        (around(-29.9, 19.9), True),
        (around(30.1, 0), False),
        (around(-30.1, 0), False),
        (around(0, 20.1), False),
        (around(0, -20.1), False),
        (around(180, 0), False),
        (around(0, 0, 2.999), True),
        (around(0, 0, 3.001), False),
    ],
)
def test_the_field_of_view_and_the_range(place: tuple[float, float, float], visible: bool) -> None:
    """60° by 40° about the x axis, up to 3 m."""
    assert seen_from_the_first(place) == ([1] if visible else [])


def test_a_camera_all_round_sees_behind() -> None:
    """360° have no edge."""
    whole = Camera(horizontal=2 * math.pi, vertical=math.pi, range=3.0).exact()
    assert seen_from_the_first(around(180, 0), around(0, 90), around(-135, -60), camera=whole) == [1, 2, 3]


def test_a_camera_turns_with_its_vehicle() -> None:
    """A vehicle that looks west sees what is in the west, at the same place in its own coordinates."""
    places = np.array([(0.0, 0.0, 0.0), (0.0, 1.0, 0.1), (1.0, 0.0, 0.0)]).T
    west = euler_to_quaternion(0.0, 0.0, math.pi / 2)
    found = view(EXACT, RADIUS, places, np.array([west, LEVEL, LEVEL]).T)
    assert found.seen[0].tolist() == [False, True, False]
    assert found.relative[:, 0, 1] == pytest.approx([1.0, 0.0, 0.1])


@pytest.mark.parametrize(("aside", "hidden"), [(0.0, True), (0.199, True), (-0.199, True), (0.201, False)])
def test_a_vehicle_in_the_line_of_sight_hides_what_is_behind(aside: float, hidden: bool) -> None:
    """Within its radius of the line, wherever on the way; without occlusion nothing is hidden."""
    behind, between = (2.0, 0.0, 0.0), (1.0, aside, 0.0)
    assert seen_from_the_first(behind, between) == ([2] if hidden else [1, 2])
    through = Camera(range=3.0, occlusion=False).exact()
    assert seen_from_the_first(behind, between, camera=through) == [1, 2]


def test_only_what_is_nearer_hides() -> None:
    """Neither a vehicle behind the one seen nor one behind the camera's back does, even if it is close to the line."""
    assert seen_from_the_first((1.0, 0.0, 0.0), (1.5, 0.0, 0.0)) == [1]
    assert seen_from_the_first((1.0, 0.0, 0.0), (-0.5, 0.0, 0.0)) == [1]
    assert seen_from_the_first((1.0, 0.0, 0.0), (1.1, 0.15, 0.0)) == [1]


def a_crowd(count: int) -> tuple[Floats, Floats]:
    """Vehicles in places and attitudes drawn at random."""
    normal = np.array([[stream(5, "crowd", str(i)).normal(k) for k in range(7)] for i in range(count)])
    attitudes = normal[:, 3:] / np.linalg.norm(normal[:, 3:], axis=1)[:, None]
    return normal[:, :3].T, attitudes.T


def test_an_exact_frame_says_where_and_how_turned_the_others_are() -> None:
    """Rᵢᵀ(pⱼ − pᵢ) and ξ = Rᵢᵀ Rⱼ, at any attitudes, and who it is."""
    places, attitudes = a_crowd(6)
    whole = Camera(horizontal=2 * math.pi, vertical=math.pi, range=99.0, occlusion=False).exact()
    rows = frames(whole, view(whole, RADIUS, places, attitudes), attitudes, 0, draws)
    for seer, found in enumerate(rows):
        assert found is not None
        assert found[:, 0].tolist() == [each for each in range(6) if each != seer]
        turn = to_matrix(attitudes[:, seer])
        for row in found:
            seen = int(row[0])
            assert row[1:4] == pytest.approx(turn.T @ (places[:, seen] - places[:, seer]))
            assert to_matrix(row[4:]) == pytest.approx(turn.T @ to_matrix(attitudes[:, seen]))
            assert row[4] >= 0.0


def test_a_camera_that_sees_nobody_says_nothing() -> None:
    """None, and not a list without rows."""
    places = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]).T
    attitudes = np.tile(LEVEL, (2, 1)).T
    first, second = frames(EXACT, view(EXACT, RADIUS, places, attitudes), attitudes, 0, draws)
    assert first is not None
    assert second is None
    away = view(EXACT, RADIUS, places[:, ::-1], attitudes)
    assert frames(EXACT, away, attitudes, 0, draws)[0] is None


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.0])
def test_noise_grows_with_the_distance(distance: float) -> None:
    """Depth with its square, the sides in proportion, orientation not at all, by 4 standard errors of a deviation.

    A standard deviation is known from n draws to 1/√(2n) of itself.
    """
    camera = Camera(depth_noise=0.02, lateral_noise=0.01, orientation_noise=0.03, misses=0.0)
    places = np.array([(0.0, 0.0, 0.0), around(20, 10, distance)]).T
    attitudes = np.array([LEVEL, euler_to_quaternion(0.1, 0.2, 0.3)]).T
    sights = view(camera, RADIUS, places, attitudes)
    count = 1500
    rows = np.array([frames(camera, sights, attitudes, index, draws)[0] for index in range(count)])[:, 0]
    sight = places[:, 1] / distance
    left = np.cross([0.0, 0.0, 1.0], sight) / np.hypot(*sight[:2])
    error = rows[:, 1:4] - places[:, 1]
    within = 4 / math.sqrt(2 * count)
    assert (error @ sight).std() == pytest.approx(0.02 * distance**2, rel=within)
    assert (error @ left).std() == pytest.approx(0.01 * distance, rel=within)
    assert (error @ np.cross(sight, left)).std() == pytest.approx(0.01 * distance, rel=within)
    turns = np.array([log_quaternion(quaternion_product(conjugate(attitudes[:, 1]), row[4:])) for row in rows])
    assert turns.std(axis=0) == pytest.approx(np.full(3, 0.03), rel=within)
    together = np.corrcoef(np.hstack((error @ np.array([sight, left, np.cross(sight, left)]).T, turns)).T)
    assert np.abs(together - np.eye(6)).max() < 4.5 / math.sqrt(count)


def test_misses_come_with_their_probability() -> None:
    """To four standard errors of a share."""
    camera = Camera(misses=0.3)
    places = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]).T
    attitudes = np.tile(LEVEL, (2, 1)).T
    sights = view(camera, RADIUS, places, attitudes)
    missed = [frames(camera, sights, attitudes, index, draws)[0] is None for index in range(1000)]
    assert np.mean(missed) == pytest.approx(0.3, abs=4 * math.sqrt(0.3 * 0.7 / 1000))


def test_what_is_said_of_a_pair_does_not_hang_on_others() -> None:
    """A third vehicle in view, missed or not, leaves the noise of the second as it is."""
    camera = Camera()
    places = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.45, 0.0)]).T
    attitudes = np.tile(LEVEL, (3, 1)).T
    few = frames(camera, view(camera, RADIUS, places[:, :2], attitudes[:, :2]), attitudes[:, :2], 7, draws)[0]
    many = frames(camera, view(camera, RADIUS, places, attitudes), attitudes, 7, draws)[0]
    assert few is not None
    assert many is not None
    assert many[:, 0].tolist() == [1, 2]
    assert few[0].tolist() == many[0].tolist()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"rate": 0.0}, "camera.rate is 0 Hz"),
        ({"range": math.inf}, "camera.range is inf m"),
        ({"horizontal": 7.0}, "camera.horizontal is 401"),
        ({"vertical": 0.0}, "camera.vertical is 0 deg, it must be above 0 and at most 180"),
        ({"depth_noise": -1.0}, "camera.depth_noise is -1 m"),
        ({"orientation_noise": math.nan}, "camera.orientation_noise is nan rad"),
        ({"misses": 1.5}, "camera.misses is 1.5, a probability"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(change: dict[str, Any], said: str) -> None:
    """The message has the value and the bound."""
    with pytest.raises(BadInput, match=said):
        Camera(**change)
