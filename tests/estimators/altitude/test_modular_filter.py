"""The filter that is put together from components."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

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
    Floats,
    Ground,
    Imu,
    RangeFinder,
    Robot,
    Sensor,
    State,
)
from volery.estimators.altitude.modular_filter import GROUND, Belief, GroundJumps, ModularFilter, Variant, unobservable

S, MS = 1_000_000_000, 1_000_000
THREE: tuple[tuple[str, Sensor], ...] = (("imu", Imu()), ("baro", Barometer()), ("laser", RangeFinder()))
LEVEL = np.array([GRAVITY, 0, 0, 0, 0])


def filter_of(
    variant: Variant = "as_printed",
    sensors: Sequence[tuple[str, Sensor]] = THREE,
    robot: Robot | None = None,
    ground: Ground | None = None,
) -> ModularFilter:
    """A filter of these components."""
    return ModularFilter(robot or Robot(), ground or Ground(), sensors, GroundJumps(variant))


def hovering(of: ModularFilter, altitude: float, seconds: float, start: Belief | None = None) -> Belief:
    """What is believed after so long at one altitude over the floor, without noise and without a barometer bias."""
    belief = of.start() if start is None else start
    begin_ns = belief.time_ns
    for tick in range(1, int(seconds * 100) + 1):
        time_ns = begin_ns + tick * 10 * MS
        belief = of.take(belief, time_ns, "imu", LEVEL)
        if tick % 5 == 0:
            belief = of.take(belief, time_ns, "baro", np.array([altitude]))
            belief = of.take(belief, time_ns, "laser", np.array([altitude]))
    return belief


def textbook(
    belief: Belief, time_ns: int, H: Floats, R: Floats, residual: Floats, walks: Floats
) -> tuple[Floats, Floats]:
    """Prediction and update in Joseph's form, with the matrices written out for one of each sensor."""
    dt = (time_ns - belief.time_ns) / S
    F = np.eye(10)
    F[0, 1] = F[1, 2] = F[3, 5] = F[4, 6] = dt
    F[0, 2] = dt**2 / 2
    F[GROUND, GROUND] = belief.mean[GROUND] > 0
    x, P = F @ belief.mean, F @ belief.covariance @ F.T + np.diag(walks**2 * dt)
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    left = np.eye(10) - K @ H
    return x + K @ residual, left @ P @ left.T + K @ R @ K.T


def test_a_step_is_that_of_the_textbook() -> None:
    """For each sensor, from a belief with correlations; the two orders of arithmetic differ by rounding only."""
    of = filter_of(robot=Robot(altitude=1.2), ground=Ground(height=0.2))
    belief = of.start()
    for tick in range(1, 40):
        for name, values in (("imu", LEVEL + 0.01), ("baro", np.array([1.5])), ("laser", np.array([1.05]))):
            belief = of.take(belief, tick * 10 * MS, name, values)
    walks = np.array([0, 0, 1.0, 0, 0, 1.0, 1.0, Ground().walk, Imu().bias_walk, Barometer().bias_walk])
    imu, barometer = np.zeros((5, 10)), np.zeros((1, 10))
    imu[np.arange(5), [2, 3, 4, 5, 6]] = imu[0, 8] = 1
    barometer[0, [0, 9]] = 1
    time_ns = belief.time_ns + 7 * MS
    ahead = of.predict(belief, time_ns)
    _, laser = of.expected("laser", ahead.mean)
    for name, H, values in (
        ("imu", imu, LEVEL + 0.02),
        ("baro", barometer, np.array([1.7])),
        ("laser", laser, np.array([1.1])),
    ):
        residual = values - of.expected(name, ahead.mean)[0]
        R = np.diag(dict(THREE)[name].variances())
        mean, covariance = textbook(belief, time_ns, H, R, residual, walks)
        after = of.take(belief, time_ns, name, values)
        np.testing.assert_allclose(after.mean, mean, rtol=0, atol=1e-12)
        np.testing.assert_allclose(after.covariance, covariance, rtol=0, atol=1e-12)


@given(st.lists(st.sampled_from(["imu", "baro", "laser"]), min_size=1, max_size=60), st.integers(0, 3))
def test_covariances_stay_symmetric_and_positive(order: list[str], seed: int) -> None:
    """Whatever is measured in whatever order, in every variant; eigenvalues above minus rounding."""
    draws = np.random.default_rng(seed)
    for variant in ("as_printed", "gate", "gate_and_floor"):
        of = filter_of(variant)
        belief = of.start()
        for number, name in enumerate(order):
            belief = of.take(belief, number * 10 * MS, name, draws.normal(size=of.size(name)))
            np.testing.assert_array_equal(belief.covariance, belief.covariance.T)
            assert np.linalg.eigvalsh(belief.covariance)[0] > -1e-12


