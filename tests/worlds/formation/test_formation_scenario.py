"""A formation from the `world:` mapping of a scenario."""

from __future__ import annotations

import math
from typing import Any

import pytest

from volery.errors import BadInput
from volery.worlds.formation.air import Gust, Random, Scripted, Turbulence
from volery.worlds.formation.camera import Camera
from volery.worlds.formation.formation_world import FormationWorld
from volery.worlds.formation.imu import Imu
from volery.worlds.formation.vehicles import Vehicle

from ...surroundings import build_world as build

AGENTS = ("1", "2", "3")
MS, SECOND = 1_000_000, 1_000_000_000

FULL: dict[str, Any] = {
    "start": {"line": "1 m", "turned": "90 deg"},
    "altitude": "2 m",
    "facing": "30 deg",
    "vehicle": {
        "mass": "500 g",
        "radius": "25 cm",
        "inertia": ["0.002 kg m²", "0.003 kg m2", "0.004 kg m²"],
        "attitude_response": "100 ms",
        "rate_response": "20 ms",
        "drag": "0.2 /s",
        "thrust_to_weight": 1.5,
        "tilt": "30 deg",
        "command_timeout": "0.5 s",
    },
    "camera": {
        "rate": "15 Hz",
        "horizontal": "60 deg",
        "vertical": "40 deg",
        "range": "3 m",
        "depth_noise": "1 cm",
        "lateral_noise": "5 mm",
        "orientation_noise": "2 deg",
        "misses": 0.1,
        "occlusion": False,
    },
    "imu": {
        "rate": "60 Hz",
        "gyro_noise": "1 deg/s",
        "accelerometer_noise": "0.2 m/s²",
        "magnetometer_noise": 0.02,
        "gyro_bias": "0.5 deg/s",
        "accelerometer_bias": "0.1 m/s²",
        "magnetometer_bias": 0.03,
        "miscalibration": "2 deg",
        "inclination": "70 deg",
    },
    "turbulence": {"acceleration": "0.3 m/s²", "correlation": "200 ms", "vertical": 0.5},
    "gusts": [{"start": "2 s", "duration": "500 ms", "acceleration": ["1 m/s²", 0, 0]}],
    "ground": True,
    "sense_delay": "2 ms",
    "act_delay": "3 ms",
    "steps": "100 Hz",
    "truth_rate": "10 Hz",
}
"""Everything that a scenario may write."""


def built(agents: tuple[str, ...] = AGENTS, **spec: Any) -> FormationWorld:
    """The world of a mapping, in a line unless it says otherwise."""
    found = build({"kind": "formation", "start": {"line": "1 m"}, **spec}, {}, 7, agents)
    assert isinstance(found, FormationWorld)
    return found


def test_defaults() -> None:
    """A start is enough: the vehicles hover at 1.5 m, each looks at the next and the last at the first."""
    found = built()
    assert found == FormationWorld(AGENTS, ((-1.0, 0.0, 1.5), (0.0, 0.0, 1.5), (1.0, 0.0, 1.5)), (0.0, 0.0, math.pi), 7)


def test_a_full_mapping_becomes_the_world_that_it_says() -> None:
    """Quantities arrive in metres, seconds, radians and nanoseconds."""
    found = built(**FULL)
    degree = math.pi / 180
    assert [place[1] for place in found.places] == pytest.approx([-1.0, 0.0, 1.0])
    expected = FormationWorld(
        AGENTS,
        found.places,
        (30 * degree,) * 3,
        7,
        Vehicle(0.5, 0.25, (0.002, 0.003, 0.004), 0.1, 0.02, 0.2, 1.5, 30 * degree, 500 * MS),
        Camera(15.0, 60 * degree, 40 * degree, 3.0, 0.01, 0.005, 2 * degree, 0.1, occlusion=False),
        Imu(60.0, degree, 0.2, 0.02, 0.5 * degree, 0.1, 0.03, 2 * degree, 70 * degree),
        Turbulence(0.3, 0.2, 0.5),
        Scripted((Gust(2 * SECOND, 500 * MS, (1.0, 0.0, 0.0)),)),
        ground=True,
        steps=100.0,
        sense_delay_ns=2 * MS,
        act_delay_ns=3 * MS,
        truth_rate=10.0,
    )
    assert found == expected


def test_where_vehicles_look() -> None:
    """At the centre of a ring, or at vehicles by name, and those that are not named at the next one."""
    ring = built(start={"ring": "1 m"}, facing="centre")
    for (x, y, _), heading in zip(ring.places, ring.headings, strict=True):
        assert (math.cos(heading), math.sin(heading)) == pytest.approx((-x * math.sqrt(3), -y * math.sqrt(3)))
    assert built(facing={1: 3, "3": "2"}).headings == pytest.approx((0.0, 0.0, math.pi))
    assert built(facing={2: 1}).headings == pytest.approx((0.0, math.pi, math.pi))


