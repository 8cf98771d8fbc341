"""What a unit uses of what its neighbours told, and when."""

from __future__ import annotations

import numpy as np
import pytest

from volery.agents import payloads
from volery.agents.attitude.attitude_unit_settings import UnitMessage
from volery.agents.attitude.inbox import Inbox
from volery.agents.payloads import DamagedPayload
from volery.agents.sample_counts import COUNTS
from volery.estimators.attitude.dynamic_consensus import AttitudeMessage

ATTITUDE = AttitudeMessage(np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0, 0.0]))


def message(count: int) -> UnitMessage:
    """A message of a sample."""
    return UnitMessage(count % COUNTS, 2, ATTITUDE)


def taken(inbox: Inbox, count: int, *sources: str) -> dict[str, int]:
    """Neighbour → the sample of what is used of it."""
    return {source: message.count for source, message in inbox.take(count % COUNTS, sources or ("a", "b")).items()}


def counts(inbox: Inbox) -> tuple[int, int, int]:
    """Used, late, ahead."""
    return inbox.used, inbox.late, inbox.ahead


@pytest.mark.parametrize("start", [0, 10, COUNTS - 2])
def test_a_round_uses_what_was_told_after_the_sample_before(start: int) -> None:
    """Of every neighbour, once; also where counts start again."""
    inbox = Inbox(max_age=1)
    for k in range(start, start + 4):
        for source in ("a", "b"):
            inbox.put(source, message(k))
        assert taken(inbox, k + 1) == {"a": k % COUNTS, "b": k % COUNTS}
    assert taken(inbox, start + 5) == {}
    assert counts(inbox) == (8, 0, 0)


def test_what_is_early_waits_for_its_round() -> None:
    """A neighbour whose phase is earlier tells of sample 5 before the own round of it, which is about 4."""
    inbox = Inbox(max_age=1)
    inbox.put("a", message(4))
    inbox.put("a", message(5))
    assert taken(inbox, 5) == {"a": 4}
    assert taken(inbox, 6) == {"a": 5}
    inbox.put("a", message(7))
    assert taken(inbox, 7) == {}
    assert taken(inbox, 8) == {"a": 7}


def test_what_is_late_is_counted_and_not_used() -> None:
    """Unless `max_age` allows it, and then once only, and never after something newer."""
    strict, patient = Inbox(max_age=1), Inbox(max_age=3)
    for inbox in (strict, patient):
        inbox.put("a", message(4))
        assert taken(inbox, 5) == {"a": 4}
    for inbox in (strict, patient):
        inbox.put("a", message(5))
    assert taken(strict, 7) == {}
    assert counts(strict) == (1, 1, 0)
    assert taken(patient, 7) == {"a": 5}
    patient.put("a", message(4))
    patient.put("a", message(5))
    assert taken(patient, 7) == {}
    assert counts(patient) == (2, 0, 0)


def test_the_newest_of_several_counts() -> None:
    """Frames overtake each other; the older one is left."""
    inbox = Inbox(max_age=5)
    for k in (3, 2, 4):
        inbox.put("a", message(k))
    assert taken(inbox, 6) == {"a": 4}
    assert taken(inbox, 7) == {}


def test_a_second_copy_is_not_used_again() -> None:
    """Neither in the same round nor in a later one."""
    inbox = Inbox(max_age=3)
    inbox.put("a", message(4))
    inbox.put("a", message(4))
    assert taken(inbox, 5) == {"a": 4}
    inbox.put("a", message(4))
    assert taken(inbox, 6) == {}


def test_a_neighbour_whose_clock_is_ahead_is_heard_and_counted() -> None:
    """Its messages are used one after the other, and again once its clock is set right."""
    inbox = Inbox(max_age=2)
    for k in range(5, 8):
        inbox.put("a", message(k + 100))
        assert taken(inbox, k) == {"a": k + 100}
    assert counts(inbox) == (3, 0, 3)
    inbox.put("a", message(7))
    assert taken(inbox, 8) == {"a": 7}
    assert counts(inbox) == (4, 0, 3)


def test_what_was_told_of_the_sample_before_goes_before_what_is_ahead() -> None:
    """And so does what is older by a sample than that, whichever came first."""
    inbox = Inbox(max_age=2)
    for k in (7, 5):
        inbox.put("a", message(k))
    assert taken(inbox, 6) == {"a": 5}
    for k in (10, 7):
        inbox.put("b", message(k))
    assert taken(inbox, 9, "b") == {"b": 7}


def test_who_is_no_neighbour_any_more_is_not_used() -> None:
    """What it told before the graph changed is dropped."""
    inbox = Inbox(max_age=1)
    inbox.put("a", message(4))
    inbox.put("b", message(4))
    assert taken(inbox, 5, "b") == {"b": 4}


def test_messages_come_back_as_they_were_sent() -> None:
    """In full precision bit for bit; what is no message is refused."""
    there = UnitMessage.decode(message(COUNTS - 1).encode("float64"))
    assert (there.count, there.directions) == (COUNTS - 1, 2)
    np.testing.assert_array_equal(there.attitude.estimate, ATTITUDE.estimate)
    np.testing.assert_array_equal(there.attitude.average, ATTITUDE.average)
    for damaged in (b"\x01", payloads.encode([1, 2, np.zeros(7)]), payloads.encode([1, np.zeros(8)])):
        with pytest.raises(DamagedPayload, match="no attitude"):
            UnitMessage.decode(damaged)
