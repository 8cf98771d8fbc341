"""Worlds from a scenario's mapping."""

import math
from typing import Any

import pytest

from volery.errors import BadInput
from volery.worlds.plane.distance_sensors import GaussianDistance, Infrared
from volery.worlds.plane.plane_world import PlaneWorld
from volery.worlds.signals import Constant, Sine, Steps

from ..surroundings import build_world as build

PLACES = {"1": (0.0, 0.0), "2": (0.25, 0.0)}


def test_a_full_mapping_becomes_the_world_that_it_says() -> None:
    """Quantities arrive in metres, radians, hertz and nanoseconds; steps may be written in any order."""
    found = build(
        {
            "kind": "plane",
            "altitude": {"steps": {"5 s": "20 cm", "0 s": "0.1 m"}},
            "roll": "5 deg",
            "pitch": {"sine": {"mean": "1 deg", "amplitude": "5 deg", "frequency": "0.5 Hz", "phase": "90 deg"}},
            "rate": "10 Hz",
            "sensor": {"infrared": {"noise": "10 mV"}},
        },
        PLACES,
        seed=3,
    )
    degree = math.pi / 180
    expected = PlaneWorld(
        altitude=Steps((0, 5_000_000_000), (0.1, 0.2)),
        roll=Constant(5 * degree),
        pitch=Sine(5 * degree, 0.5, 1 * degree, 90 * degree),
        positions=PLACES,
        sensor=Infrared(0.01),
        seed=3,
        rate=10.0,
    )
    assert found == expected


def test_what_is_left_out_has_the_documented_defaults() -> None:
    """Level, 20 Hz, Gaussian noise of 5 mm; 0 needs no unit."""
    level = PlaneWorld(Constant(0.2), Constant(0.0), Constant(0.0), PLACES, GaussianDistance(0.005), 1, 20.0)
    assert build({"kind": "plane", "altitude": "0.2 m"}, PLACES, 1) == level
    assert build({"kind": "plane", "altitude": "0.2 m", "roll": 0, "pitch": "0 deg"}, PLACES, 1) == level
    quiet = build({"kind": "plane", "altitude": "0.2 m", "distance_noise": 0}, PLACES, 1)
    assert isinstance(quiet, PlaneWorld)
    assert quiet.sensor == GaussianDistance(0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"altitde": "0.2 m"}, r"world.altitde: unknown field \(did you mean 'altitude'\?\)"),
        ({"kind": "plain"}, r"world.kind: unknown world kind 'plain' \(did you mean 'plane'\?\)"),
        ({"altitude": "0.2 s"}, "world.altitude: '0.2 s' is not a quantity here"),
        ({"altitude": 0.2}, "world.altitude: 0.2 has no unit"),
        ({"altitude": "-0.2 m"}, "world: altitude goes down to -0.2 m"),
        ({"altitude": {"steps": {"1 s": "0.2 m"}}}, "world.altitude.steps: steps at .* must begin at 0"),
        ({"altitude": {"steps": {"0 s": "0.2 m", "0 ms": "1 m"}}}, "world.altitude.steps: steps at .* ascend"),
        ({"altitude": {"steps": {}}}, "world.altitude.steps: steps at .* must begin at 0"),
        ({"altitude": {"step": {"0 s": "0.2 m"}}}, r"world.altitude: unknown signal 'step' \(did you mean 'steps'\?\)"),
        ({"altitude": {"steps": "0.2 m"}}, "world.altitude.steps: '0.2 m' must be a mapping"),
        ({"altitude": {}}, r"world.altitude: write a value, or exactly one of constant, steps, ramp, sine, not \{\}"),
        ({"pitch": {"sine": {"amplitude": "5 deg"}}}, "world.pitch.sine.frequency: is missing"),
        ({"pitch": {"sine": {"amplitude": "5 deg", "frequency": 0}}}, "world.pitch.sine: frequency 0.0 Hz"),
        ({"pitch": {"sine": {"amplitudes": "5 deg"}}}, "world.pitch.sine.amplitude: is missing"),
        ({"roll": "95 deg"}, "world: roll reaches 95 deg"),
        ({"roll": "1e999 deg"}, "world.roll: '1e999 deg' is not finite"),
        ({"rate": "-5 Hz"}, "world.rate: rate is -5 Hz, it must be above 0"),
        ({"distance_noise": "-5 mm"}, "world.distance_noise: noise -0.005 m must be at least 0"),
        ({"distance_noise": "5 mm", "sensor": {"infrared": {"noise": "1 mV"}}}, "not both"),
        ({"sensor": "infrared"}, "world.sensor.noise: is missing"),
        ({"sensor": {"infra": {}}}, r"world.sensor: unknown distance sensor 'infra' \(did you mean 'infrared'\?\)"),
        ({"sensor": {"infrared": "10 m"}}, "world.sensor.infrared: '10 m' is not a quantity here"),
        ({"sensor": {"infrared": {}}}, "world.sensor.infrared.noise: is missing"),
        ({"sensor": {"infrared": {"noise": "2 V"}}}, "world.sensor.infrared: noise 2.0 V must be from 0 to 0.1 V"),
        ({"sensor": {"infrared": {"range": "1 m"}}}, "world.sensor.infrared.noise: is missing"),
    ],
)
def test_what_is_wrong_is_named_with_its_place_and_remedy(change: dict[str, Any], message: str) -> None:
    """Unknown words, missing ones, other units, values out of bounds."""
    with pytest.raises(BadInput, match=message):
        build({"kind": "plane", "altitude": "0.2 m"} | change, PLACES, 1)


@pytest.mark.parametrize("missing", ["kind", "altitude"])
def test_kind_and_altitude_are_needed(missing: str) -> None:
    """The message names what is missing."""
    spec = {"kind": "plane", "altitude": "0.2 m"}
    del spec[missing]
    with pytest.raises(BadInput, match=r"world(\.altitude)?: .*is missing"):
        build(spec, PLACES, 1)
