"""The linear map and the exact inverse, held against the world's nonlinear distances."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.estimators.flying_array.least_squares import centralised_estimate
from volery.estimators.flying_array.plane import design_matrix, design_row, exact_state
from volery.topologies import four_module_array, positions, random_hexagonal
from volery.worlds.plane.plane_world import distances

FOUR = list(positions(four_module_array(0.25)).values())


def test_linearised_estimate_at_ten_degrees_is_off_by_what_the_paper_neglects() -> None:
    """At z = 0.2 m and 10° of roll the linearised estimate is off by +3.09 mm and +0.103°, to the digits stated."""
    true = np.array([0.2, np.radians(10.0), 0.0])
    departure = centralised_estimate(FOUR, distances(true, FOUR)) - true
    assert departure[0] * 1e3 == pytest.approx(3.09, abs=0.005)
    assert np.degrees(departure[1]) == pytest.approx(0.103, abs=0.0005)
    assert departure[2] == pytest.approx(0.0, abs=1e-15)


@given(
    altitude=st.floats(0.05, 5.0),
    roll=st.floats(-1.2, 1.2),
    pitch=st.floats(-1.2, 1.2),
    seed=st.integers(0, 1000),
)
def test_exact_state_undoes_the_nonlinear_model_at_any_tilt(
    altitude: float, roll: float, pitch: float, seed: int
) -> None:
    """Fitting the plane and inverting it gives the state back, to rounding: 1e-12 is 10⁴ units of 5 m's last place."""
    places = list(positions(random_hexagonal(8, seed)).values())
    true = np.array([altitude, roll, pitch])
    found = exact_state(centralised_estimate(places, distances(true, places)))
    np.testing.assert_allclose(found, true, atol=1e-12)


def test_linear_map_is_the_derivative_of_the_nonlinear_model_at_hover() -> None:
    """Central differences of the distances at hover equal the design matrix; step 1e-4 leaves an error of 1e-8."""
    step = 1e-4
    hover = np.array([0.5, 0.0, 0.0])
    numeric = np.column_stack(
        [
            (distances(hover + step * axis, FOUR) - distances(hover - step * axis, FOUR)) / (2 * step)
            for axis in np.eye(3)
        ]
    )
    np.testing.assert_allclose(numeric, design_matrix(FOUR), atol=1e-7)


def test_matrix_is_made_of_rows() -> None:
    """The matrix of all modules holds the row (1, r_Y, −r_X) of each."""
    np.testing.assert_array_equal(design_row((0.3, -0.2)), [1.0, -0.2, -0.3])
    np.testing.assert_array_equal(design_matrix(FOUR), [design_row(place) for place in FOUR])


@pytest.mark.parametrize("bad", [[[1.0, 2.0, 3.0]], [1.0, 2.0], [[np.nan, 0.0]]])
def test_positions_of_another_shape_or_not_finite_are_refused(bad: list[object]) -> None:
    """The message names the argument."""
    with pytest.raises(BadInput, match="positions"):
        design_matrix(bad)  # type: ignore[arg-type]