def test_random_gusts_and_absent_sensors() -> None:
    """A mapping in the place of the list; `none` in the place of a sensor's mapping."""
    found = built(
        gusts={"every": "10 s", "duration": "1 s", "acceleration": "2 m/s²"},
        camera="none",
        imu="none",
    )
    assert found.gusts == Random(10 * SECOND, SECOND, 2.0)
    assert found.sensors("1") == {}


def test_undisturbed_takes_away_all_that_is_random() -> None:
    """Noise, biases, misses, miscalibration, turbulence and gusts, whatever else is written."""
    found = built(undisturbed=True, camera={"misses": 0.5, "range": "4 m"}, gusts=[])
    assert found == built(
        camera={"range": "4 m", "depth_noise": 0, "lateral_noise": 0, "orientation_noise": 0, "misses": 0},
        imu={
            "gyro_noise": 0,
            "accelerometer_noise": 0,
            "magnetometer_noise": 0,
            "gyro_bias": 0,
            "accelerometer_bias": 0,
            "magnetometer_bias": 0,
            "miscalibration": 0,
        },
        turbulence={"acceleration": 0},
    )


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ({"start": {"triangle": "0.9 m", "ring": "1 m"}}, "world.start: triangle and ring"),
        ({"start": {"line": "30 cm"}}, "world: vehicles 1 and 2 begin 0.3 m apart"),
        ({"startt": 1}, "world.startt: unknown field (did you mean 'start'?)"),
        ({"altitude": "1"}, "world.altitude: '1' is not a quantity"),
        ({"facing": "sideways"}, "world.facing: 'sideways' is none of next, centre"),
        ({"facing": {1: 9}}, "world.facing.1: there is no agent '9' (known: 1, 2, 3)"),
        ({"facing": {1: 1}}, "world.facing.1: vehicle 1 cannot face itself"),
        ({"vehicle": {"mass": "1 m"}}, "world.vehicle.mass: '1 m' is not a quantity"),
        ({"vehicle": {"inertia": ["1 kg m²"]}}, "world.vehicle.inertia.1: is missing"),
        ({"vehicle": {"thrust_to_weight": "2"}}, "world.vehicle.thrust_to_weight: should be a valid number, not '2'"),
        ({"vehicle": {"tilt": "95 deg"}}, "world.vehicle: tilt is 95 deg"),
        ({"camera": {"misses": 2}}, "world.camera: camera.misses is 2, a probability lies between 0 and 1"),
        (
            {"camera": {"fov": "60 deg"}},
            "world.camera.fov: unknown field (known: depth_noise, horizontal, lateral_noise, misses, oc",
        ),
        ({"camera": {"occlusion": "yes"}}, "world.camera.occlusion: should be a valid boolean, not 'yes'"),
        ({"camera": 5}, "world.camera: 5 is none of none"),
        ({"imu": {"gyro_noise": "1 m"}}, "world.imu.gyro_noise: '1 m' is not a quantity"),
        ({"imu": {"rate": "0 Hz"}}, "world.imu: imu.rate is 0 Hz, it must be above 0 and finite"),
        (
            {"turbulence": {"sigma": 0}},
            "world.turbulence.sigma: unknown field (known: acceleration, correlation, vertical)",
        ),
        ({"gusts": "strong"}, "world.gusts: should be a list, not 'strong'"),
        ({"gusts": [{"start": "1 s"}]}, "world.gusts.0.duration: is missing"),
        ({"gusts": {"every": "1 s"}}, "world.gusts.duration: is missing"),
        ({"ground": 1}, "world.ground: should be a valid boolean, not 1"),
        ({"sense_delay": 0}, "world: sense_delay is 0 ns"),
    ],
)
def test_bad_input_is_refused_with_its_place(spec: dict[str, Any], said: str) -> None:
    """The message names the field, what is wrong and what to write."""
    with pytest.raises(BadInput) as refused:
        built(**spec)
    assert str(refused.value).startswith(said)


def test_a_formation_needs_a_start_and_company() -> None:
    """Without a shape, or with one vehicle, there is none."""
    with pytest.raises(BadInput, match=r"world\.start: is missing"):
        build({"kind": "formation"}, {}, 7, AGENTS)
    with pytest.raises(BadInput, match="at least 2 vehicles, not 1"):
        built(agents=("1",))