@dataclass(frozen=True)
class TwoBeams:
    """A range finder with a second beam and an offset of its own, as a user would add it."""

    sees_ground = True

    def states(self) -> tuple[State, ...]:
        """The offset of the second beam."""
        return (State("offset", 0.0, 0.5, 0.001),)

    def move(self, own: Floats, jacobian: Floats, dt: float) -> None:
        """It stays."""

    def variances(self) -> Floats:
        """Of the two."""
        return np.array([0.03**2, 0.04**2])

    def expected(self, robot: Floats, ground: float, own: Floats, blocks: Blocks) -> Floats:
        """Straight down, one with the offset."""
        blocks.by_robot[:, 0], blocks.by_ground[:], blocks.by_own[1, 0] = 1.0, -1.0, 1.0
        distance = robot[0] - ground
        return np.array([distance, distance + own[0]])


@pytest.mark.parametrize("variant", ["as_printed", "gate", "gate_and_floor"])
def test_a_sensor_is_added_by_adding_a_component(variant: Variant) -> None:
    """A kind unknown to the filter, beside two barometers: its state is found, and its jump goes to the ground."""
    of = filter_of(variant, [*THREE, ("second", Barometer()), ("beams", TwoBeams())])
    assert of.names[-2:] == ("barometer bias of second", "offset of beams")
    belief = of.start()
    for tick in range(1, 200):
        time_ns = tick * 50 * MS
        belief = of.take(belief, time_ns, "imu", LEVEL)
        belief = of.take(belief, time_ns, "second", np.array([-0.4]))
        belief = of.take(belief, time_ns, "beams", np.array([0.0, 0.25]))
    assert belief.mean[-1] == pytest.approx(0.25, abs=0.01)
    assert belief.mean[-2] == pytest.approx(-0.4, abs=0.05)
    after = of.take(belief, belief.time_ns, "beams", np.array([-0.5, -0.25]))
    if variant == "as_printed":
        assert after.jumps == 0
        assert after.ground < 0.4
    else:
        assert after.jumps == 1
        assert after.ground == pytest.approx(0.5, abs=0.01)


def test_prediction_is_on_demand_and_changes_nothing() -> None:
    """To any instant, at once or in steps; the belief itself stays, and time does not run back."""
    of = filter_of()
    belief = hovering(of, 0.0, 0.3)
    mean = belief.mean.copy()
    assert of.predict(belief, belief.time_ns) is belief
    ahead = of.predict(belief, belief.time_ns + 100 * MS)
    np.testing.assert_array_equal(belief.mean, mean)
    steps = of.predict(of.predict(belief, belief.time_ns + 30 * MS), belief.time_ns + 100 * MS)
    np.testing.assert_allclose(steps.mean, ahead.mean, rtol=0, atol=1e-14)
    assert ahead.deviation(0) > belief.deviation(0)
    with pytest.raises(BadInput, match="time does not run back"):
        of.predict(ahead, belief.time_ns)


@pytest.mark.parametrize("variant", ["gate", "gate_and_floor"])
def test_a_jump_of_the_range_goes_into_the_ground(variant: Variant) -> None:
    """A table of 75 cm below: the ground has it after one measurement, and the altitude moves by less than 1 cm."""
    altitude, ground = 1.4, 0.75
    of = filter_of(variant, robot=Robot(altitude=altitude))
    belief = hovering(of, altitude, 3.0)
    after = of.take(belief, belief.time_ns + 50 * MS, "laser", np.array([altitude - ground]))
    assert after.jumps == belief.jumps + 1
    assert after.altitude == pytest.approx(altitude, abs=0.01)
    assert after.ground == pytest.approx(ground, abs=0.02)
    back = of.take(after, after.time_ns + 50 * MS, "laser", np.array([altitude]))
    assert back.altitude == pytest.approx(altitude, abs=0.01)
    assert abs(back.ground) < 0.02


def test_as_printed_splits_a_jump_by_the_tuning() -> None:
    """With a ground that hardly walks the altitude takes a good part, with one that walks fast next to nothing."""
    shares = []
    for walk in (0.003, 3.0):
        of = filter_of(robot=Robot(altitude=1.4), ground=Ground(walk=walk))
        belief = hovering(of, 1.4, 3.0)
        after = of.take(belief, belief.time_ns + 50 * MS, "laser", np.array([0.65]))
        assert after.jumps == 0
        shares.append((1.4 - after.altitude) / 0.75)
    assert shares[0] > 0.1
    assert shares[1] < 0.02


