"""A body that turns, the units on it, and the scenario's way to write them."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from volery.errors import BadInput
from volery.rotations import angle_between, euler_to_quaternion, quaternion_product, quaternion_rate, rotate
from volery.worlds.rigid_body.body import RigidBody, Turning
from volery.worlds.rigid_body.measurement_units import DIRECTIONS, MeasurementUnit, RigidBodyWorld
from volery.worlds.signals import Constant, Sine

from ...surroundings import build_world as build

SECOND = 1_000_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)
INERTIA = (0.02, 0.03, 0.04)
STILL = (Constant(0.0), Constant(0.0), Constant(0.0))
TUMBLING = RigidBody(INERTIA, LEVEL, (0.5, 0.3, -0.4), STILL)
DRIVEN = replace(TUMBLING, torque=(Sine(0.01, 0.2, 0.0), Constant(-0.002), Sine(0.02, 0.3, 0.001, 1.0)))
QUARTERS = math.radians(135)
UNITS = {
    "1": MeasurementUnit((QUARTERS, 0.0, 0.0), 0.02),
    "2": MeasurementUnit((0.0, QUARTERS, 0.0), 0.03),
    "3": MeasurementUnit((0.0, 0.0, QUARTERS), 0.04, ("magnetometer",)),
}
WORLD = RigidBodyWorld(DRIVEN, UNITS, seed=5)


def test_without_a_torque_energy_and_momentum_stay() -> None:
    """½ ω·Jω, and Jω as seen from outside, after a minute of tumbling; the rule's error at 0.7 rad/s is below 10⁻⁹."""
    turning = Turning(TUMBLING)

    def constants(time_ns: int) -> list[float]:
        state = turning.at(time_ns)
        momentum = np.array(INERTIA) * state[4:]
        return [0.5 * float(momentum @ state[4:]), *rotate(state[:4], momentum)]

    np.testing.assert_allclose(constants(60 * SECOND), constants(0), rtol=1e-9)
    assert angle_between(turning.at(60 * SECOND)[:4], turning.at(0)[:4]) > 0.1


