"""The quadrotor: its motion obeys mechanics, and its sensors see that motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from volery.errors import BadInput
from volery.rotations import conjugate, log_quaternion, quaternion_product, quaternion_to_euler
from volery.worlds.quadrotor.flight import GRAVITY, Airframe, Flight, Manoeuvre
from volery.worlds.quadrotor.quadrotor_sensors import DEVIATIONS, FIELD, RANGES, QuadrotorWorld
from volery.worlds.signals import Constant, Ramp, Steps

from ...surroundings import build_world as build

SECOND = 1_000_000_000
INSTANTS = [5 * SECOND + 137_000_000, 5 * SECOND + 400_000_000, 7 * SECOND]
EVERYTHING = Manoeuvre(
    Steps((0, 5 * SECOND), (0.0, 0.1)),
    Steps((0, 5 * SECOND), (0.0, -0.07)),
    Steps((0, 5 * SECOND), (0.0, 0.3)),
    Ramp(10.0, 11.0, 5 * SECOND, SECOND),
)
ALL = {"body": tuple(DEVIATIONS)}


def world(manoeuvre: Manoeuvre = EVERYTHING, **changes: Any) -> QuadrotorWorld:
    """A quadrotor with all sensors on one agent, without noise unless asked for."""
    return QuadrotorWorld(manoeuvre, ALL, **{"seed": 3, "noise": 0.0, **changes})


def test_hovering_is_an_equilibrium() -> None:
    """Nothing asked for, nothing happens: level and at rest 10 m high, each sensor says so."""
    hovering = world(Manoeuvre())
    assert hovering.truth(3 * SECOND) == pytest.approx([1, 0, 0, 0, 0, 0, 0, -10.0], abs=1e-12)
    motion = hovering.motion(3 * SECOND)
    readings = {sensor: hovering.reading(sensor, motion) for sensor in DEVIATIONS}
    expected = {"gyroscope": [0, 0, 0], "accelerometer": [0, 0, -GRAVITY], "magnetometer": FIELD, "flow": [0, 0]}
    for sensor, reading in readings.items():
        assert reading == pytest.approx(expected.get(sensor, [10.0]), abs=1e-12)


def test_the_controller_reaches_what_is_asked() -> None:
    """Five seconds after the steps, 15 time constants of the slowest loop, attitude and altitude are there."""
    motion = world().motion(15 * SECOND)
    assert quaternion_to_euler(motion.attitude) == pytest.approx([0.1, -0.07, 0.3], abs=1e-5)
    assert motion.height == pytest.approx(11.0, abs=1e-5)


@pytest.mark.parametrize("instant", INSTANTS)
def test_the_motion_obeys_its_kinematics(instant: int) -> None:
    """Rates, acceleration and climb are the central differences of attitude, velocity and altitude over 1 ms.

    Their truncation is a third derivative, here below 300 /s³, times (1 ms)² / 6: 5e-5.
    """
    flown, half = world(), 1_000_000
    before, now, after = (flown.motion(instant + shift) for shift in (-half, 0, half))
    turned = log_quaternion(quaternion_product(conjugate(before.attitude), after.attitude))
    assert turned / 2e-3 == pytest.approx(now.rates, abs=5e-5)
    assert (after.velocity - before.velocity) / 2e-3 == pytest.approx(now.acceleration, abs=5e-5)
    assert (before.height - after.height) / 2e-3 == pytest.approx(now.velocity[2], abs=5e-5)


def test_the_specific_force_is_the_rotors() -> None:
    """Nothing but the rotors pushes, along the body's axis: sideways an accelerometer reads zero at any tilt."""
    flown = world()
    for instant in INSTANTS:
        reading = flown.reading("accelerometer", flown.motion(instant))
        assert reading is not None
        assert reading[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
        assert reading[2] < -0.5 * GRAVITY


def test_the_motion_does_not_depend_on_what_was_asked_before() -> None:
    """Late before early, on the grid or off it: the same bits."""
    late, early = INSTANTS[2] + 1_234_567, INSTANTS[0] + 7
    one, other = Flight(Airframe(), EVERYTHING), Flight(Airframe(), EVERYTHING)
    answers = [one.at(late), one.at(early)], [other.at(early), other.at(late)][::-1]
    for first, second in zip(*answers, strict=True):
        assert (first.attitude == second.attitude).all()
        assert (first.velocity == second.velocity).all()


def test_a_range_sensor_sees_where_its_axis_meets_the_ground() -> None:
    """From the sensor's place, along the body's downward axis for as far as it says, one is on the ground."""
    flown = world()
    motion = flown.motion(INSTANTS[1])
    for sensor, (forward, right) in RANGES.items():
        reading = flown.reading(sensor, motion)
        assert reading is not None
        down = motion.rotation @ (np.array([0.7 * forward, 0.7 * right, 0.0]) + reading * [0.0, 0.0, 1.0])
        assert down[2] - motion.height == pytest.approx(0.0, abs=1e-12)


def test_the_flow_is_the_velocity_of_the_camera() -> None:
    """Across the body's axis, turning included: central differences of the camera's path, in body coordinates."""
    flown, half = world(flow_at=(0.3, -0.2, 0.1)), 1_000_000
    before, now, after = (flown.motion(INSTANTS[1] + shift) for shift in (-half, 0, half))
    swing = (after.rotation - before.rotation) @ np.array(flown.flow_at) / 2e-3
    seen = now.rotation.T @ (now.velocity + swing)
    assert flown.reading("flow", now) == pytest.approx(seen[:2], abs=5e-5)


def test_as_printed_a_lateral_acceleration_counts_twice_and_all_ranges_are_one() -> None:
    """(13) to the letter reads 2 g sin φ in a steady roll; (17) to the letter gives five equal distances."""
    rolled = world(Manoeuvre(roll=Constant(0.1)), as_printed=("accelerometer", "range"))
    motion = rolled.motion(0)
    reading = rolled.reading("accelerometer", motion)
    assert reading is not None
    assert reading[1] == pytest.approx(2.0 * GRAVITY * math.sin(0.1), abs=1e-12)
    ranges = [rolled.reading(sensor, motion) for sensor in RANGES]
    assert ranges == [pytest.approx([10.0 / math.cos(0.1)], abs=1e-12)] * 5


def test_rotors_give_what_is_asked_within_their_strength() -> None:
    """Mixing undoes itself where no rotor is at a bound, and no rotor goes beyond one."""
    airframe = Airframe()
    thrust, torque = airframe.wrench(airframe.rotors(9.0, (0.3, -0.2, 0.05)))
    assert (thrust, *torque) == pytest.approx((9.0, 0.3, -0.2, 0.05), abs=1e-12)
    assert airframe.rotors(0.0, (50.0, 0.0, 0.0)) == (0.0, 0.0, 0.0, airframe.strongest)


def test_noise_is_that_of_the_table_and_a_function_of_seed_and_index() -> None:
    """2,000 draws a component: their deviation within 5 standard errors, 1/√(2·2000) each, of Table I."""
    noisy, still = world(Manoeuvre(), noise=1.0), world(Manoeuvre())
    for sensor, deviation in DEVIATIONS.items():
        draws = np.array(
            [noisy.measure("body", sensor, index) - still.measure("body", sensor, index) for index in range(2000)]  # type: ignore[operator]
        )
        assert draws.std(axis=0) == pytest.approx(deviation, rel=5 / math.sqrt(4000))
    assert (noisy.measure("body", "flow", 9) == world(Manoeuvre(), noise=1.0).measure("body", "flow", 9)).all()  # type: ignore[union-attr]
    assert (noisy.measure("body", "flow", 9) != world(Manoeuvre(), noise=1.0, seed=4).measure("body", "flow", 9)).all()  # type: ignore[union-attr]


def test_a_sensor_that_looks_up_sees_nothing() -> None:
    """Upside down there is no range."""
    flown = world()
    motion = flown.motion(0)
    upside_down = type(motion)(**{**vars(motion), "rotation": np.diag([1.0, -1.0, -1.0])})
    assert flown.reading("range_centre", upside_down) is None


SPEC: dict[str, Any] = {"kind": "quadrotor", "sensors": {"imu": ["gyroscope", "accelerometer"], "eye": "flow"}}


def test_a_scenario_says_who_carries_what() -> None:
    """Sensors, rates, signals and switches as they are written; an agent that is not named carries nothing."""
    ramp = {"ramp": {"from": "10 m", "to": "11 m", "at": "5 s", "over": "1 s"}}
    spec = {**SPEC, "altitude": ramp, "rates": {"flow": "50 Hz"}, "noise": 2, "as_printed": "range"}
    built = build(spec, {}, 5, ["eye", "hub", "imu"])
    assert built.sensors("imu") == {"gyroscope": 100.0, "accelerometer": 100.0}
    assert built.sensors("eye") == {"flow": 50.0}
    assert built.sensors("hub") == {}
    assert built.manoeuvre.altitude == Ramp(10.0, 11.0, 5 * SECOND, SECOND)
    assert (built.noise, built.as_printed, built.seed) == (2.0, ("range",), 5)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"sensors": {}}, r"world.sensors: write at least one agent and what it carries, as in \{flow: \[flow\]\}"),
        ({"sensors": {"imu": []}}, "world: no sensor: give at least one agent one of gyroscope, acc"),
        ({"sensors": {"imu": ["gyroscpe"]}}, "did you mean 'gyroscope'"),
        ({"sensors": {"iMu": "flow"}}, "did you mean 'imu'"),
        ({"sensors": {"imu": "flow", "eye": "flow"}}, "sensor flow is there 2 times"),
        (
            {"sensors": {"imu": 3}},
            "world.sensors.imu: 3 is none of gyroscope, accelerometer, magnetometer, flow, range_centre",
        ),
        ({"rate": "0 Hz"}, "world.rate: rate is 0 Hz, it must be above 0"),
        ({"rates": "50 Hz"}, "world.rates: should be a mapping of fields, not '50 Hz'"),
        (
            {"sensors": {"imu": "gyroscope"}, "rates": {"flow": "50 Hz"}},
            "world.rates.flow: is of a sensor that no agent carries: leave it out, or add flow to senso",
        ),
        (
            {"sensors": {"imu": "gyroscope"}, "flow_at": [0, 0, 0]},
            "world.flow_at: is of a sensor that no agent carries: leave it out, or add flow to sensors",
        ),
        ({"noise": -1}, "noise is -1 times"),
        ({"noise": "1 m"}, "world.noise: should be a valid number, not '1 m'"),
        ({"arm": "0 m"}, "arm is 0, it must be above 0"),
        ({"flow_at": ["0 m", "0 m"]}, "world.flow_at"),
        ({"roll": "70 deg"}, "roll goes to 1.22173 rad: keep it within 1 rad"),
        ({"altitude": "0 m"}, "altitude goes down to 0 m"),
        ({"altitude": {"ramp": {"from": "1 m", "to": "2 m", "at": "1 s", "over": 0}}}, "must last for some time"),
        ({"altitude": {"ramp": {"from": "1 m", "to": "2 m", "at": "1 s"}}}, "world.altitude.ramp.over: is missing"),
        ({"as_printed": ["rnge"]}, "did you mean 'range'"),
    ],
)
def test_what_cannot_be_flown_is_refused(changes: dict[str, Any], said: str) -> None:
    """Each with its place and the remedy."""
    with pytest.raises(BadInput, match=said.replace("(", r"\(").replace("?", r"\?")):
        build({**SPEC, **changes}, {}, 5, ["eye", "imu"])


def test_a_sensor_that_an_agent_does_not_carry_is_refused() -> None:
    """The message says what it has."""
    with pytest.raises(BadInput, match="agent hub has no sensor 'flow': it has none"):
        world().measure("hub", "flow", 0)


@pytest.mark.parametrize("changes", [{"mass": 3.0}, {"inertia": (0.0, 1.0, 1.0)}, {"arm": math.inf}, {"turn": 0.0}])
def test_what_cannot_fly_is_refused(changes: dict[str, Any]) -> None:
    """Too heavy, without inertia, boundless, or without a way to turn."""
    with pytest.raises(BadInput):
        Airframe(**changes)