def test_only_the_floor_brings_a_drifted_altitude_back() -> None:
    """Altitude and ground are 5 cm too high: `gate` leaves that, `gate_and_floor` takes it away within a second."""
    for variant, left in (("gate", 0.05), ("gate_and_floor", 0.0)):
        of = filter_of(variant, robot=Robot(altitude=1.45), ground=Ground(height=0.05))  # type: ignore[arg-type]
        belief = hovering(of, 1.4, 1.0)
        assert belief.altitude == pytest.approx(1.4 + left, abs=0.01)
        assert belief.ground == pytest.approx(left, abs=0.01)


@pytest.mark.parametrize("height", [0.2, -0.2])
def test_a_ground_that_is_no_floor_is_not_pulled(height: float) -> None:
    """Beyond the level of 15 cm the pull is off, however unsure the ground is."""
    of = filter_of("gate_and_floor", robot=Robot(altitude=1.4), ground=Ground(height=height, deviation=0.5))
    belief = of.start()
    after = of.take(belief, 0, "laser", np.array([1.4 - height]))
    assert after.ground == pytest.approx(height)


def test_the_unobservable_direction_is_found() -> None:
    """(z, z_G, b_b) = (1, 1, −1), and nothing else; every further barometer has its −1, and none may see the ground."""
    of = filter_of(robot=Robot(altitude=1.4), ground=Ground(height=0.5))
    direction = unobservable(of, of.start().mean)
    expected = np.zeros((10, 1))
    expected[[0, GROUND, 9]] = np.array([[1], [1], [-1]]) / math.sqrt(3)
    np.testing.assert_allclose(direction, expected, atol=1e-9)
    two = filter_of(sensors=[*THREE, ("second", Barometer())], ground=Ground(height=0.5))
    found = unobservable(two, two.start().mean)[:, 0]
    assert found[[0, GROUND, 9, 10]] == pytest.approx(np.array([1, 1, -1, -1]) / 2)
    blind = filter_of(sensors=THREE[:2], ground=Ground(height=0.5))
    assert unobservable(blind, blind.start().mean).shape == (10, 2)


def test_the_clamp_makes_it_observable() -> None:
    """On the floor the Jacobian of (19) is 0, and no direction is left."""
    of = filter_of()
    assert of.start().ground == 0
    assert unobservable(of, of.start().mean).shape == (10, 0)


@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        ((), "a filter without any sensor estimates nothing"),
        ((*THREE, ("baro", Barometer())), "component baro is named twice"),
        ((*THREE, ("imu", RangeFinder())), "component imu is named twice"),
    ],
)
def test_filters_that_cannot_be_put_together(sensors: Sequence[tuple[str, Sensor]], message: str) -> None:
    """No sensor, or two of one name."""
    with pytest.raises(BadInput, match=message):
        filter_of(sensors=sensors)


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("sonar", [1.0], "the filter has no component 'sonar': it has imu, baro, laser"),
        ("baro", [1.0, 2.0], r"measurement of baro has shape \(2,\): give \(1,\)"),
        ("laser", [math.nan], "measurement of laser holds a value that is not finite"),
        ("imu", [math.inf, 0, 0, 0, 0], "measurement of imu holds a value that is not finite"),
    ],
)
def test_measurements_that_fit_no_component(name: str, values: list[float], message: str) -> None:
    """With what would fit."""
    of = filter_of()
    with pytest.raises(BadInput, match=message):
        of.update(of.start(), name, np.array(values))


@pytest.mark.parametrize(("name", "unit"), [("gate", ""), ("jump", " m"), ("level", " m"), ("floor_noise", " m")])
def test_bounds_of_the_gate(name: str, unit: str) -> None:
    """All above 0."""
    with pytest.raises(BadInput, match=f"{name} is 0{unit}, it must be above 0"):
        GroundJumps(**{name: 0.0})  # type: ignore[arg-type]


def test_a_lost_filter_finds_the_floor() -> None:
    """It starts in the air and believes itself on the ground, known to a metre: it takes the range for its altitude."""
    of = filter_of("gate_and_floor")
    sure, lost = (hovering(of, 1.4, 4.0, of.start(lost=lost)) for lost in (False, True))
    assert abs(sure.altitude - 1.4) > 0.1
    assert lost.altitude == pytest.approx(1.4, abs=0.05)
    assert len(lost.mean) == ROBOT_STATES + 3
