"""An agent's clock under clock faults: its reading, and the instant at which a reading is reached."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.transport.clock import Clock
from volery.transport.faults import ClockFault

S = 10**9
Faults = list[tuple[int, int, int]]
FAULTS = st.lists(
    st.tuples(st.integers(0, S), st.integers(-(10**8), 10**8), st.integers(-240_000_000, 10**9)), max_size=4
)
"""Start, offset and drift of each; all drifts together let the clock go on."""
CREEPING: Faults = [(0, 0, 1 - S)]
"""One nanosecond a second."""


def clock_of(faults: Faults) -> Clock:
    """Build a clock from faults that are all active."""
    return Clock([ClockFault(f"c{at}", at, None, "1", offset, drift) for at, offset, drift in faults])


@given(FAULTS, st.integers(S, 2 * S), st.integers(-S, S))
@example([(0, 0, -240_000_000), (1, 0, -240_000_000), (2, 0, -240_000_000)], S, 12_345)
@example(CREEPING, S + S // 2, 1)
def test_a_clock_shows_a_reading_at_the_first_instant(faults: Faults, now: int, ahead: int) -> None:
    """`when` is the inverse of `reading`, found at once: there it is reached, and one nanosecond before it is not."""
    clock = clock_of(faults)
    wanted = clock.reading(now) + ahead
    when = clock.when(wanted, now)
    assert when >= now
    assert clock.reading(when) >= wanted
    assert when == now or clock.reading(when - 1) < wanted


@given(FAULTS, st.integers(S, 2 * S))
@example([(0, 0, -240_000_000)] * 4, S + 4)
def test_a_clock_never_goes_back(faults: Faults, now: int) -> None:
    """However many drifts there are at once; an instant later the reading is the same or larger."""
    clock = clock_of(faults)
    assert clock.reading(now - 1) <= clock.reading(now)
    assert clock.first_reading(now) == clock.reading(now - 1) + 1


def test_a_drifting_clock_reads_as_the_design_says() -> None:
    """T + offset + (t − t₀)·ppb // 10⁹; drifts that let it stand still are refused."""
    clock = clock_of([(S, 500, 20_000)])
    assert clock.reading(3 * S) == 3 * S + 500 + 40_000
    with pytest.raises(BadInput, match="would not go forward"):
        clock_of([(0, 0, -600_000_000)] * 2)
