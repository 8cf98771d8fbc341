"""What faults make of samples: stuck sensors repeat themselves, noise is drawn for each number."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.agents.plan import Plan
from volery.agents.sensor_samples import Disturbances, measured
from volery.transport.faults import Fault, SensorFault

MS = 1_000_000


@dataclass(frozen=True)
class Counter:
    """A world whose one sensor says, 100 times a second, which sample it is."""

    def sensors(self, agent: str) -> Mapping[str, float]:
        """One for each agent."""
        return {"count": 100.0}

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """The index."""
        return np.array([float(index)])


def said(*faults: Fault) -> list[float | None]:
    """The first six samples, taken every 10 ms from 0 on."""
    plan = Plan("count", 7, 60 * MS, (), {}, Counter(), faults)
    samples = [measured(plan, plan.faults, "1", "count", index) for index in range(6)]
    return [None if sample is None else float(sample[0]) for sample in samples]


def trouble(name: str, what: str, at_ms: int, until_ms: int | None, *size: float) -> SensorFault:
    """Something wrong with the sensor from one millisecond until another."""
    until_ns = None if until_ms is None else until_ms * MS
    return SensorFault(name, at_ms * MS, until_ns, "1", "count", what, size)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("faults", "expected"),
    [
        ([trouble("s", "stuck", 20, 50)], [0, 1, 1, 1, 1, 5]),
        ([trouble("s", "stuck", 20, 50), trouble("b", "bias", 0, 30, 10.0)], [10, 11, 11, 11, 11, 5]),
        ([trouble("s", "stuck", 20, 50), trouble("b", "bias", 30, None, 10.0)], [0, 1, 1, 11, 11, 15]),
        ([trouble("s", "stuck", 20, 50), trouble("u", "stuck", 40, None)], [0, 1, 1, 1, 1, 1]),
        ([trouble("f", "failed", 10, 30), trouble("s", "stuck", 20, 50)], [0, None, None, None, None, 5]),
        ([trouble("s", "stuck", 0, 20)], [None, None, 2, 3, 4, 5]),
    ],
)
def test_a_stuck_sensor_repeats_its_last_sample(faults: list[Fault], expected: list[float | None]) -> None:
    """As it was before, with what was wrong with it then; what goes wrong later comes on top."""
    assert said(*faults) == expected


def test_noise_on_a_stuck_sensor_is_new_each_time() -> None:
    """Only what came before it got stuck is repeated."""
    values = said(trouble("s", "stuck", 20, None), trouble("t", "noise", 30, None, 1.0))
    assert values[2] == 1
    assert len(set(values[3:])) == 3


@pytest.mark.parametrize("shape", [(3,), (2, 4)], ids=["vector", "rows"])
def test_noise_is_drawn_for_each_number_of_each_sample(shape: tuple[int, ...]) -> None:
    """As large as it is said for each component, independent of all others; what says whose a row is keeps clean.

    Over n samples a standard deviation is known to 1 / √(2n) of itself, a correlation to 1 / √n.
    """
    sizes, count = (1.0, 2.0, 0.5), 2000
    fault = trouble("t", "noise", 0, None, *sizes)
    disturbances = Disturbances(7)
    samples = []
    for index in range(count):
        sample = disturbances.disturbed([fault], "1", "count", index, index * MS, np.zeros(shape))
        assert sample is not None
        samples.append(sample)
    drawn = np.array(samples)
    if len(shape) == 2:
        assert (drawn[..., 0] == 0).all()
        drawn = drawn[..., 1:]
    series = drawn.reshape(count, -1)
    expected = np.resize(sizes, series.shape[1])
    np.testing.assert_allclose(series.std(axis=0), expected, rtol=4 / (2 * count) ** 0.5)
    related = np.corrcoef(np.hstack([series[1:], series[:-1]]), rowvar=False) - np.eye(2 * series.shape[1])
    assert abs(related).max() < 5 / count**0.5
