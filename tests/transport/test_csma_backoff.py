"""Carrier sense: the attempts of one radio, step by step."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.randomness import stream
from volery.transport.csma import Contention
from volery.transport.media import earliest_start
from volery.transport.media_settings import Csma, HalfDuplex

US = 1_000


def contention(access: Csma | None = None) -> Contention:
    """A radio with draws of its own."""
    return Contention(access or Csma(), stream(7, "backoff", "1", "0"))


@given(st.integers(0, 10**9), st.lists(st.booleans(), min_size=5, max_size=5))
def test_attempts_go_by_the_standard(now: int, heard: list[bool]) -> None:
    """Backoffs of 0 to 2^BE − 1 periods with BE from 3 to 5, then 128 µs of listening, 192 µs of turning round."""
    radio, exponent, time = contention(), 3, now
    listened = radio.begin(now)
    for attempt, busy in enumerate(heard):
        waited = listened - time - 128 * US
        assert waited % (320 * US) == 0
        assert 0 <= waited // (320 * US) < 2**exponent
        assert radio.earliest_ns() == listened + 192 * US
        goes_on = radio.sensed(listened, busy=busy)
        if not busy:
            assert (goes_on, radio.start_ns) == (True, listened + 192 * US)
            assert radio.earliest_ns() == radio.start_ns
            return
        assert goes_on is (attempt < 4)
        time, exponent = listened, min(exponent + 1, 5)
        listened = radio.sense_ns or 0
    assert radio.idle


def test_every_backoff_is_drawn_as_often() -> None:
    """Over many frames the eight backoffs of the first attempt come within 4 standard errors of an eighth each."""
    radio, frames = contention(), 8000
    waits = [(radio.begin(0) - 128 * US) // (320 * US) for _ in range(frames)]
    error = (frames / 8 * 7 / 8) ** 0.5
    assert all(abs(waits.count(number) - frames / 8) < 4 * error for number in range(8))


def test_nothing_starts_before_the_earliest() -> None:
    """A frame that is offered later cannot start sooner than without any backoff."""
    assert earliest_start(Csma(), 1000, 5, 0, 1) == 1000 + 320 * US


@pytest.mark.parametrize("wrong", [{"min_be": 4, "max_be": 3}, {"max_backoffs": -1}, {"cca": 0}, {"max_be": 31}])
def test_impossible_parameters_are_refused(wrong: dict[str, int]) -> None:
    """And so is carrier sense on an edge, where there is nobody to listen for."""
    with pytest.raises(BadInput):
        Csma(**wrong)
    with pytest.raises(BadInput, match="per: node"):
        HalfDuplex("edge", Csma())
