"""A flight: where it goes, and that velocity, acceleration, tilt and forces belong together."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.worlds.altitude.tour import GRAVITY, Tour

S = 1_000_000_000
STEP_NS = 100_000
TOUR = Tour(((0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 1.0)), (0.47, 0.0), 1.4, 0.5, 2.0, 4.0, 5.0, drop=0.2, sway=0.1)
ABRUPT_NS = (TOUR._falling_ns, TOUR._touching_ns, TOUR.down_ns)
"""Where the acceleration jumps: it lets itself fall, touches down, and is at rest."""


def away_from_jumps(time_ns: int) -> bool:
    """Whether the acceleration is smooth about an instant; the sway sets in with a small jump of its own."""
    edges = (*ABRUPT_NS, TOUR.legs_ns[0], TOUR.legs_ns[-1])
    return all(abs(time_ns - edge) > 2 * STEP_NS for edge in edges)


@given(st.integers(0, TOUR.down_ns + S).filter(away_from_jumps))
def test_rates_are_derivatives(time_ns: int) -> None:
    """Velocity, acceleration, roll and pitch rate against central differences over 0.2 ms.

    Their error is h²/6 times the third derivative (below 100 in any unit here), 2e-7, and rounding 1e-16/h = 1e-12.
    """
    before, now, after = (TOUR.pose(time_ns + step) for step in (-STEP_NS, 0, STEP_NS))
    width = 2 * STEP_NS / S
    np.testing.assert_allclose((after.position - before.position) / width, now.velocity, atol=1e-6)
    np.testing.assert_allclose((after.velocity - before.velocity) / width, now.acceleration, atol=1e-6)
    assert (after.roll - before.roll) / width == pytest.approx(now.roll_rate, abs=1e-6)
    assert (after.pitch - before.pitch) / width * math.cos(now.roll) == pytest.approx(now.pitch_rate, abs=1e-6)


@given(st.integers(0, TOUR.down_ns + S))
def test_thrust_carries_the_vehicle(time_ns: int) -> None:
    """The specific force along R_y(pitch) R_x(roll) e₃ is acceleration plus gravity, to rounding."""
    pose = TOUR.pose(time_ns)
    across = math.cos(pose.roll)
    axis = np.array([math.sin(pose.pitch) * across, -math.sin(pose.roll), math.cos(pose.pitch) * across])
    np.testing.assert_allclose(pose.specific_force * axis, pose.acceleration + np.array([0, 0, GRAVITY]), atol=1e-12)


def test_it_goes_where_it_is_told() -> None:
    """From the ground over each waypoint, at rest there and within the sway of its altitude, and down again."""
    np.testing.assert_array_equal(TOUR.pose(0).position, [0, 0, 0.47])
    for waypoint, time_ns in zip(TOUR.waypoints, TOUR.legs_ns, strict=True):
        pose = TOUR.pose(time_ns)
        np.testing.assert_allclose(pose.position[:2], waypoint, atol=1e-12)
        np.testing.assert_allclose(pose.velocity[:2], 0, atol=1e-12)
        assert 1.4 - 1e-12 <= pose.position[2] <= 1.5
    np.testing.assert_allclose(TOUR.pose(TOUR.down_ns).position, [0, 1, 0], atol=1e-12)
    speeds = [math.dist(*pair) / 0.5 for pair in zip(TOUR.waypoints, TOUR.waypoints[1:], strict=False)]
    np.testing.assert_allclose(np.diff(TOUR.legs_ns) / S, speeds, atol=1e-9)


def test_it_falls_and_is_braked() -> None:
    """Free fall over three quarters of 20 cm, then 3 g upwards until it is at rest; height and velocity do not jump."""
    assert TOUR.pose(ABRUPT_NS[0] + STEP_NS).specific_force == pytest.approx(0.0, abs=1e-12)
    assert TOUR.pose(ABRUPT_NS[1] + STEP_NS).acceleration[2] == pytest.approx(3 * GRAVITY)
    assert TOUR.pose(ABRUPT_NS[1]).position[2] == pytest.approx(0.05, abs=1e-8)
    for edge in ABRUPT_NS:
        before, after = TOUR.pose(edge - 1), TOUR.pose(edge)
        np.testing.assert_allclose(after.position, before.position, atol=1e-8)
        np.testing.assert_allclose(after.velocity, before.velocity, atol=1e-7)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"waypoints": ((0.0, 0.0),)}, "at least two are needed"),
        ({"waypoints": ((0.0, 0.0), (0.0, 0.0))}, "each other than the one before"),
        ({"speed": 0.0}, "speed is 0, it must be above 0"),
        ({"landing": -1.0}, "landing is -1, it must be above 0"),
        ({"drop": -0.1}, "drop is -0.1, it must be at least 0"),
        ({"altitude": 0.4, "ground": (0.0, 0.47)}, "altitude is 0.4 m, it must be above 0.47 m"),
    ],
)
def test_what_cannot_be_flown_is_refused(changes: dict[str, object], message: str) -> None:
    """With the value and the bound."""
    with pytest.raises(BadInput, match=message):
        Tour(**{"waypoints": ((0.0, 0.0), (1.0, 0.0)), **changes})  # type: ignore[arg-type]
