"""Loss models against the laws that they are named after, each tolerance from the variance of the model itself."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from volery.randomness import stream
from volery.transport.directed_link import DirectedLink
from volery.transport.link_models import Loss
from volery.transport.loss_settings import (
    Bernoulli,
    BitError,
    Distance,
    Frames,
    GilbertElliott,
    GilbertElliottTime,
    LossTrace,
    Markov,
    loss_variance,
)
from volery.transport.loss_stages import expected_loss, loss_stage, loss_stages

MS, SECOND = 10**6, 10**9
FRAMES = 100_000
SEED = 11
BITS = 400

MODELS: list[tuple[Loss, ...]] = [
    (Bernoulli(0.01),),
    (Bernoulli(0.3),),
    (Bernoulli(0.05, 0.5),),
    (Bernoulli(0.3, 0.95),),
    (GilbertElliott(0.05, 0.3),),
    (GilbertElliott(0.05, 0.3, 0.9),),
    (GilbertElliott(0.002, 0.01, 0.8, 0.05),),
    (GilbertElliott(0.6, 0.7, 0.5, 0.1),),
    (GilbertElliottTime(200 * MS, 20 * MS),),
    (GilbertElliottTime(SECOND, 500 * MS, 0.7, 0.01),),
    (Markov(300 * MS, 30 * MS),),
    (BitError(1e-3),),
    (Distance(2.0, -60.0),),
    (Distance(2.7, -65.0, shadowing=4.0, decorrelation=500 * MS),),
    (LossTrace((0, SECOND, 3 * SECOND), (0.0, 0.4, 0.1), 4 * SECOND),),
    (Frames(((100, 199), 5000)),),
    (GilbertElliott(0.05, 0.3, 0.9), Bernoulli(0.1, 0.5), Markov(300 * MS, 30 * MS), BitError(1e-4)),
]


def surroundings(seed: int = SEED) -> DirectedLink:
    """A link whose ends are between 5 m and 15 m apart."""
    return DirectedLink.of(seed, "1", "2", 0, lambda time_ns: 10.0 + 5.0 * np.sin(time_ns / 1e10))


def starts(frames: int) -> list[int]:
    """A frame every 5 ms, each up to 4 ms late."""
    late = stream(SEED, "late")
    return [index * 5 * MS + int(4 * MS * late.uniform(index)) for index in range(frames)]


def run(models: Sequence[Loss], starts_ns: Sequence[int], seed: int = SEED) -> tuple[NDArray[np.bool_], list[float]]:
    """Which frames are lost, and the probability of each."""
    stages = loss_stages(models, surroundings(seed))
    lost = [
        sum(stage.lost(index, start, BITS) for stage in stages) > 0  # none may miss a frame
        for index, start in enumerate(starts_ns)
    ]
    expected = [expected_loss(stages, index, start, BITS) for index, start in enumerate(starts_ns)]
    return np.array(lost), expected


@pytest.mark.parametrize("frames", [30_000, pytest.param(100_000, marks=pytest.mark.long)])
@pytest.mark.parametrize("models", MODELS, ids=str)
def test_a_model_loses_its_share(models: tuple[Loss, ...], frames: int) -> None:
    """The number of losses is within 3 standard errors of what is expected, correlation included."""
    starts_ns = starts(frames)
    lost, expected = run(models, starts_ns)
    error = loss_variance(models, list(enumerate(starts_ns)), expected) ** 0.5
    assert abs(lost.sum() - sum(expected)) <= 3 * error
    assert error < 6.4 * frames**0.5


@pytest.mark.parametrize("seeds", [500, pytest.param(1500, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "models",
    [
        (Bernoulli(0.3, 0.8),),
        (GilbertElliott(0.05, 0.2, 0.9, 0.1),),
        (GilbertElliott(0.8, 0.7, 0.9, 0.1),),
        (GilbertElliottTime(60 * MS, 30 * MS, 0.9, 0.1),),
        (Markov(60 * MS, 30 * MS),),
        (BitError(1e-3),),
        (Bernoulli(0.2, 0.7), GilbertElliott(0.05, 0.2), Markov(100 * MS, 30 * MS)),
    ],
    ids=str,
)
def test_the_variance_of_a_model_is_that_of_its_losses(models: tuple[Loss, ...], seeds: int) -> None:
    """Over the seeds the variance of the number lost in 100 frames is within 4 standard errors of the formula.

    The standard error of a sample variance is √((m₄ − s⁴) / n).
    """
    starts_ns = starts(100)
    losses = np.array([run(models, starts_ns, seed)[0].sum() for seed in range(seeds)], dtype=float)
    _, expected = run(models, starts_ns)
    variance, fourth = losses.var(), float(((losses - losses.mean()) ** 4).mean())
    error = ((fourth - variance**2) / seeds) ** 0.5
    assert abs(variance - loss_variance(models, list(enumerate(starts_ns)), expected)) < 4 * error
    assert abs(losses.mean() - sum(expected)) < 4 * (variance / seeds) ** 0.5


def test_long_run_variances_in_closed_form() -> None:
    """Per frame: p(1−p)(1+ρ)/(1−ρ); p(1−p) + 2d²π(1−π)r/(1−r), with r = e^(−Δ/τ) for chains in time.

    Over 20,000 frames the ends of a run matter less than 1 part in 100.
    """
    starts_ns = [index * 5 * MS for index in range(20_000)]

    def per_frame(model: Loss) -> float:
        return loss_variance((model,), list(enumerate(starts_ns)), [model.mean] * len(starts_ns)) / len(starts_ns)

    assert per_frame(Bernoulli(0.3, 0.8)) == pytest.approx(0.21 * 9, rel=0.01)
    assert per_frame(GilbertElliott(0.05, 0.2, 0.9, 0.1)) == pytest.approx(
        0.26 * 0.74 + 2 * 0.8**2 * 0.2 * 0.8 * 0.75 / 0.25, rel=0.01
    )
    r = np.exp(-5 / 60 - 5 / 30)
    assert per_frame(Markov(60 * MS, 30 * MS)) == pytest.approx(2 / 9 * (1 + r) / (1 - r), rel=0.01)


def test_gilbert_elliott_at_a_million_frames() -> None:
    """Stationary loss within 3 standard errors of the long-run variance, mean burst length within 3 of its own.

    Bursts are geometric with mean 1/to_good and variance (1 − to_good)/to_good².
    """
    model, frames = GilbertElliott(0.02, 0.25), 1_000_000
    stage = loss_stage(model, surroundings())
    lost = np.array([stage.lost(index, 0, BITS) for index in range(frames)])
    keeps = 1 - model.to_bad - model.to_good
    variance = model.mean * (1 - model.mean) * (1 + keeps) / (1 - keeps)
    assert abs(lost.mean() - model.mean) < 3 * (variance / frames) ** 0.5
    edges = np.flatnonzero(np.diff(lost.astype(int)))
    lengths = np.diff(edges)[int(lost[edges[0]]) :: 2]
    error = ((1 - model.to_good) / model.to_good**2 / len(lengths)) ** 0.5
    assert abs(lengths.mean() - 1 / model.to_good) < 3 * error


@pytest.mark.parametrize(
    ("model", "ends", "begins"),
    [
        (GilbertElliott(0.2, 0.35), 0.35, 0.2),
        (Bernoulli(0.3, 0.5), 0.35, 0.15),
        (Bernoulli(0.3), 0.7, 0.3),
        (Markov(20 * MS, 10 * MS), 2 / 3 * (1 - np.exp(-0.75)), 1 / 3 * (1 - np.exp(-0.75))),
    ],
    ids=str,
)
def test_runs_are_geometric(model: Loss, ends: float, begins: float) -> None:
    """Where the good state loses nothing, bursts last k frames with probability g(1−g)ᵏ⁻¹, gaps with b(1−b)ᵏ⁻¹.

    g = 1 − ρ(1 − p) − p and b = p(1 − ρ) with correlation; for a chain in time asked every Δ, P(down)(1 − e^(−Δ/τ)) to
    begin and P(up)(1 − e^(−Δ/τ)) to end. χ² over the lengths 1 to 8 and longer; a fixed seed, at level 1e-4.
    """
    stage = loss_stage(model, surroundings())
    lost = [stage.lost(index, index * 5 * MS, BITS) for index in range(40_000)]
    runs = [(state, len(list(members))) for state, members in groupby(lost)][1:-1]
    for state, leaves in ((True, ends), (False, begins)):
        lengths = [length for burst, length in runs if burst == state]
        seen = np.bincount(np.minimum(lengths, 9), minlength=10)[1:]
        law = np.array([leaves * (1 - leaves) ** (k - 1) for k in range(1, 9)] + [(1 - leaves) ** 8])
        assert stats.chisquare(seen, law * len(lengths)).pvalue > 1e-4


@pytest.mark.parametrize(
    "model",
    [
        GilbertElliott(0.05, 0.1),
        Bernoulli(0.3, 0.9),
        GilbertElliottTime(20 * MS, 10 * MS, 0.9, 0.2),
        Markov(20 * MS, 10 * MS),
    ],
    ids=str,
)
def test_chains_start_in_their_stationary_law(model: Loss) -> None:
    """Over many seeds the first frame is lost as often as any: within 3 standard errors."""
    seeds = 3000
    first = np.mean([loss_stage(model, surroundings(seed)).lost(0, 0, BITS) for seed in range(seeds)])
    assert abs(first - model.mean) < 3 * (model.mean * (1 - model.mean) / seeds) ** 0.5


def test_shadowing_is_normal_and_forgets() -> None:
    """Loss over a fixed distance is that of the normal law, within 3 standard errors with its autocorrelation.

    Given the shadowing X, p(X) is known; two frames k apart have covariance Var p(X) · e^(−kΔ/τ).
    """
    model, apart = Distance(2.0, -62.0, width=2.0, shadowing=5.0, decorrelation=100 * MS), 5 * MS
    link = DirectedLink.of(SEED, "1", "2", 0, lambda _time_ns: 10.0)
    stage = loss_stage(model, link)
    lost = np.array([stage.lost(index, index * apart, BITS) for index in range(FRAMES)])
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    given = np.array([model.loss_at(10.0, model.shadowing * node) for node in nodes])
    mean = float(weights @ given / weights.sum())
    spread = float(weights @ given**2 / weights.sum()) - mean**2
    keeps = np.exp(-apart / (100 * MS))
    variance = mean * (1 - mean) + 2 * spread * keeps / (1 - keeps)
    assert abs(lost.mean() - mean) < 3 * (variance / FRAMES) ** 0.5
    assert 0.2 < mean < 0.5


def test_independent_losses_are_uncorrelated() -> None:
    """Without correlation the fates of neighbouring frames have none: within 4 standard errors 1/√n."""
    lost, _ = run((Bernoulli(0.3),), starts(FRAMES))
    assert abs(np.corrcoef(lost[:-1], lost[1:])[0, 1]) < 4 / FRAMES**0.5


def test_correlation_is_what_was_asked_for() -> None:
    """Of fates k = 1, 2, 3 apart it is ρᵏ, within 4 standard errors.

    Batches of 1000 frames are nearly independent and give the error: correlation reaches over some ten frames.
    """
    lost, _ = run((Bernoulli(0.3, 0.6),), starts(FRAMES))
    batches = (lost - 0.3).reshape(-1, 1000)
    for k in (1, 2, 3):
        estimates = (batches[:, :-k] * batches[:, k:]).mean(axis=1) / 0.21
        error = estimates.std(ddof=1) / len(estimates) ** 0.5
        assert abs(estimates.mean() - 0.6**k) < 4 * error


def test_frames_that_are_left_out_weigh_on_no_others() -> None:
    """Of two frames the variance is 2p(1−p) + 2c·rᵏ·e^(−λΔt), with k from their numbers and Δt from their starts."""
    frames, expected = [(3, 70 * MS), (7, 100 * MS)], [0.3, 0.3]
    assert loss_variance([Bernoulli(0.3, 0.8)], frames, expected) == pytest.approx(0.42 * (1 + 0.8**4))
    chain = Markov(70 * MS, 30 * MS)
    assert loss_variance([chain], frames, expected) == pytest.approx(0.42 * (1 + np.exp(-30 / 70 - 30 / 30)))
    never: list[Loss] = [Frames((3,)), BitError(0.1)]
    assert loss_variance(never, frames, [1.0, 0.5]) == 0.25
