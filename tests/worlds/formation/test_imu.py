"""Inertial measurement units: their laws of noise, biases and miscalibration."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.errors import BadInput
from volery.rotations import from_matrix, log_quaternion
from volery.worlds.formation.imu import Imu, Units

Floats = NDArray[np.float64]
MANY = [str(number) for number in range(1, 401)]


def constant(vector: tuple[float, float, float], count: int) -> Floats:
    """The same vector for all vehicles, (3, N)."""
    return np.tile(vector, (count, 1)).T


def test_an_exact_unit_says_what_is_true() -> None:
    """Rates, specific force and field one after the other, without noise, bias or miscalibration."""
    exact = Units(Imu().exact(), 1, ["1"])
    sample = exact.samples(constant((1, 2, 3), 1), constant((4, 5, 6), 1), constant((7, 8, 9), 1), 5)
    assert sample.tolist() == [[1, 2, 3, 4, 5, 6, 7, 8, 9]]


def test_the_field_dips_by_its_inclination() -> None:
    """North and down, of length 1."""
    assert Imu(inclination=math.radians(60)).field == pytest.approx([0.5, 0.0, -math.sqrt(0.75)])


def test_biases_and_miscalibrations_are_drawn_for_each_vehicle() -> None:
    """With the standard deviations that are asked for, to four standard errors 1/√(2n) of each."""
    units = Units(Imu(), 1, MANY)
    within = 4 / math.sqrt(2 * 3 * len(MANY))
    for sensor, size in enumerate((0.005, 0.05, 0.005)):
        assert units.bias[:, 3 * sensor : 3 * sensor + 3].std() == pytest.approx(size, rel=within)
    turns = np.array([log_quaternion(from_matrix(axes)) for axes in units.axes])
    assert np.degrees(turns).std() == pytest.approx(1.0, rel=within)
    assert 1.0 < np.degrees(np.linalg.norm(turns, axis=1)).mean() < 2.0


def test_noise_is_drawn_for_each_sample() -> None:
    """With its standard deviation about the biased value, and the same again for the same index."""
    imu = Imu(miscalibration=0.0)
    units = Units(imu, 1, MANY)
    rates, forces, fields = (constant(each, len(MANY)) for each in ((0.1, 0.0, 0.0), (0.0, 0.0, 9.81), (1.0, 0.0, 0.0)))
    samples = [units.samples(rates, forces, fields, index) for index in range(3)]
    expected = np.hstack((rates.T, forces.T, fields.T)) + units.bias
    within = 4 / math.sqrt(2 * 3 * len(MANY))
    for sensor, size in enumerate((0.01, 0.1, 0.01)):
        part = slice(3 * sensor, 3 * sensor + 3)
        for sample in samples:
            assert (sample - expected)[:, part].std() == pytest.approx(size, rel=within)
    assert np.abs(np.corrcoef(samples[0] - expected, samples[1] - expected, rowvar=False)[:9, 9:]).max() < 0.25
    assert units.samples(rates, forces, fields, 0).tolist() == samples[0].tolist()


def test_a_miscalibrated_unit_turns_all_that_it_feels_alike() -> None:
    """Angles between what it feels stay, its axes do not."""
    units = Units(Imu().exact(), 1, ["1"])
    turned = Units(replace(Imu().exact(), miscalibration=0.1), 1, ["1"])
    rates, forces, fields = (constant(each, 1) for each in ((1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 3.0)))
    plain, felt = (each.samples(rates, forces, fields, 0).reshape(3, 3) for each in (units, turned))
    assert felt @ felt.T == pytest.approx(plain @ plain.T, abs=1e-12)
    assert felt == pytest.approx(plain @ turned.axes[0])
    assert np.abs(felt - plain).max() > 0.01


def test_a_vehicles_unit_is_its_own() -> None:
    """Another vehicle in the formation changes nobody else's."""
    few, many = Units(Imu(), 1, ["2"]), Units(Imu(), 1, ["1", "2"])
    assert few.bias[0].tolist() == many.bias[1].tolist()
    assert few.axes[0].tolist() == many.axes[1].tolist()
    assert few.bias[0].tolist() != Units(Imu(), 2, ["2"]).bias[0].tolist()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"rate": -1.0}, "imu.rate is -1 Hz"),
        ({"gyro_bias": -1.0}, "imu.gyro_bias is -1, it must be at least 0"),
        ({"magnetometer_noise": math.inf}, "imu.magnetometer_noise is inf"),
        ({"miscalibration": math.nan}, "imu.miscalibration is nan"),
        ({"inclination": math.pi / 2}, "imu.inclination is 90 deg"),
    ],
)
def test_a_unit_that_cannot_be_is_refused(change: dict[str, float], said: str) -> None:
    """The message has the value and the bound."""
    with pytest.raises(BadInput, match=said):
        Imu(**change)
