"""The room, the sensors of the vehicle, and the world that they make."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from volery.errors import BadInput
from volery.units import period_ns
from volery.worlds.altitude.altitude_sensors import AltitudeSensor, BarometerSensor, ImuSensor, RangeSensor
from volery.worlds.altitude.altitude_world import AltitudeWorld
from volery.worlds.altitude.room import Obstacle, Room
from volery.worlds.altitude.tour import Tour
from volery.worlds.random_walks import walk

from ...surroundings import build_world as build

S = 1_000_000_000
TABLE = Obstacle((2.0, 0.0), (1.2, 0.8), 0.75)
CHAIR = Obstacle((4.0, 0.0), (0.5, 0.5), 0.45, uneven=True, roughness=0.1)
ROOM = Room((TABLE, CHAIR), 3)
TOUR = Tour(((0.0, 0.0), (6.0, 0.0)))
EXACT: dict[str, AltitudeSensor] = {
    "imu": ImuSensor(acceleration_noise=0, attitude_noise=0, gyro_noise=0, bias=0.1, bias_walk=0),
    "baro": BarometerSensor(noise=0, bias_walk=0, resolution=0),
    "laser": RangeSensor(noise=0, resolution=0),
}
WORLD = AltitudeWorld(TOUR, ROOM, tuple(EXACT.items()), 3)


def test_surfaces_are_those_of_the_obstacles() -> None:
    """The floor is at 0, the highest counts, and a chair is seat, back rest or gap, cell by cell."""
    assert ROOM.surface(0.0, 0.0) == (0.0, 0.0)
    assert ROOM.surface(2.59, -0.39) == (0.75, 0.0)
    assert ROOM.surface(2.61, 0.0) == (0.0, 0.0)
    assert Room((TABLE, replace(CHAIR, centre=(2.0, 0.0), uneven=False)), 3).surface(2.0, 0.0)[0] == 0.75
    cells = {(x, y): ROOM.surface(3.8 + 0.1 * x, -0.2 + 0.1 * y) for x in range(5) for y in range(5)}
    assert {height for height, _ in cells.values()} == {0.0, 0.45, 0.45 * 1.9}
    assert {roughness for _, roughness in cells.values()} == {0.1}
    other = Room(ROOM.obstacles, 4)
    assert any(other.surface(3.8 + 0.1 * x, -0.2 + 0.1 * y) != cells[x, y] for x, y in cells)


def test_beams_end_on_the_surface_that_they_meet() -> None:
    """Straight down on the table; slanted past its edge onto the floor, and from beside it onto the table."""
    assert ROOM.beam((2.0, 0.0, 1.4), (0.0, 0.0, -1.0)) == pytest.approx((0.65, 0.0))
    assert ROOM.beam((4.0, 0.0, 1.4), (0.0, 0.0, -1.0))[1] == 0.1
    slant = (math.sin(0.2), 0.0, -math.cos(0.2))
    assert ROOM.beam((2.55, 0.0, 1.4), slant)[0] == pytest.approx(1.4 / math.cos(0.2))
    assert ROOM.beam((1.35, 0.0, 1.4), slant)[0] == pytest.approx(0.65 / math.cos(0.2))


def test_sensors_without_noise_say_what_is_true() -> None:
    """At every second of the flight: force and attitude, height with its bias, distance along the tilted axis."""
    for second in range(int(TOUR.down_ns / S)):
        pose = TOUR.pose(second * S)
        imu = WORLD.measure("imu", "imu", 100 * second)
        assert imu is not None
        expected = [pose.specific_force + 0.1, pose.roll, pose.pitch, pose.roll_rate, pose.pitch_rate]
        np.testing.assert_allclose(imu, expected, rtol=0, atol=1e-12)
        shift = min(max(second - 2, 0), 1) * 0.2
        assert WORLD.bias("baro", second * S) == pytest.approx(0.35 + shift)
        barometer = WORLD.measure("baro", "barometer", 20 * second)
        assert barometer == pytest.approx(pose.position[2] + 0.35 + shift)
        height, ground, climb = WORLD.truth(second * S)
        assert (height, climb) == (pose.position[2], pose.velocity[2])
        distance = WORLD.measure("laser", "range", 20 * second)
        if abs(pose.pitch) < 1e-3:  # else the beam may meet another surface than the one straight below
            assert distance == pytest.approx((height - ground) / (math.cos(pose.roll) * math.cos(pose.pitch)))


def test_noise_resolution_and_range_of_sight() -> None:
    """Standard deviations within four standard errors; multiples of a centimetre; nothing beyond the farthest."""
    barometer = BarometerSensor(resolution=0, bias_walk=0)
    noisy = replace(WORLD, carried=(("imu", ImuSensor()), ("baro", barometer), ("laser", RangeSensor())))
    for agent, sensor, before_take_off, sizes in (
        ("imu", "imu", 200, [0.2, math.radians(0.5), math.radians(0.5), 0.02, 0.02]),
        ("baro", "barometer", 40, [0.2]),
    ):
        values = np.array([noisy.measure(agent, sensor, index) for index in range(before_take_off)])
        bound = 4 / math.sqrt(2 * len(values))
        np.testing.assert_allclose(values.std(axis=0) / sizes, 1, atol=bound)
    ranges = np.array([noisy.measure("laser", "range", index) for index in range(150)])
    np.testing.assert_allclose(ranges * 100, np.round(ranges * 100), atol=1e-9)
    short = replace(noisy, carried=(("laser", RangeSensor(farthest=1.0)),))
    seen = [short.measure("laser", "range", index) for index in range(200)]
    assert seen[0] is not None
    assert seen[180] is None
    weak = replace(noisy, carried=(("imu", ImuSensor(saturation=9.85)),))
    forces = np.array([weak.measure("imu", "imu", index) for index in range(300)])[:, 0]
    assert forces.max() == 9.85


def test_samples_are_functions_of_seed_and_index() -> None:
    """Whatever was asked before, and through a pickle; another seed or agent has other noise."""
    first = AltitudeWorld(TOUR, ROOM, (("a", RangeSensor(resolution=0)), ("b", RangeSensor(resolution=0))), 3)
    indices = [170, 130, 250, 170]
    taken = [first.measure("a", "range", index) for index in indices]
    again = pickle.loads(pickle.dumps(first))  # noqa: S301 - our own bytes
    for index, value in zip(indices, taken, strict=True):
        np.testing.assert_array_equal(again.measure("a", "range", index), value)
        assert first.measure("b", "range", index) != value
        assert replace(first, seed=4).measure("a", "range", index) != value


def test_walks_have_unit_variance_a_second() -> None:
    """Over 400 agents the increments of a second are standard normal, within four standard errors; it is continuous."""
    ends = np.array([[walk(1, "walk", str(agent), second * S) for second in (0, 1, 9)] for agent in range(400)])
    assert (ends[:, 0] == 0).all()
    assert ends[:, 1].std() == pytest.approx(1, abs=4 / math.sqrt(800))
    assert (ends[:, 2] - ends[:, 1]).std() == pytest.approx(math.sqrt(8), abs=4 * math.sqrt(8) / math.sqrt(800))
    assert walk(1, "walk", "1", 3 * S - 1) == pytest.approx(walk(1, "walk", "1", 3 * S), abs=1e-8)


SPEC: dict[str, Any] = {
    "kind": "altitude",
    "flight": {"waypoints": [["0 m", "0 m"], ["4 m", 0]], "altitude": "1.5 m", "take_off": "3 s", "drop": "10 cm"},
    "obstacles": [{"platform": {"centre": ["0 m", "0 m"]}}, {"chair": {"centre": ["2 m", "0 m"], "height": "40 cm"}}],
    "sensors": {"imu": "imu", "baro": {"barometer": {"bias": "10 cm", "bias_walk": "1 cm/√s"}}, "laser": "range"},
}
AGENTS = ("hub", "imu", "baro", "laser")


def test_a_mapping_becomes_the_world_that_it_says() -> None:
    """The ground at take-off and landing is what stands there."""
    world = build(SPEC, {}, 7, AGENTS)
    obstacles = (
        Obstacle((0.0, 0.0), (1.4, 1.4), 0.47),
        Obstacle((2.0, 0.0), (0.5, 0.5), 0.4, uneven=True, roughness=0.1),
    )
    tour = Tour(((0.0, 0.0), (4.0, 0.0)), (0.47, 0.0), altitude=1.5, take_off=3.0, drop=0.1)
    carried = (("imu", ImuSensor()), ("baro", BarometerSensor(bias=0.1, bias_walk=0.01)), ("laser", RangeSensor()))
    assert world == AltitudeWorld(tour, Room(obstacles, 7), carried, 7)
    assert world.sensors("baro") == {"barometer": 20.0}
    assert world.sensors("hub") == {}


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("flihgt", {}, r"world.flihgt: unknown field \(did you mean 'flight'\?\)"),
        (
            "flight",
            {"waypoints": []},
            r"world.flight.waypoints: no waypoint: write a list of points, as in \[\[0 m, 0 m\], \[4 m, 0 m\]",
        ),
        ("flight", {"waypoints": [["0 m", "0 m"]]}, "world.flight: .* at least two are needed"),
        ("flight", {"waypoints": [[0, 0], ["1 m"]]}, "world.flight.waypoints.1.1: is missing"),
        ("flight", {"waypoints": [[0, 0], ["1 m", 0]], "speed": 3}, "world.flight.speed: 3 has no unit"),
        ("obstacles", {"table": {}}, r"world.obstacles: should be a list, not \{'table': \{\}\}"),
        ("obstacles", [{"sofa": {}}], r"world.obstacles.0: unknown obstacle 'sofa' \(known: chair, platform, table\)"),
        ("obstacles", ["table"], "world.obstacles.0.centre: is missing"),
        ("obstacles", [{"table": {"centre": [0, 0], "height": 0}}], "world.obstacles.0.table: .* must be above 0"),
        ("obstacles", [{"table": {"centre": [0, 0], "height": "2 m"}}], "world.* altitude is 1.4 m"),
        ("obstacles", [{"table": {"centre": ["3 m", 0], "height": "2 m"}}], "an obstacle reaches 2 m, .* fly higher"),
        ("sensors", {}, "world: no sensor"),
        ("sensors", {"bro": "barometer"}, r"world.sensors.bro: there is no agent 'bro' \(did you mean 'baro'\?\)"),
        (
            "sensors",
            {"baro": "altimeter"},
            r"world.sensors.baro: unknown sensor 'altimeter' \(did you mean 'barometer'\?\)",
        ),
        ("sensors", {"baro": {"barometer": {"noise": "-1 m"}}}, "world.sensors.baro.barometer: .* none is below 0"),
        ("sensors", {"laser": {"range": {"rate": 0}}}, "world.sensors.laser.range: rate is 0 Hz"),
        ("sensors", {"imu": {"imu": {"saturation": "9 m/s²"}}}, "saturation is 9 m/s², it must be above 9.81"),
    ],
)
def test_what_makes_no_sense_is_refused(field: str, value: object, message: str) -> None:
    """At its place, with the remedy."""
    spec = {**SPEC, "obstacles": [], "flight": {"waypoints": [[0, 0], ["4 m", 0]]}, field: value}
    with pytest.raises(BadInput, match=message):
        build(spec, {}, 7, AGENTS)


def test_a_sensor_that_nobody_has_is_refused() -> None:
    """With those that there are."""
    with pytest.raises(BadInput, match=r"agent imu has no sensor 'range': there are imu\.imu, baro\.barometer"):
        WORLD.measure("imu", "range", 0)
    assert WORLD.bias("imu", 0) is None
    assert period_ns(WORLD.sensors("laser")["range"], 20) == S
