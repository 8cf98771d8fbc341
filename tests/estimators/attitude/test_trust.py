"""Trust in sensors, by their residuals."""

from __future__ import annotations

import math

import pytest

from volery.errors import BadInput
from volery.estimators.attitude.trust import RETURN, Trust, updated_trust
from volery.randomness import stream

BOUND, SHARE = 0.1, 0.05


def after(residuals: list[float], before: Trust | None = None) -> list[Trust]:
    """The trust after each of the residuals."""
    now, course = before or Trust(), []
    for residual in residuals:
        now = updated_trust(now, residual, BOUND, SHARE)
        course.append(now)
    return course


def test_a_sensor_within_its_noise_stays_trusted() -> None:
    """Normal residuals of a third of the bound: their mean square would have to rise ninefold."""
    draws = stream(1, "residuals")
    assert all(trust.trusted for trust in after([BOUND / 3 * draws.normal(k) for k in range(5000)]))


def test_a_residual_of_many_bounds_loses_trust_at_once() -> None:
    """One of bound/√share or more is enough, whatever went before; a lesser one is not."""
    enough = BOUND / math.sqrt(SHARE)
    assert not after([1.01 * enough])[0].trusted
    assert after([0.99 * enough])[0].trusted


def test_a_residual_that_grows_loses_trust_at_the_bound() -> None:
    """A sensor that is stuck while the body turns: lost once the mean of what is kept in mind has passed the bound."""
    course = after([0.001 * k for k in range(200)])
    lost = next(k for k, trust in enumerate(course) if not trust.trusted)
    assert BOUND < 0.001 * lost < BOUND + 2 * 0.001 / SHARE


def test_trust_comes_back_below_a_lower_bound_only() -> None:
    """At 0.8 of the bound it does not, having been lost; at 0.6 it does, after some time to forget."""
    lost = after([10 * BOUND])[0]
    assert not lost.trusted
    assert not any(trust.trusted for trust in after([0.8 * BOUND] * 1000, lost))
    course = after([0.6 * BOUND] * 1000, lost)
    assert not course[0].trusted
    assert course[-1].trusted
    assert 0.6 < RETURN < 0.8


@pytest.mark.parametrize(("residual", "bound", "share"), [(math.nan, 1, 1), (0, 0, 1), (0, 1, 0), (0, 1, 1.1)])
def test_what_makes_no_sense_is_refused(residual: float, bound: float, share: float) -> None:
    """Values out of their bounds."""
    with pytest.raises(BadInput, match="residual"):
        updated_trust(Trust(), residual, bound, share)