def test_under_torques_it_turns_as_an_independent_integration_has_it() -> None:
    """SciPy's DOP853 at a tolerance of 10⁻¹², from (25) and (26) written with arrays."""
    J = np.array(INERTIA)

    def slope(time_s: float, state: np.ndarray) -> np.ndarray:
        torque = [signal.value(round(time_s * 1e9)) for signal in DRIVEN.torque]
        omega = state[4:]
        return np.concatenate([quaternion_rate(state[:4], omega), (torque - np.cross(omega, J * omega)) / J])

    found = solve_ivp(slope, (0, 20), [*LEVEL, *DRIVEN.rates], "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(Turning(DRIVEN).at(20 * SECOND), found, atol=1e-8)


def test_a_constant_torque_about_one_axis_is_known_in_closed_form() -> None:
    """ω = Γ t / J and half of it times t as the angle, from a level start."""
    body = RigidBody(INERTIA, LEVEL, (0.0, 0.0, 0.0), (Constant(0.0), Constant(0.0), Constant(0.002)))
    state = Turning(body).at(10 * SECOND)
    np.testing.assert_allclose(state[4:], [0.0, 0.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(state[:4], euler_to_quaternion(0.0, 0.0, 2.5), atol=1e-9)


def test_the_motion_does_not_depend_on_what_was_asked_before() -> None:
    """Between points of the grid too, where one shorter step is taken."""
    times = [7, 3 * SECOND + 1, 20_000_000, 2 * SECOND + 12_345_678, 0]
    once = Turning(DRIVEN)
    for time_ns in times:
        np.testing.assert_array_equal(once.at(time_ns), Turning(DRIVEN).at(time_ns))
    np.testing.assert_allclose(once.at(39_999_999), once.at(40_000_000), atol=1e-8)


@pytest.mark.parametrize("agent", ["1", "2", "3"])
def test_without_noise_a_unit_sees_the_directions_in_its_own_frame(agent: str) -> None:
    """Turned by mounting and attitude they are gravity and field; the mountings of Table 1 are turns by 135°."""
    world = replace(WORLD, units={agent: replace(UNITS[agent], noise=0.0)})
    mounting = euler_to_quaternion(*UNITS[agent].mounting)
    table = np.zeros(4)
    table[0], table[int(agent)] = 0.3827, 0.9239
    np.testing.assert_allclose(mounting, table, atol=5e-5)
    for sensor in world.sensors(agent):
        frame = quaternion_product(world.attitude(7 * SECOND // 10), mounting)
        seen = rotate(frame, world.measure(agent, sensor, 7))
        np.testing.assert_allclose(seen, DIRECTIONS[sensor], atol=1e-14)


def test_the_directions_are_those_of_the_paper() -> None:
    """Gravity along z, and the field of Sec. 3.1, whose norm there is 0.4844."""
    np.testing.assert_array_equal(DIRECTIONS["accelerometer"], [0.0, 0.0, 1.0])
    np.testing.assert_allclose(np.array(DIRECTIONS["magnetometer"]) * 0.48442, [0.337, 0.0, 0.348], atol=1e-5)


def test_noise_has_the_stated_scatter_in_each_unit_and_nothing_in_common() -> None:
    """1500 samples a component: standard deviations within 5 standard errors, correlations below 5/√1500."""
    still = replace(WORLD, body=replace(TUMBLING, rates=(0.0, 0.0, 0.0)))
    columns = []
    for agent, sensor in (("1", "accelerometer"), ("1", "magnetometer"), ("2", "accelerometer")):
        quiet = replace(still, units={agent: replace(UNITS[agent], noise=0.0)}).measure(agent, sensor, 0)
        noise = np.array([still.measure(agent, sensor, index) - quiet for index in range(1500)])
        np.testing.assert_allclose(noise.std(axis=0) / UNITS[agent].noise, 1.0, atol=5 / math.sqrt(2 * 1500))
        assert (np.abs(noise.mean(axis=0)) < 5 * UNITS[agent].noise / math.sqrt(1500)).all()
        columns.append(noise)
    together = np.corrcoef(np.concatenate(columns, axis=1).T)
    assert np.abs(together - np.eye(9)).max() < 5 / math.sqrt(1500)


def test_a_sample_is_a_function_of_seed_agent_sensor_and_index() -> None:
    """In another order, in a pickled copy, without the other units: the same bits. Another seed: others."""
    copy = pickle.loads(pickle.dumps(WORLD))  # noqa: S301 - our own bytes
    alone = replace(WORLD, units={"2": UNITS["2"]})
    for index in (40, 3, 17):
        expected = WORLD.measure("2", "magnetometer", index)
        for world in (copy, alone):
            np.testing.assert_array_equal(world.measure("2", "magnetometer", index), expected)
        assert (replace(WORLD, seed=6).measure("2", "magnetometer", index) != expected).all()


def test_agents_without_a_unit_or_a_sensor_have_none() -> None:
    """A relay senses nothing; to ask it nevertheless is refused."""
    assert WORLD.sensors("4") == {}
    assert WORLD.sensors("3") == {"magnetometer": 10.0}
    for agent, has in (("4", "it has none"), ("3", "it has magnetometer")):
        with pytest.raises(BadInput, match=f"agent {agent} has no sensor 'accelerometer': {has}"):
            WORLD.measure(agent, "accelerometer", 0)


def test_a_full_mapping_becomes_the_world_that_it_says() -> None:
    """Quantities arrive in SI units, angles of Euler as a quaternion."""
    found = build(
        {
            "kind": "rigid-body",
            "inertia": ["20 g m²", "0.03 kg m²", "0.04 kg m2"],
            "attitude": ["30 deg", "30 deg", 0],
            "rates": [0, 0, "1 deg/s"],
            "torque": [0, "1 mN m", {"sine": {"amplitude": "0.002 N m", "frequency": "0.1 Hz"}}],
            "rate": "20 Hz",
            "units": {2: {"noise": "0.03 rad", "sensors": ["magnetometer"]}, "1": {"mounting": ["135 deg", 0, 0]}},
        },
        {},
        3,
        ["1", "2", "3"],
    )
    w, x, y, z = euler_to_quaternion(math.pi / 6, math.pi / 6, 0.0).tolist()
    torque = (Constant(0.0), Constant(0.001), Sine(0.002, 0.1, 0.0))
    body = RigidBody(INERTIA, (w, x, y, z), (0.0, 0.0, math.radians(1)), torque)
    units = {
        "1": MeasurementUnit((QUARTERS, 0.0, 0.0)),
        "2": MeasurementUnit(noise=0.03, sensors=("magnetometer",)),
    }
    assert found == RigidBodyWorld(body, units, 3, 20.0)


def test_what_is_left_out_has_the_documented_defaults() -> None:
    """A level body at rest, no torque, 10 Hz, an aligned unit with both sensors and no noise."""
    found = build({"kind": "rigid-body", "units": {"1": {}}}, {}, 1, ["1"])
    assert found == RigidBodyWorld(RigidBody(INERTIA, LEVEL, (0, 0, 0), STILL), {"1": MeasurementUnit()}, 1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"unit": {}}, r"world.unit: unknown field \(did you mean 'units'\?\)"),
        ({"units": {}}, "world: no unit has a sensor"),
        ({"units": {"1": {"sensors": []}}}, "world: no unit has a sensor, so nothing tells the attitude"),
        ({"units": [1]}, r"world.units: should be a mapping of fields, not \[1\]"),
        ({"units": {"1": "noisy"}}, "world.units.1: should be a mapping of fields, not 'noisy'"),
        ({"units": {"9": {}}}, r"world.units.9: there is no agent '9' \(known: 1, 2\)"),
        ({"units": {"1": {"noize": 0}}}, r"world.units.1.noize: unknown field \(did you mean 'noise'\?\)"),
        ({"units": {"1": {"noise": "-1 deg"}}}, "world.units.1: noise is -0.0174533 rad, it must be at least 0"),
        (
            {"units": {"1": {"sensors": ["gyro"]}}},
            "world.units.1.sensors.0: 'gyro' is none of accelerometer, magnetometer",
        ),
        ({"units": {"1": {"sensors": "magnetometer"}}}, "world.units.1.sensors: should be a list, not 'magnetometer'"),
        ({"units": {"1": {"sensors": ["magnetometer"] * 2}}}, "world.units.1: sensor magnetometer is there twice"),
        ({"units": {"1": {"mounting": ["1 deg", 0]}}}, "world.units.1.mounting.2: is missing"),
        ({"units": {"1": {"mounting": ["1 m", 0, 0]}}}, "world.units.1.mounting.0: '1 m' is not a quantity here"),
        ({"inertia": ["1 kg m²", "1 kg m²", "3 kg m²"]}, "world: inertia 1, 1, 3 kg m²: .* larger than the others"),
        ({"inertia": [0, "1 kg m²", "1 kg m²"]}, "world: inertia 0, 1, 1 kg m²: moments are above 0"),
        ({"torque": [0, 0, "1 N"]}, "world.torque.2: '1 N' is not a quantity here"),
        ({"rates": "fast"}, "world.rates: should be a list, not 'fast'"),
        ({"rate": 0}, "world.rate: rate is 0 Hz, it must be above 0"),
    ],
)
def test_what_is_wrong_is_named_with_its_place_and_remedy(change: dict[str, Any], message: str) -> None:
    """Unknown words, other units, values out of bounds, bodies that cannot be, nothing to learn from."""
    with pytest.raises(BadInput, match=message):
        build({"kind": "rigid-body", "units": {"1": {}}} | change, {}, 1, ["1", "2"])


def test_units_are_needed() -> None:
    """The message names what is missing."""
    with pytest.raises(BadInput, match=r"world\.units: is missing"):
        build({"kind": "rigid-body"}, {}, 1, ["1"])


def test_an_attitude_that_is_no_rotation_is_refused() -> None:
    """A quaternion that is not of norm 1."""
    with pytest.raises(BadInput, match="attitude of the body: a quaternion has norm 1"):
        replace(TUMBLING, attitude=(1.0, 0.1, 0.0, 0.0))
