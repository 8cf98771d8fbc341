"""The components of the altitude filter: their models are Bavle's, and their Jacobians are derivatives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.estimators.altitude.components import (
    GRAVITY,
    ROBOT_STATES,
    Barometer,
    Blocks,
    Component,
    Floats,
    Ground,
    Imu,
    RangeFinder,
    Robot,
    Sensor,
)

STATES = st.lists(st.floats(-0.4, 0.4), min_size=ROBOT_STATES, max_size=ROBOT_STATES).map(np.array)


def moved(part: Component, own: Floats, dt: float) -> tuple[Floats, Floats]:
    """The own states after dt and the Jacobian; arguments are untouched."""
    after, jacobian = own.copy(), np.eye(len(own))
    part.move(after, jacobian, dt)
    return after, jacobian


def expected(sensor: Sensor, robot: Floats, ground: float, own: Floats) -> tuple[Floats, Floats]:
    """What it would measure, and the Jacobian by (robot, ground, own)."""
    rows = len(sensor.variances())
    jacobian = np.zeros((rows, ROBOT_STATES + 1 + len(own)))
    blocks = Blocks(jacobian[:, :ROBOT_STATES], jacobian[:, ROBOT_STATES], jacobian[:, ROBOT_STATES + 1 :])
    return sensor.expected(robot, ground, own, blocks), jacobian


@given(STATES, st.floats(1e-3, 1.0))
def test_the_robot_moves_with_constant_acceleration_and_rates(own: Floats, dt: float) -> None:
    """(12)–(17), and it is linear."""
    z, v, a, roll, pitch, roll_rate, pitch_rate = own
    after, jacobian = moved(Robot(), own, dt)
    ahead = [z + v * dt + a * dt**2 / 2, v + a * dt, a, roll + roll_rate * dt, pitch + pitch_rate * dt]
    np.testing.assert_allclose(after, [*ahead, roll_rate, pitch_rate], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(after, jacobian @ own)


@pytest.mark.parametrize(("height", "after", "slope"), [(0.3, 0.3, 1.0), (0.0, 0.0, 0.0), (-0.2, 0.0, 0.0)])
def test_the_ground_is_clamped_at_the_floor(height: float, after: float, slope: float) -> None:
    """(19), with the derivative of its branch."""
    found, jacobian = moved(Ground(), np.array([height]), 0.01)
    assert (found[0], jacobian[0, 0]) == (after, slope)


@pytest.mark.parametrize("part", [Imu(), Barometer(), RangeFinder()])
def test_biases_move_by_noise_only(part: Component) -> None:
    """(21), (34); a range finder has none."""
    own = np.arange(float(len(part.states())))
    after, jacobian = moved(part, own, 0.5)
    np.testing.assert_array_equal(after, own)
    np.testing.assert_array_equal(jacobian, np.eye(len(own)))


@given(STATES, st.floats(0, 1))
def test_sensors_measure_what_the_paper_says(robot: Floats, ground: float) -> None:
    """(26), (28)–(32), (36), (38)."""
    z, _, a, roll, pitch, roll_rate, pitch_rate = robot
    imu, _ = expected(Imu(), robot, ground, np.array([0.3]))
    np.testing.assert_allclose(imu, [a + GRAVITY + 0.3, roll, pitch, roll_rate, pitch_rate], rtol=1e-15)
    barometer, _ = expected(Barometer(), robot, ground, np.array([0.3]))
    assert barometer == pytest.approx(z + 0.3)
    distance, _ = expected(RangeFinder(), robot, ground, np.zeros(0))
    assert distance == pytest.approx((z - ground) / (math.cos(roll) * math.cos(pitch)))


@pytest.mark.parametrize("sensor", [Imu(), Barometer(), RangeFinder()])
@given(robot=STATES, ground=st.floats(0, 1))
def test_jacobians_are_derivatives(sensor: Sensor, robot: Floats, ground: float) -> None:
    """Against central differences with h = 1e-5: error h²/6 · f''' + 1e-16/h, f''' below 50 within 0.4 rad: 1e-9."""
    own = np.full(len(sensor.states()), 0.2)
    point, step = np.array([*robot, ground, *own]), 1e-5
    _, jacobian = expected(sensor, robot, ground, own)

    def at(state: Floats) -> Floats:
        return expected(sensor, state[:ROBOT_STATES], state[ROBOT_STATES], state[ROBOT_STATES + 1 :])[0]

    columns = [(at(point + change) - at(point - change)) / (2 * step) for change in step * np.eye(len(point))]
    np.testing.assert_allclose(jacobian, np.array(columns).T, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("kind", "fields", "name"),
    [
        (Robot, {"deviation": 0.0}, "deviation"),
        (Robot, {"acceleration_walk": -1.0}, "acceleration_walk"),
        (Ground, {"walk": math.inf}, "walk"),
        (Imu, {"gyro_noise": 0.0}, "gyro_noise"),
        (Barometer, {"bias_walk": math.nan}, "bias_walk"),
        (RangeFinder, {"noise": 0.0}, "noise"),
    ],
)
def test_noises_are_above_zero(kind: type, fields: dict[str, float], name: str) -> None:
    """A filter with a noise of zero would trust one measurement for ever."""
    with pytest.raises(BadInput, match=f"{name} is .*, it must be above 0"):
        kind(**fields)
