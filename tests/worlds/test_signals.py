"""Signals of time."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.worlds.signals import Constant, Signal, Sine, Steps

SECOND = 1_000_000_000
SIGNALS: list[Signal] = [
    Constant(0.3),
    Steps((0, SECOND, 3 * SECOND), (0.1, 0.4, -0.2)),
    Sine(-0.5, 2.0, 0.1, 0.7),
]


@given(signal=st.sampled_from(SIGNALS), time_ns=st.integers(0, 10**12))
def test_values_stay_within_their_bounds(signal: Signal, time_ns: int) -> None:
    """At every instant."""
    low, high = signal.bounds()
    assert low <= signal.value(time_ns) <= high


def test_steps_change_exactly_at_their_times() -> None:
    """A level holds from its own time up to, and not at, the next."""
    steps = Steps((0, SECOND), (0.1, 0.2))
    assert [steps.value(t) for t in (0, SECOND - 1, SECOND, 50 * SECOND)] == [0.1, 0.1, 0.2, 0.2]


def test_sine_has_the_stated_mean_amplitude_frequency_and_phase() -> None:
    """A quarter of the 2 s period after the phase's zero it is at mean plus amplitude."""
    sine = Sine(mean=1.0, amplitude=0.5, frequency=0.5, phase=math.pi / 2)
    assert [sine.value(k * SECOND // 2) for k in range(4)] == pytest.approx([1.5, 1.0, 0.5, 1.0], abs=1e-12)


@pytest.mark.parametrize(
    ("times", "levels", "message"),
    [
        ((), (), "begin at 0"),
        ((1,), (0.1,), "begin at 0"),
        ((0, 5, 5), (1.0, 2.0, 3.0), "ascend"),
        ((0, 5), (1.0,), "one level for each time"),
    ],
)
def test_steps_that_make_no_sense_are_refused(times: tuple[int, ...], levels: tuple[float, ...], message: str) -> None:
    """No step at 0, times that do not ascend, as many levels as times."""
    with pytest.raises(BadInput, match=message):
        Steps(times, levels)


def test_a_sine_without_frequency_is_refused() -> None:
    """The remedy is to write the value alone."""
    with pytest.raises(BadInput, match="write the value alone"):
        Sine(1.0, 0.0, 0.0)
