"""Latency models against the laws that they are named after."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from volery.errors import BadInput
from volery.transport.latencies import Constant, Latency, Normal, Uniform
from volery.transport.stages import Surroundings

MS = 1_000_000
FRAMES = 4000
LEVEL = 1e-4
"""Of a Kolmogorov-Smirnov test with a fixed seed. Whole nanoseconds are far below what it can resolve here."""


def drawn(model: Latency, frames: int = FRAMES, seed: int = 5) -> list[int]:
    """The latencies of the first frames of a link."""
    stage = model.stage(Surroundings.of(seed, "1", "2"))
    return [stage(index, index) for index in range(frames)]


MODELS = [
    (Uniform(2 * MS, 7 * MS), stats.uniform(2 * MS, 5 * MS)),
    (Normal(20 * MS, 2 * MS), stats.truncnorm(-3, np.inf, 20 * MS, 2 * MS)),
    (Normal(2 * MS, 2 * MS), stats.truncnorm(-1, np.inf, 2 * MS, 2 * MS)),
    (Normal(2 * MS, 2 * MS, 2 * MS), stats.truncnorm(0, np.inf, 2 * MS, 2 * MS)),
    (Normal(5 * MS, 1 * MS, 0), stats.truncnorm(-5, np.inf, 5 * MS, 1 * MS)),
]


@pytest.mark.parametrize(("model", "law"), MODELS)
def test_latencies_follow_their_law(model: Latency, law: stats.rv_frozen) -> None:
    """Kolmogorov-Smirnov finds nothing; the mean is that of the law, and the sample's within 4 standard errors."""
    latencies = drawn(model)
    assert stats.kstest(latencies, law.cdf).pvalue > LEVEL
    assert model.mean_ns == pytest.approx(law.mean(), rel=1e-9)
    assert abs(np.mean(latencies) - model.mean_ns) < 4 * law.std() / FRAMES**0.5


@given(
    mean=st.integers(0, 50 * MS),
    sd=st.integers(0, 50 * MS),
    share=st.none() | st.floats(0, 1),
    seed=st.integers(0, 1000),
)
def test_no_normal_latency_is_below_the_minimum(mean: int, sd: int, share: float | None, seed: int) -> None:
    """The minimum is what promises rest on; it is at least 0, whole, and never undercut."""
    model = Normal(mean, sd, None if share is None else int(share * mean))
    expected = max(0, mean - 3 * sd) if share is None else int(share * mean)
    assert model.minimum_ns == expected
    latencies = drawn(model, 100, seed)
    assert all(isinstance(latency, int) and latency >= expected for latency in latencies)


@given(low=st.integers(0, 50 * MS), span=st.integers(0, 50 * MS), seed=st.integers(0, 1000))
def test_uniform_latencies_stay_between_their_bounds(low: int, span: int, seed: int) -> None:
    """Both bounds hold, and the lower one is the minimum."""
    model = Uniform(low, low + span)
    assert model.minimum_ns == low
    assert all(low <= latency <= low + span for latency in drawn(model, 100, seed))


def test_without_spread_latency_is_constant() -> None:
    """A standard deviation of 0 and a constant are the same thing."""
    assert set(drawn(Normal(3 * MS, 0), 20)) == set(drawn(Constant(3 * MS), 20)) == {3 * MS}
    assert Normal(3 * MS, 0).mean_ns == Constant(3 * MS).mean_ns == 3 * MS
    assert Normal(3 * MS, 0).minimum_ns == Constant(3 * MS).minimum_ns == 3 * MS


def test_impossible_latencies_are_refused() -> None:
    """The message gives the values and the bound."""
    with pytest.raises(BadInput, match="latency is -1 ns, a latency is at least 0"):
        Constant(-1)
    with pytest.raises(BadInput, match="high is 1 ns and low 2 ns"):
        Uniform(2, 1)
    with pytest.raises(BadInput, match="min is 3 ns and mean 2 ns"):
        Normal(2, 1, 3)
    with pytest.raises(BadInput, match="sd is -1 ns"):
        Normal(2, -1)
