"""Latency models against the laws that they are named after."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import integrate, stats

from volery.errors import BadInput
from volery.transport.directed_link import DirectedLink
from volery.transport.latency_settings import (
    LATENCIES,
    Constant,
    Gamma,
    LatencyTrace,
    LogNormal,
    Normal,
    Pareto,
    Uniform,
)
from volery.transport.latency_stages import latency_stage
from volery.transport.link_models import Latency

MS, SECOND = 10**6, 10**9
FRAMES = 20_000
LEVEL = 1e-4
"""Of a Kolmogorov-Smirnov test with a fixed seed. Whole nanoseconds are far below what it can resolve here."""


def drawn(model: Latency, frames: int = FRAMES, seed: int = 5) -> list[int]:
    """The latencies of the first frames of a link."""
    stage = latency_stage(model, DirectedLink.of(seed, "1", "2"))
    return [stage(index, 0, 0, index) for index in range(frames)]


def gamma(mean: float, sd: float) -> Any:
    """The law with shape (mean/sd)² and scale sd²/mean."""
    return stats.gamma((mean / sd) ** 2, scale=sd**2 / mean)


def lognormal(mean: float, sd: float) -> Any:
    """The law whose logarithm has variance ln(1 + sd²/mean²)."""
    variance = np.log1p((sd / mean) ** 2)
    return stats.lognorm(variance**0.5, scale=mean * np.exp(-variance / 2))


LAWS: list[tuple[Latency, Any, int]] = [
    (Uniform(2 * MS, 7 * MS), stats.uniform(2 * MS, 5 * MS), 2 * MS),
    (Normal(20 * MS, 2 * MS), stats.norm(20 * MS, 2 * MS), 14 * MS),
    (Normal(2 * MS, 2 * MS), stats.norm(2 * MS, 2 * MS), 0),
    (Normal(2 * MS, 2 * MS, 2 * MS), stats.norm(2 * MS, 2 * MS), 2 * MS),
    (Normal(5 * MS, 1 * MS, 0), stats.norm(5 * MS, 1 * MS), 0),
    (Gamma(4 * MS, 2 * MS), gamma(4 * MS, 2 * MS), int(gamma(4 * MS, 2 * MS).ppf(stats.norm.cdf(-3)))),
    (Gamma(4 * MS, 8 * MS, 3 * MS), gamma(4 * MS, 8 * MS), 3 * MS),
    (Gamma(4 * MS, MS, 0), gamma(4 * MS, MS), 0),
    (LogNormal(4 * MS, 2 * MS), lognormal(4 * MS, 2 * MS), int(lognormal(4 * MS, 2 * MS).ppf(stats.norm.cdf(-3)))),
    (LogNormal(4 * MS, 4 * MS, 4 * MS), lognormal(4 * MS, 4 * MS), 4 * MS),
    (LogNormal(4 * MS, MS, 0), lognormal(4 * MS, MS), 0),
    (Pareto(2 * MS, 3.5), stats.pareto(3.5, scale=2 * MS), 2 * MS),
]
IDS = [str(model) for model, *_ in LAWS]


def truncated(law: Any, minimum_ns: int) -> Callable[[Any], Any]:
    """Distribution function of a law given that it is at least the minimum."""
    below = law.cdf(minimum_ns)
    return lambda x: np.clip((law.cdf(x) - below) / (1 - below), 0.0, 1.0)


@pytest.mark.parametrize(("model", "law", "minimum_ns"), LAWS, ids=IDS)
def test_latencies_follow_their_truncated_law(model: Latency, law: Any, minimum_ns: int) -> None:
    """Kolmogorov-Smirnov finds nothing; what is cut off is what the field or the default says; frames do not depend.

    The mean is m + ∫ₘ (1 − F) dx of the truncated law, the sample's within 4 standard errors of it, and neighbours are
    uncorrelated within 4 standard errors 1/√n of their ranks.
    """
    cdf = truncated(law, minimum_ns)
    latencies = np.array(drawn(model))
    assert abs(model.minimum_ns - minimum_ns) <= 1
    assert latencies.min() >= model.minimum_ns
    assert stats.kstest(latencies, cdf).pvalue > LEVEL
    scale = law.std()
    tail, _ = integrate.quad(
        lambda x: 1 - cdf(minimum_ns + scale * x), 0, 200, limit=500, points=[0.1, 1, 5, 20], epsabs=1e-12
    )
    assert model.mean_ns == pytest.approx(minimum_ns + scale * tail, rel=1e-5)
    assert model.expected_ns(0) == model.mean_ns
    assert abs(latencies.mean() - model.mean_ns) < 4 * latencies.std() / FRAMES**0.5
    ranks = stats.rankdata(latencies)
    assert abs(np.corrcoef(ranks[:-1], ranks[1:])[0, 1]) < 4 / FRAMES**0.5
    assert model.variance_inflation == 1.0


CORRELATED: list[tuple[Latency, Any]] = [
    (Uniform(2 * MS, 7 * MS, 0.7), stats.uniform(2 * MS, 5 * MS)),
    (Normal(2 * MS, 2 * MS, correlation=0.9), stats.norm(2 * MS, 2 * MS)),
    (Normal(20 * MS, 2 * MS, correlation=-0.6), stats.norm(20 * MS, 2 * MS)),
    (Gamma(4 * MS, 4 * MS, correlation=0.5), gamma(4 * MS, 4 * MS)),
    (LogNormal(4 * MS, 4 * MS, 2 * MS, 0.8), lognormal(4 * MS, 4 * MS)),
    (Pareto(2 * MS, 3.5, 0.7), stats.pareto(3.5, scale=2 * MS)),
]


def normal_scores(model: Latency, law: Any, latencies: list[int]) -> NDArray[np.float64]:
    """Latencies as quantiles of the standard normal law, half a nanosecond up, as they were cut down to whole ones."""
    quantiles = truncated(law, model.minimum_ns)(np.array(latencies) + 0.5)
    return np.asarray(stats.norm.ppf(quantiles))


@pytest.mark.parametrize(("model", "law"), CORRELATED, ids=[str(model) for model, _ in CORRELATED])
def test_correlated_latencies(model: Any, law: Any) -> None:
    """The normal scores of latencies k = 1, 2, 3 apart have correlation ρᵏ, and the law itself stays exact.

    Within 4 standard errors, by Bartlett's formula for an AR(1) process; frames of which each other 60 lie between are
    independent, and Kolmogorov-Smirnov finds nothing in them.
    """
    latencies, rho = drawn(model), model.correlation
    scores = normal_scores(model, law, latencies)
    for k in (1, 2, 3):
        measured = np.corrcoef(scores[:-k], scores[k:])[0, 1]
        bartlett = (1 + rho**2) * (1 - rho ** (2 * k)) / (1 - rho**2) - 2 * k * rho ** (2 * k)
        assert abs(measured - rho**k) < 4 * (bartlett / FRAMES) ** 0.5
    assert stats.kstest(drawn(model, 60 * 1000)[::60], truncated(law, model.minimum_ns)).pvalue > LEVEL


@pytest.mark.parametrize("model", [CORRELATED[1][0], CORRELATED[4][0]], ids=str)
def test_the_mean_of_correlated_latencies_is_as_uncertain_as_said(model: Any) -> None:
    """Over 600 seeds the variance of the mean of 200 frames is below the bound, by no more than a law can bend it.

    The standard error of a variance is √(2/600) of it. Pearson's correlation of these laws is above ρ/2.
    """
    means = [np.mean(drawn(model, 200, seed)) for seed in range(600)]
    single = np.var([drawn(model, 1, seed) for seed in range(4000)])
    inflation, error = 200 * np.var(means) / single, 4 * (2 / 600) ** 0.5
    half = model.correlation / 2
    assert (1 + half) / (1 - half) * (1 - error) < inflation < model.variance_inflation * (1 + error)


def test_correlated_latencies_are_the_same_again() -> None:
    """A link's latencies follow from its names and the order of its frames; duplicates have their own."""
    model = CORRELATED[0][0]
    assert drawn(model, 50) == drawn(model, 50) != drawn(model, 50, 6)
    around = DirectedLink.of(5, "1", "2")
    stage, duplicates = latency_stage(model, around), latency_stage(model, around.within("duplicate"))
    mixed = [(stage(index, 0, 0, 0), duplicates(index, 0, 0, 0))[0] for index in range(50)]
    assert mixed == drawn(model, 50)


