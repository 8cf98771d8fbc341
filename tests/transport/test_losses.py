"""Loss models against the laws that they are named after."""

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from volery.errors import BadInput
from volery.transport.links import LOST, LinkSettings
from volery.transport.losses import Bernoulli, GilbertElliott, Loss
from volery.transport.stages import Surroundings

FRAMES = 20_000
SEED = 11


def lost(model: Loss, frames: int = FRAMES, seed: int = SEED) -> list[bool]:
    """Which of the frames of one link a model loses."""
    stage = model.stage(Surroundings.of(seed, "1", "2"))
    return [stage.lost(index, index, 8) for index in range(frames)]


@pytest.mark.parametrize("probability", [0.01, 0.3, 0.9])
def test_bernoulli_loses_its_share(probability: float) -> None:
    """The rate is within 3 standard errors √(p(1−p)/n), and losses of neighbouring frames are uncorrelated."""
    losses = np.array(lost(Bernoulli(probability)), dtype=float)
    assert abs(losses.mean() - probability) < 3 * (probability * (1 - probability) / FRAMES) ** 0.5
    assert abs(np.corrcoef(losses[:-1], losses[1:])[0, 1]) < 4 / FRAMES**0.5


@pytest.mark.parametrize(("probability", "fate"), [(0.0, False), (1.0, True)])
def test_bernoulli_at_its_ends_is_certain(probability: float, fate: bool) -> None:
    """A loss of 0 loses nothing and a loss of 1 everything."""
    assert set(lost(Bernoulli(probability), 500)) == {fate}


@pytest.mark.parametrize(
    "model",
    [
        GilbertElliott(0.05, 0.3),
        GilbertElliott(0.05, 0.3, 0.9),
        GilbertElliott(0.02, 0.1, 0.8, 0.05),
        GilbertElliott(0.6, 0.7, 0.5, 0.1),
    ],
)
def test_gilbert_elliott_loses_its_share(model: GilbertElliott) -> None:
    """The rate is within 3 standard errors of the long-run mean.

    With π = P(bad), r = 1 − to_bad − to_good and d = loss_bad − loss_good, losses k apart have covariance
    d²π(1−π)rᵏ, so the variance of the mean of n frames tends to (p(1−p) + 2d²π(1−π) r/(1−r)) / n.
    """
    bad, keeps = model.stationary_bad, 1 - model.to_bad - model.to_good
    assert model.mean == pytest.approx(bad * model.loss_bad + (1 - bad) * model.loss_good)
    burstiness = 2 * (model.loss_bad - model.loss_good) ** 2 * bad * (1 - bad) * keeps / (1 - keeps)
    variance = (model.mean * (1 - model.mean) + burstiness) / FRAMES
    assert abs(np.mean(lost(model)) - model.mean) < 3 * variance**0.5


def test_gilbert_elliott_comes_in_geometric_bursts() -> None:
    """With certain loss in the bad state, bursts last k frames with probability g(1−g)ᵏ⁻¹, gaps with b(1−b)ᵏ⁻¹.

    χ² over the lengths 1 to 8 and longer; a fixed seed, at level 1e-4.
    """
    model = GilbertElliott(to_bad=0.2, to_good=0.35)
    runs = [(state, len(list(members))) for state, members in groupby(lost(model))][1:-1]
    for state, leaves in ((True, model.to_good), (False, model.to_bad)):
        lengths = [length for burst, length in runs if burst == state]
        seen = np.bincount(np.minimum(lengths, 9), minlength=10)[1:]
        law = np.array([leaves * (1 - leaves) ** (k - 1) for k in range(1, 9)] + [(1 - leaves) ** 8])
        assert stats.chisquare(seen, law * len(lengths)).pvalue > 1e-4


def test_gilbert_elliott_starts_in_its_stationary_law() -> None:
    """Over many seeds the first frame meets the bad state as often as any: within 3 standard errors."""
    model, seeds = GilbertElliott(0.05, 0.1), 3000
    first = np.mean([lost(model, 1, seed)[0] for seed in range(seeds)])
    assert abs(first - model.mean) < 3 * (model.mean * (1 - model.mean) / seeds) ** 0.5


@given(st.integers(0, 50), st.integers(1, 50))
def test_a_list_of_models_is_their_sum(sending_end: Any, first: int, frames: int) -> None:
    """A frame is lost if any of the models loses it; each draws from streams of its own."""
    never, some, bursts = Bernoulli(0.0), Bernoulli(0.3), GilbertElliott(0.2, 0.4, 0.8)
    verdicts = []
    for models in ((some, bursts), (some,), (never, bursts)):
        sender = sending_end(LinkSettings(loss=models), seed=first)
        for _ in range(frames):
            sender.offer(0, b"x")
        verdicts.append([sender.transmit(index).verdict == LOST for index in range(frames)])
    together, *apart = verdicts
    assert together == [any(fates) for fates in zip(*apart, strict=True)]


@pytest.mark.parametrize("bad", [-0.1, 1.1, float("nan")])
def test_no_probability_is_refused(bad: float) -> None:
    """The message names the value and the bounds."""
    with pytest.raises(BadInput, match=rf"loss probability is {bad:g}, a probability lies between 0 and 1"):
        Bernoulli(bad)
    with pytest.raises(BadInput, match=f"to_good is {bad:g}"):
        GilbertElliott(0.5, bad)


def test_a_chain_that_never_moves_is_refused() -> None:
    """It has no stationary law; the remedy is named."""
    with pytest.raises(BadInput, match="use bernoulli instead"):
        GilbertElliott(0.0, 0.0)
