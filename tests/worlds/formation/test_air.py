"""Turbulence and gusts: their laws, with tolerances of four standard errors."""

from __future__ import annotations

import math
from itertools import islice, pairwise

import numpy as np
import pytest

from volery.errors import BadInput
from volery.worlds.formation.air import Gust, Random, Scripted, Swirl, Turbulence, Weather

SECOND = 1_000_000_000
AGENTS = [str(number) for number in range(1, 31)]


@pytest.mark.parametrize("step_ns", [20_000_000, 200_000_000])
def test_turbulence_has_its_variance_and_correlation_at_any_step(step_ns: int) -> None:
    """σ² and e^(−dt/T), from 90 independent series; samples count as (1 − φ²)/(1 + φ²) independent ones each.

    The variance of a normal variable is known from n values to √(2/n) of itself, a lag-one correlation φ to
    √((1 − φ²)/n).
    """
    swirl = Swirl(Turbulence(acceleration=0.6, correlation=0.5, vertical=1.0), 1, AGENTS)
    values = [swirl.value]
    for _ in range(600):
        swirl.advance(step_ns)
        values.append(swirl.value)
    series = np.array(values).reshape(len(values), -1)
    kept = math.exp(-step_ns / SECOND / 0.5)
    independent = series.size * (1 - kept**2) / (1 + kept**2)
    variance = float((series**2).mean())
    assert variance == pytest.approx(0.36, rel=4 * math.sqrt(2 / independent))
    lagged = float((series[1:] * series[:-1]).mean()) / variance
    assert lagged == pytest.approx(kept, abs=4 * math.sqrt((1 - kept**2) / series.size))
    across = np.corrcoef(series.T) - np.eye(series.shape[1])
    assert np.abs(across).max() < 6 / math.sqrt(independent / 90)


def test_turbulence_is_felt_less_vertically() -> None:
    """By the share that is asked for, exactly."""
    plain, flat = (Swirl(Turbulence(vertical=share), 1, AGENTS) for share in (1.0, 0.25))
    for swirl in (plain, flat):
        swirl.advance(SECOND)
    assert flat.value == pytest.approx(plain.value * [[1.0], [1.0], [0.25]])


def test_turbulence_of_a_vehicle_is_its_own() -> None:
    """Another vehicle in the formation changes nobody else's."""
    few, many = (Swirl(Turbulence(), 1, agents) for agents in (["2", "3"], ["1", "2", "3"]))
    for swirl in (few, many):
        swirl.advance(SECOND)
    assert few.value.tolist() == many.value[:, 1:].tolist()


def test_a_gust_gives_its_whole_impulse_however_time_is_cut() -> None:
    """The mean over each span, times its length, adds up to acceleration times duration; before and after, calm."""
    gust = Gust(100, 400, (1.0, -2.0, 0.5))
    for cuts in ([0, 1000], [0, 99, 130, 131, 499, 700, 1000]):
        weather = Weather(Scripted((gust,)), 0)
        total = np.zeros(3)
        for start, end in pairwise(cuts):
            total += (end - start) * weather.mean(start, end)
            weather.forget(end)
        assert total == pytest.approx([400.0, -800.0, 200.0])
    weather = Weather(Scripted((gust,)), 0)
    assert weather.mean(99, 99).tolist() == [0.0, 0.0, 0.0]
    assert weather.mean(100, 100).tolist() == [1.0, -2.0, 0.5]
    assert weather.mean(500, 500).tolist() == [0.0, 0.0, 0.0]


def test_gusts_that_are_over_are_forgotten() -> None:
    """Once nobody asks for their time any more; those that go on are not."""
    weather = Weather(Scripted((Gust(0, 10, (1.0, 0.0, 0.0)), Gust(5, 100, (0.0, 1.0, 0.0)))), 0)
    assert weather.mean(6, 8).tolist() == [1.0, 1.0, 0.0]
    weather.forget(20)
    assert weather.mean(6, 8).tolist() == [0.0, 1.0, 0.0]


def test_gusts_together_add_up() -> None:
    """Also where the list is not in the order of the starts."""
    weather = Weather(Scripted((Gust(50, 100, (0.0, 1.0, 0.0)), Gust(0, 100, (1.0, 0.0, 0.0)))), 0)
    assert weather.mean(60, 70).tolist() == [1.0, 1.0, 0.0]


def test_random_gusts_come_at_their_rate_from_all_sides() -> None:
    """Mean and deviation of the times between starts, 1/√n and √(2/n) of an exponential law, to four standard errors.

    Directions are without a preference.
    """
    gusts = list(islice(Random(10 * SECOND, SECOND, 2.0).all(3), 400))
    starts = np.array([gust.start_ns for gust in gusts])
    assert starts[-1] / len(gusts) == pytest.approx(10 * SECOND, rel=4 / math.sqrt(len(gusts)))
    assert np.diff(starts).std() == pytest.approx(10 * SECOND, rel=4 * math.sqrt(2 / len(gusts)))
    pushes = np.array([gust.acceleration for gust in gusts])
    assert np.linalg.norm(pushes, axis=1) == pytest.approx(np.full(len(gusts), 2.0))
    assert np.abs(pushes.mean(axis=0)).max() < 4 * 2.0 / math.sqrt(2 * len(gusts))
    assert gusts == list(islice(Random(10 * SECOND, SECOND, 2.0).all(3), 400))
    assert gusts[0] != next(Random(10 * SECOND, SECOND, 2.0).all(4))


def test_bad_input_is_refused() -> None:
    """With the value and the bound."""
    with pytest.raises(BadInput, match=r"turbulence\.acceleration is -1 m/s², it must be at least 0"):
        Turbulence(acceleration=-1.0)
    with pytest.raises(BadInput, match=r"turbulence\.correlation is 0 s"):
        Turbulence(correlation=0.0)
    with pytest.raises(BadInput, match=r"turbulence\.vertical is -1"):
        Turbulence(vertical=-1.0)
    with pytest.raises(BadInput, match="it starts at 0 or later and lasts a while"):
        Gust(-1, 5, (0.0, 0.0, 0.0))
    with pytest.raises(BadInput, match="both must be above 0"):
        Random(0, 1, 1.0)
    with pytest.raises(BadInput, match=r"gusts\.acceleration is nan"):
        Random(1, 1, math.nan)