@given(
    kind=st.sampled_from([Normal, Gamma, LogNormal]),
    mean=st.integers(1, 50 * MS),
    sd=st.integers(1, 50 * MS),
    share=st.none() | st.floats(0, 1),
    correlation=st.sampled_from([0.0, 0.9, -0.9]),
    seed=st.integers(0, 1000),
)
def test_no_latency_is_below_the_minimum(
    kind: Any, mean: int, sd: int, share: float | None, correlation: float, seed: int
) -> None:
    """The minimum is what promises rest on; it is at least 0, whole, and never undercut."""
    model = kind(mean, sd, None if share is None else int(share * mean), correlation)
    least = model.minimum_ns if share is None else int(share * mean)
    assert isinstance(model.minimum_ns, int)
    assert 0 <= model.minimum_ns == least <= mean
    assert all(isinstance(latency, int) and latency >= least for latency in drawn(model, 100, seed))
    assert model.mean_ns >= least


@given(
    low=st.integers(0, 50 * MS),
    span=st.integers(1, 50 * MS),
    correlation=st.sampled_from([0.0, 0.99, -0.5]),
    seed=st.integers(0, 1000),
)
def test_uniform_latencies_stay_between_their_bounds(low: int, span: int, correlation: float, seed: int) -> None:
    """Both bounds hold, and the lower one is the minimum."""
    model = Uniform(low, low + span, correlation)
    assert model.minimum_ns == low
    assert all(low <= latency <= low + span for latency in drawn(model, 100, seed))


