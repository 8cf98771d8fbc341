"""The rigid body over a plane and the sensors that look at it."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.topologies import positions, sixteen_module_array
from volery.worlds.plane.distance_sensors import GaussianDistance, Infrared
from volery.worlds.plane.plane_world import PlaneWorld, distances
from volery.worlds.signals import Constant, Sine, Steps

SECOND = 1_000_000_000
PLACES = positions(sixteen_module_array())
WORLD = PlaneWorld(
    altitude=Steps((0, SECOND), (0.2, 0.3)),
    roll=Constant(math.radians(5)),
    pitch=Sine(math.radians(5), 0.5, 0.0),
    positions=PLACES,
    sensor=GaussianDistance(0.005),
    seed=7,
)
SENSORS = [GaussianDistance(0.005), Infrared(0.01)]


@given(
    roll=st.floats(-1.4, 1.4), pitch=st.floats(-1.4, 1.4), x=st.floats(-1, 1), y=st.floats(-1, 1), z=st.floats(0.1, 2)
)
def test_distances_end_on_the_ground(roll: float, pitch: float, x: float, y: float, z: float) -> None:
    """Turned into the inertial frame, going that far down the body's axis from the module ends at height 0.

    The body's rotation is R_y(β) R_x(γ) (Kriegleder (3), yaw left out); rounding is magnified by 1/cos² at most.
    """
    about_x = np.array(
        [[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]],
    )
    about_y = np.array([[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]])
    distance = distances([z, roll, pitch], [(x, y)])[0]
    foot = about_y @ about_x @ np.array([x, y, -distance])
    assert z + foot[2] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("state", [(0.2, math.pi / 2, 0.0), (0.2, 0.0, -2.0)])
def test_a_tilt_past_the_horizon_is_refused(state: tuple[float, float, float]) -> None:
    """Beyond 90° the axis does not meet the ground."""
    with pytest.raises(BadInput, match="within 90 deg"):
        distances(state, [(0.0, 0.0)])


def test_samples_are_taken_at_the_instants_of_their_rate() -> None:
    """Without noise sample 19 of 20 Hz is before the step at 1 s and sample 20 at it."""
    world = replace(WORLD, sensor=GaussianDistance(0.0))
    for index in (0, 19, 20, 33):
        expected = distances(world.truth(index * SECOND // 20), [PLACES["12"]])
        np.testing.assert_array_equal(world.measure("12", "distance", index), expected)
    assert world.truth(19 * SECOND // 20)[0] == 0.2
    assert world.truth(SECOND)[0] == 0.3
    assert world.sensors("12") == {"distance": 20.0}


@pytest.mark.parametrize("sensor", SENSORS)
def test_a_measurement_is_a_function_of_seed_agent_and_index_alone(sensor: GaussianDistance | Infrared) -> None:
    """Asked in another order, in a pickled copy, without the other agents: the same bits. Another seed: others."""
    world = replace(WORLD, sensor=sensor)

    def bits(world: PlaneWorld, order: range) -> dict[int, bytes]:
        return {k: b"" if (m := world.measure("3", "distance", k)) is None else m.tobytes() for k in order}

    expected = bits(world, range(100))
    assert bits(pickle.loads(pickle.dumps(world)), range(99, -1, -1)) == expected  # noqa: S301 - our own bytes
    assert bits(replace(world, positions={"3": PLACES["3"]}), range(100)) == expected
    assert len(set(expected.values())) == 100
    assert not set(bits(replace(world, seed=8), range(100)).values()) & set(expected.values())


def test_gaussian_noise_has_the_stated_scatter_and_is_independent_between_agents() -> None:
    """2000 samples of two agents: mean and variance within 5 standard errors, correlation below 5/√2000."""
    world = replace(WORLD, altitude=Constant(0.2), pitch=Constant(0.0))
    true = distances(world.truth(0), [PLACES["1"], PLACES["2"]])
    noise = np.array([[sample(world, agent, k) for agent in ("1", "2")] for k in range(2000)])
    noise -= true
    assert np.abs(noise.mean(axis=0)).max() < 5 * 0.005 / 2000**0.5
    np.testing.assert_allclose(noise.var(axis=0) / 0.005**2, 1.0, atol=5 * (2 / 2000) ** 0.5)
    assert abs(np.corrcoef(noise.T)[0, 1]) < 5 / 2000**0.5


def sample(world: PlaneWorld, agent: str, index: int) -> float:
    """A measurement that is there."""
    measured = world.measure(agent, "distance", index)
    assert measured is not None
    assert measured.shape == (1,)
    return float(measured[0])


def test_infrared_reads_nothing_outside_its_range() -> None:
    """Below 7 cm and above 80 cm there is None; within there is a distance, for all modules."""
    for altitude, seen in ((0.05, False), (0.09, True), (0.2, True), (0.6, True), (0.95, False), (8.0, False)):
        world = level(altitude, 0.002)
        readings = [world.measure(agent, "distance", k) for agent in PLACES for k in range(20)]
        assert all((reading is not None) == seen for reading in readings)


def test_infrared_reads_nothing_where_noise_takes_the_voltage_below_zero() -> None:
    """At 8 m the voltage is 0.04 V; with noise of 0.1 V a third of the readings are below 0, and none is a distance."""
    world = level(8.0, 0.1)
    assert all(world.measure("3", "distance", k) is None for k in range(40))


def level(altitude: float, noise: float) -> PlaneWorld:
    """A level world with infrared sensors."""
    return replace(WORLD, altitude=Constant(altitude), roll=Constant(0.0), pitch=Constant(0.0), sensor=Infrared(noise))


def test_infrared_without_noise_is_exact_after_calibration() -> None:
    """Each module has its own curve, and ten references without noise find it."""
    for altitude in (0.1, 0.33, 0.7):
        for agent in PLACES:
            assert sample(level(altitude, 0.0), agent, 0) == pytest.approx(altitude, abs=1e-9)


def test_infrared_noise_grows_with_distance_as_the_slope_of_the_curve() -> None:
    """σ_m ≈ |dm/dV| σ_V = (b + 2c/V)/V² σ_V, here within 15 %: modules differ by 3 %, 400 samples scatter by 4 %."""
    sensor = Infrared(0.002)
    for altitude in (0.1, 0.2, 0.5):
        voltage = sensor.typical.voltage(altitude)
        expected = (sensor.typical.b + 2 * sensor.typical.c / voltage) / voltage**2 * 0.002
        world = level(altitude, 0.002)
        assert np.std([sample(world, "5", k) for k in range(400)]) == pytest.approx(expected, rel=0.15)


def test_modules_have_curves_of_their_own() -> None:
    """Calibrated with noise they err differently, each by less than 2 cm at 20 cm with 10 mV."""
    means = [np.mean([sample(level(0.2, 0.01), agent, k) for k in range(50)]) for agent in PLACES]
    assert len(set(means)) == 16
    assert np.abs(np.array(means) - 0.2).max() < 0.02


def test_a_module_in_the_ground_measures_nothing() -> None:
    """At 1 cm altitude and 30° of roll the modules on the low side are under the plane."""
    world = replace(WORLD, altitude=Constant(0.01), roll=Constant(math.radians(30)), pitch=Constant(0.0))
    true = distances(world.truth(0), list(PLACES.values()))
    assert (true < 0).any()
    assert [world.measure(agent, "distance", 0) is None for agent in PLACES] == (true <= 0).tolist()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"altitude": Sine(0.2, 1.0, 0.2)}, "altitude goes down to 0.0 m"),
        ({"roll": Constant(math.radians(90))}, "roll reaches 90 deg"),
        ({"pitch": Sine(-1.0, 1.0, 1.0)}, "pitch reaches 114.592 deg"),
        ({"rate": 0.0}, "rate is 0 Hz, it must be above 0"),
        ({"positions": {}}, "no positions"),
        ({"positions": {"1": (0.0, 0.0, 0.0)}}, "of agent 1 must be two numbers"),
    ],
)
def test_a_world_that_makes_no_sense_at_some_instant_is_refused(change: dict[str, object], message: str) -> None:
    """At once, not when the run comes to that instant."""
    with pytest.raises(BadInput, match=message):
        replace(WORLD, **change)  # type: ignore[arg-type]


def test_unknown_agents_and_sensors_are_refused_by_name() -> None:
    """The message lists what there is."""
    with pytest.raises(BadInput, match="agent '17' has no position"):
        WORLD.measure("17", "distance", 0)
    with pytest.raises(BadInput, match="agent '17' has no position"):
        WORLD.sensors("17")
    with pytest.raises(BadInput, match="agent 3 has no sensor 'gyro'"):
        WORLD.measure("3", "gyro", 0)


@pytest.mark.parametrize(("kind", "noise"), [(GaussianDistance, -0.001), (Infrared, -0.001), (Infrared, 0.2)])
def test_noise_out_of_bounds_is_refused(kind: type[GaussianDistance] | type[Infrared], noise: float) -> None:
    """Below 0, or more than a calibration bears."""
    with pytest.raises(BadInput, match=f"noise {noise}"):
        kind(noise)
