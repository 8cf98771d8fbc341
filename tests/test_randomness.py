"""Keyed random streams."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from volery.randomness import Stream, stream

COUNT = 4000
LEVEL = 1e-4
"""A fixed seed either passes for ever or was bad luck once in ten thousand."""


@given(seed=st.integers(0, 2**32), indices=st.lists(st.integers(0, 2000), max_size=30))
def test_a_draw_depends_on_its_index_alone(seed: int, indices: list[int]) -> None:
    """Whatever was drawn before, in whatever order, the draw of an index is the one that a new stream gives."""
    used = stream(seed, "loss", "1", "2")
    assert [used.uniform(index) for index in indices] == [
        stream(seed, "loss", "1", "2").uniform(index) for index in indices
    ]


def test_draws_are_uniform() -> None:
    """Kolmogorov-Smirnov finds nothing, and neighbouring draws are uncorrelated within 4 standard errors, 1/√n each."""
    draws = np.array([stream(3, "loss", "1", "2").uniform(index) for index in range(COUNT)])
    assert stats.kstest(draws, "uniform").pvalue > LEVEL
    assert abs(np.corrcoef(draws[:-1], draws[1:])[0, 1]) < 4 / COUNT**0.5


def test_normal_draws_are_normal() -> None:
    """Kolmogorov-Smirnov finds nothing against the standard normal law."""
    normal = stream(3, "noise", "1")
    assert stats.kstest([normal.normal(index) for index in range(COUNT)], "norm").pvalue > LEVEL


@given(first=st.integers(0, 300), count=st.integers(0, 100), before=st.integers(0, 300))
def test_several_normal_draws_are_those_of_their_indices(first: int, count: int, before: int) -> None:
    """Within a block of the generator and across, whatever was drawn before."""
    draws = stream(3, "noise", "1")
    draws.normal(before)
    assert draws.normals(first, count) == [stream(3, "noise", "1").normal(first + further) for further in range(count)]


def test_words_separate_streams() -> None:
    """Another seed, purpose, name, direction or split of the same letters is another stream."""
    words: list[tuple[int, str, *tuple[str, ...]]] = [
        (1, "loss", "1", "2"),
        (2, "loss", "1", "2"),
        (1, "latency", "1", "2"),
        (1, "loss", "2", "1"),
        (1, "loss", "12"),
        (1, "loss", "1", "2", "0"),
        (1, "loss1", "2"),
        (11, "loss", "2"),
    ]
    draws = np.array([[stream(*word).uniform(index) for index in range(COUNT)] for word in words])
    correlation = np.corrcoef(draws) - np.eye(len(words))
    assert abs(correlation).max() < 5 / COUNT**0.5
    assert len({*draws[:, 0]}) == len(words)


def test_the_bits_never_change() -> None:
    """A run is repeated from its seed years later: these draws were written down when the format was made."""
    loss = stream(7, "loss", "3", "12", "0")
    golden = {
        0: "0x1.7bc725b475bddp-1",
        63: "0x1.48014c49ae2bcp-3",
        64: "0x1.8ff077dbe1fbbp-1",
        100_000: "0x1.fc7da7eaebec8p-4",
    }
    assert {index: loss.uniform(index).hex() for index in golden} == golden


def test_draws_stay_inside_the_open_interval() -> None:
    """The smallest raw draw is above 0 and the largest below 1, so that inverse distribution functions are finite."""

    class Extremes(Stream):
        def __init__(self) -> None:
            super().__init__(0)
            self._block, self._draws = 0, [0, 2**64 - 1] * 32

    assert 0.0 < Extremes().uniform(0) < Extremes().uniform(1) < 1.0
    assert np.isfinite([Extremes().normal(0), Extremes().normal(1)]).all()