def test_without_spread_latency_is_constant() -> None:
    """A standard deviation of 0 and a constant are the same thing."""
    assert set(drawn(Normal(3 * MS, 0), 20)) == set(drawn(Constant(3 * MS), 20)) == {3 * MS}
    assert Normal(3 * MS, 0).mean_ns == Constant(3 * MS).mean_ns == Constant(3 * MS).expected_ns(7) == 3 * MS
    assert Normal(3 * MS, 0).minimum_ns == Constant(3 * MS).minimum_ns == 3 * MS


def test_a_trace_says_how_long_frames_travel() -> None:
    """By the instant at which the last bit leaves: from its time on until the next, then for ever or from the start."""
    times, values = (0, SECOND, 3 * SECOND), (5 * MS, 9 * MS, 2 * MS)
    instants = [0, SECOND - 1, SECOND, 3 * SECOND, 4 * SECOND, 5 * SECOND]
    for repeat, travel, mean in ((None, [5, 5, 9, 2, 2, 2], 2.0), (4 * SECOND, [5, 5, 9, 2, 5, 9], 6.25)):
        model = LatencyTrace(times, values, repeat)
        stage = latency_stage(model, DirectedLink.of(1, "1", "2"))
        assert [stage(index, 0, 0, instant) for index, instant in enumerate(instants)] == [
            value * MS for value in travel
        ]
        assert [model.expected_ns(instant) for instant in instants] == [value * MS for value in travel]
        assert (model.minimum_ns, model.mean_ns, model.variance_inflation) == (2 * MS, mean * MS, 1.0)


def test_every_model_is_tried() -> None:
    """None that a scenario can name is forgotten."""
    models = [Constant(3), *(model for model, *_ in LAWS), LatencyTrace((0, 5), (3, 4), 7)]
    assert {type(model) for model in models} == set(LATENCIES.classes())


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        (Constant, (-1,), "latency is -1 ns, a latency is at least 0"),
        (Uniform, (2, 1), "high is 1 ns and low 2 ns"),
        (Uniform, (2, 2, 0.5), "correlation is 0.5 of latencies that are all equal"),
        (Normal, (2, 1, 3), "min is 3 ns and mean 2 ns"),
        (Normal, (2, -1), "sd is -1 ns"),
        (Normal, (2, 1, -1), "min is -1 ns"),
        (Normal, (2, 0, None, 0.5), "correlation is 0.5 of latencies that are all equal"),
        (Gamma, (0, 1), "mean is 0 ns, it must be above 0"),
        (Gamma, (2, 0), "sd is 0 ns, it must be above 0: without spread use constant"),
        (Gamma, (2, 1, 3), "min is 3 ns and mean 2 ns"),
        (LogNormal, (-1, 1), "mean is -1 ns"),
        (LogNormal, (2, 1, 3), "min is 3 ns and mean 2 ns"),
        (Pareto, (0, 2.0), "min is 0 ns, a pareto latency starts above 0"),
        (Pareto, (5, 1.0), "shape is 1, it must be above 1"),
        (Pareto, (5, float("inf")), "shape is inf"),
        (LatencyTrace, ((0, 5), (1, -1)), "latency is -1 ns"),
        (LatencyTrace, ((0, 5, 3), (1, 2, 3)), "put them in order"),
        (LatencyTrace, ((0,), (1, 2)), "1 times and 2 latencies"),
        *[
            (kind, arguments, f"correlation is {bad:g}, it must lie between −1 and 1")
            for bad in (-1.0, 1.0, float("nan"))
            for kind, arguments in [
                (Uniform, (1, 2, bad)),
                (Normal, (2, 1, 0, bad)),
                (Gamma, (2, 1, 0, bad)),
                (LogNormal, (2, 1, 0, bad)),
                (Pareto, (2, 2.0, bad)),
            ]
        ],
    ],
)
def test_impossible_latencies_are_refused(kind: Any, arguments: tuple[Any, ...], message: str) -> None:
    """The message gives the values and the bound."""
    with pytest.raises(BadInput, match=message):
        kind(*arguments)
