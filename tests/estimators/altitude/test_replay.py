"""Measurements in any order: what is believed does not depend on it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.estimators.altitude.replay import Replay, Stamped

Trail = tuple[tuple[int, str], ...]


def trail(before: Trail, measurement: Stamped) -> Trail:
    """All measurements so far, in the order of use."""
    return (*before, (measurement.time_ns, measurement.source))


def stamped(time_ns: int, source: str = "a", stamp_ns: int | None = None) -> Stamped:
    """A measurement without values that matter."""
    return Stamped(time_ns, source, np.zeros(1), stamp_ns)


@given(st.lists(st.tuples(st.integers(0, 100), st.sampled_from("abc")), unique=True, min_size=1), st.randoms())
def test_any_order_within_the_window_gives_the_same(keys: list[tuple[int, str]], chance: object) -> None:
    """That of the stamps, and of the names where stamps are equal."""
    replay = Replay[Trail]((), 0, trail, 100)
    chance.shuffle(keys)  # type: ignore[attr-defined]
    for number, key in enumerate(keys):
        outcome = replay.take(stamped(*key))
        assert outcome == ("in order" if key == max(keys[: number + 1]) else "replayed")
        assert replay.take(stamped(*key)) == "repeated"
    assert replay.latest == tuple(sorted(keys))


def test_what_is_older_than_the_window_is_too_late() -> None:
    """The window counts back from the newest stamp; what was used before it stays used."""
    replay = Replay[Trail]((), 0, trail, 50)
    assert [replay.take(stamped(time)) for time in (0, 100, 60, 50, 49)] == [
        "in order",
        "in order",
        "replayed",
        "replayed",
        "too old",
    ]
    assert [time for time, _ in replay.latest] == [0, 50, 60, 100]
    assert replay.take(stamped(200)) == "in order"
    assert replay.take(stamped(149)) == "too old"
    assert replay.take(stamped(150)) == "replayed"
    assert [time for time, _ in replay.latest] == [0, 50, 60, 100, 150, 200]


def test_a_copy_is_known_by_its_stamp() -> None:
    """Of a sensor whose clock is ahead copies come at other times; two measurements of one time are both used."""
    replay = Replay[Trail]((), 0, trail, 50)
    taken = [replay.take(stamped(*one)) for one in ((10, "a", 30), (12, "a", 30), (12, "a", 31), (12, "b", 30))]
    assert taken == ["in order", "repeated", "in order", "in order"]
    assert replay.latest == ((10, "a"), (12, "a"), (12, "b"))
    assert [replay.take(stamped(*one)) for one in ((70, "a", 70), (30, "a", 30))] == ["in order", "repeated"]


def test_what_is_older_than_the_start_is_too_late() -> None:
    """A filter that is taken up again at an instant cannot go back behind it."""
    replay = Replay[Trail]((), 70, trail, 50)
    assert [replay.take(stamped(time)) for time in (69, 70, 71)] == ["too old", "in order", "in order"]


def test_without_a_window_only_later_ones_count() -> None:
    """And those of the same instant."""
    replay = Replay[Trail]((), 0, trail, 0)
    keys = [(5, "b"), (5, "a"), (4, "c"), (6, "a")]
    assert [replay.take(stamped(*key)) for key in keys] == ["in order", "replayed", "too old", "in order"]
    assert replay.latest == ((5, "a"), (5, "b"), (6, "a"))
    with pytest.raises(BadInput, match="it must be at least 0"):
        Replay[Trail]((), 0, trail, -1)
