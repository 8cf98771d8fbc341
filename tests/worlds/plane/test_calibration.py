"""The infrared sensor's calibration curve."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.worlds.plane.calibration import Calibration, calibrate

# With b ≥ 0.2 the curves that turn (c < 0) do so beyond 1.9 m.
curves = st.builds(
    Calibration, a=st.floats(-0.1, 0.05), b=st.floats(0.2, 0.6), c=st.sampled_from([0.0, 1e-4, 0.01, -0.005])
)


@given(curve=curves, distance=st.floats(0.07, 0.8))
def test_voltage_undoes_distance_on_the_falling_branch(curve: Calibration, distance: float) -> None:
    """There and back is the same distance, and a larger one gives a smaller voltage."""
    voltage = curve.voltage(distance)
    assert curve.distance(voltage) == pytest.approx(distance, rel=1e-9)
    assert curve.voltage(distance * 1.01) < voltage


@given(curve=curves)
def test_the_fit_finds_the_curve_that_made_its_references(curve: Calibration) -> None:
    """Ten references without noise: the distances of the fit equal the true ones between the references too."""
    known = np.linspace(0.07, 0.8, 10)
    found = calibrate([curve.voltage(distance) for distance in known], known)
    between = (known[1:] + known[:-1]) / 2
    again = [found.distance(curve.voltage(distance)) for distance in between]
    np.testing.assert_allclose(again, between, atol=1e-9)


def test_the_fit_is_the_least_squares_solution() -> None:
    """The residuals are orthogonal to 1, 1/V and 1/V²."""
    voltages = np.array([0.4, 0.5, 0.7, 1.0, 1.6, 2.5])
    known = np.array([0.81, 0.63, 0.42, 0.29, 0.15, 0.09])
    found = calibrate(voltages, known)
    residuals = known - [found.distance(voltage) for voltage in voltages]
    for power in range(3):
        assert residuals @ voltages**-power == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("distance", [-0.06, -0.05])
def test_a_distance_off_the_curve_is_refused(distance: float) -> None:
    """At and below the curve's limit for infinite voltage; the message gives the curve."""
    with pytest.raises(BadInput, match=r"not on the calibration curve a=-0\.05"):
        Calibration(-0.05, 0.33, 0.004).voltage(distance)


def test_a_distance_beyond_a_curve_that_turns_is_refused() -> None:
    """With c < 0 the curve has a largest distance, a − b²/4c."""
    curve = Calibration(0.0, 0.3, -0.05)
    assert curve.voltage(0.4499) == pytest.approx(1 / 3, rel=0.02)
    with pytest.raises(BadInput, match="not on the calibration curve"):
        curve.voltage(0.4501)


@pytest.mark.parametrize("voltage", [0.0, -0.1, math.nan])
def test_a_voltage_that_is_not_positive_stands_for_no_distance(voltage: float) -> None:
    """It is refused."""
    with pytest.raises(BadInput, match="must be above 0"):
        Calibration(-0.05, 0.33, 0.004).distance(voltage)


@pytest.mark.parametrize(
    ("voltages", "distances"),
    [([1.0, 2.0], [0.3, 0.2]), ([1.0, 1.0, 2.0], [0.3, 0.3, 0.2]), ([0.0, 1.0, 2.0], [0.5, 0.3, 0.2]), ([1.0], [1, 2])],
)
def test_references_that_do_not_determine_the_curve_are_refused(voltages: list[float], distances: list[float]) -> None:
    """Fewer than three different voltages, one that is not positive, unequal numbers."""
    with pytest.raises(BadInput, match="voltages"):
        calibrate(voltages, distances)
