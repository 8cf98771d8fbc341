"""A directed link: airtime, queue, and the sender's state machine."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.transport.latency_settings import Constant, Normal, Uniform
from volery.transport.links import (
    COLLISION,
    CUT,
    DELIVERED,
    HALF_DUPLEX,
    LOST,
    SHORTEST_TRAVEL_NS,
    LinkSettings,
    Queue,
    fate,
)
from volery.transport.loss_settings import Bernoulli, GilbertElliott
from volery.transport.media_settings import HalfDuplex, Tdma

MS = 1_000_000
Policy = Literal["drop-tail", "drop-head", "latest"]


@given(
    payload=st.integers(0, 10**6),
    overhead=st.integers(0, 100),
    bits=st.integers(1, 12),
    rate=st.floats(1e-3, 1e10) | st.sampled_from([115_200.0, 1e6, 250_000.5, 1 / 3]),
)
def test_airtime_is_exact_and_rounded_up(payload: int, overhead: int, bits: int, rate: float) -> None:
    """The least whole number of nanoseconds in which all bits have left, in exact arithmetic."""
    airtime = LinkSettings(rate=rate, overhead=overhead, bits_per_byte=bits).airtime_ns(payload)
    assert isinstance(airtime, int)
    assert airtime == math.ceil(Fraction((payload + overhead) * bits * 10**9) / Fraction(rate))


def test_airtime_of_the_infrared_link() -> None:
    """46 + 4 bytes of 10 bits at 115.2 kbit/s take 500/115200 s; without a rate nothing takes time."""
    assert LinkSettings(rate=115_200.0, overhead=4, bits_per_byte=10).airtime_ns(46) == 4_340_278
    assert LinkSettings(overhead=4).airtime_ns(46) == 0


@pytest.mark.parametrize(
    ("latency", "minimum"), [(Constant(3), 3), (Uniform(2, 9), 2), (Normal(100, 20), 40), (Constant(0), 0)]
)
def test_lookahead_is_shortest_airtime_and_latency(latency: Constant | Uniform | Normal, minimum: int) -> None:
    """What an empty payload takes on the air, and the model's minimum."""
    settings = LinkSettings(rate=1e9, overhead=4, latency=latency)
    assert settings.lookahead_ns() == 32 + minimum


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"rate": 0.0}, "rate is 0 bit/s"), ({"mtu": 0}, "mtu at least 1 B"), ({"overhead": -1}, "overhead is at least")],
)
def test_impossible_settings_are_refused(changes: dict[str, float], message: str) -> None:
    """The message gives the bound."""
    with pytest.raises(BadInput, match=message):
        LinkSettings(**changes)  # type: ignore[arg-type]
    with pytest.raises(BadInput, match="queue limit is 0"):
        Queue(0)


@pytest.mark.parametrize(
    ("policy", "streams", "dropped", "kept"),
    [
        ("drop-tail", "aaaa", [[], [], [2], [3]], [0, 1]),
        ("drop-head", "aaaa", [[], [], [0], [1]], [2, 3]),
        ("latest", "aaaa", [[], [0], [1], [2]], [3]),
        ("latest", "abab", [[], [], [0], [1]], [2, 3]),
        ("latest", "abca", [[], [], [2], [0]], [3, 1]),
    ],
)
def test_a_full_queue_drops_by_its_policy(
    sending_end: Any, policy: Policy, streams: str, dropped: list[list[int]], kept: list[int]
) -> None:
    """Two frames fit: the newcomer goes, or the oldest, or the one of the same stream that is out of date."""
    link = sending_end(LinkSettings(queue=Queue(2, policy)))
    assert [link.offer(0, name.encode(), name) for name in streams] == dropped
    assert link.waiting() == kept
    assert [link.transmit(0).sequence for _ in kept] == kept
    assert link.next_start(0) is None


@given(
    policy=st.sampled_from(["drop-tail", "drop-head", "latest"]),
    limit=st.integers(1, 4),
    steps=st.lists(st.sampled_from(["offer", "other", "refuse", "transmit"]), max_size=40),
)
def test_every_sequence_number_has_one_story(sending_end: Any, policy: Policy, limit: int, steps: list[str]) -> None:
    """Refused, dropped, sent or waiting: each number exactly once; and never do more wait than fit."""
    link = sending_end(LinkSettings(queue=Queue(limit, policy)))
    told = []
    for now, step in enumerate(steps):
        if step == "refuse":
            told.append(link.refuse())
        elif step != "transmit":
            told += link.offer(0, b"x", step)
        elif link.waiting():
            told.append(link.transmit(now).sequence)
        assert len(link.waiting()) <= limit
    assert sorted([*told, *link.waiting()]) == list(range(link.sequence))


def test_a_transmission_has_its_times(sending_end: Any) -> None:
    """On the air from its start for its airtime, due a latency later; the next may start when it has left."""
    link = sending_end(LinkSettings(rate=8000.0, latency=Constant(5 * MS)))
    for payload in (b"four", b"again"):
        link.offer(0, payload)
    first = link.transmit(10 * MS)
    assert (first.start_ns, first.airtime_ns, first.due_ns) == (10 * MS, 4 * MS, 19 * MS)
    assert (first.sequence, first.payload, first.verdict) == (0, b"four", DELIVERED)
    assert link.next_start(11 * MS) == 14 * MS
    assert link.next_start(15 * MS) == 15 * MS


def test_no_frame_is_due_when_it_starts(sending_end: Any) -> None:
    """Without airtime and latency it still takes a nanosecond, so that what it causes comes later."""
    link = sending_end(LinkSettings())
    link.offer(0, b"x")
    assert link.transmit(5).due_ns == 5 + SHORTEST_TRAVEL_NS == 6


@given(now=st.integers(0, 10**9), ready=st.integers(0, 10**9), payload=st.integers(0, 40))
def test_no_frame_starts_before_the_earliest_next(sending_end: Any, now: int, ready: int, payload: int) -> None:
    """Whatever is offered at `ready` or later starts no earlier than was said, also after a transmission."""
    medium = HalfDuplex(access=Tdma(100.0, 100_000))
    link = sending_end(LinkSettings(medium=medium, rate=115_200.0))
    link.offer(0, b"x" * 20)
    start = link.next_start(now)
    assert start is not None
    link.transmit(start)
    earliest = link.earliest_next(ready)
    link.offer(0, b"x" * payload)
    later = link.next_start(ready)
    assert later is not None
    assert later >= earliest >= max(ready, start)


def test_slots_go_by_natural_order(sending_end: Any) -> None:
    """The end with the lower name has the first slot, and "2" is lower than "10"."""
    settings = LinkSettings(medium=HalfDuplex(access=Tdma(100.0)))
    starts = {}
    for source, target in (("2", "10"), ("10", "2")):
        link = sending_end(settings, source, target)
        link.offer(0, b"x")
        starts[source] = link.next_start(0)
    assert starts == {"2": 0, "10": 5 * MS}


def test_models_that_stay_keep_their_state(sending_end: Any) -> None:
    """Changing the rate leaves loss and latency as they would have been; a cut draws all the same."""
    model = LinkSettings(loss=(GilbertElliott(0.2, 0.3),), latency=Uniform(0, 9 * MS))
    touched, untouched = sending_end(model), sending_end(model)
    stories = []
    for now in range(200):
        if now % 10 == 0:
            touched.change(replace(model, rate=1e9, cut=now % 20 == 0))
        pair = []
        for link in (touched, untouched):
            link.offer(0, b"x")
            pair.append(link.transmit(now * MS))
        stories.append(pair)
    for now, (one, other) in enumerate(stories):
        assert one.verdict == (CUT if now % 20 < 10 else other.verdict)
        assert one.due_ns - one.airtime_ns == max(other.due_ns, one.start_ns + 1 - one.airtime_ns)


def test_another_model_begins_anew(sending_end: Any) -> None:
    """A model that a fault brings decides from then on, with the draws of the frames' own numbers."""
    link = sending_end(LinkSettings())
    link.change(LinkSettings(loss=(Bernoulli(1.0),)))
    link.offer(0, b"x")
    assert link.transmit(0).verdict == LOST


def test_a_restarted_agent_draws_from_its_own_streams(sending_end: Any) -> None:
    """Another incarnation has other losses."""
    verdicts = []
    for incarnation in (0, 1):
        link = sending_end(LinkSettings(loss=(Bernoulli(0.5),)), incarnation=incarnation)
        for _ in range(60):
            link.offer(0, b"x")
        verdicts.append([link.transmit(now).verdict for now in range(60)])
    assert verdicts[0] != verdicts[1]


@pytest.mark.parametrize(
    ("verdict", "deaf", "expected"),
    [
        (CUT, True, CUT),
        (CUT, False, CUT),
        (LOST, True, HALF_DUPLEX),
        (LOST, False, LOST),
        (DELIVERED, True, HALF_DUPLEX),
        (DELIVERED, False, DELIVERED),
    ],
)
def test_the_first_cause_counts(verdict: str, deaf: bool, expected: str) -> None:
    """Cut before half-duplex before collision before loss."""
    assert fate(verdict, deaf=deaf) == expected
    assert fate(verdict, deaf=deaf, collided=True) == (COLLISION if expected not in (CUT, HALF_DUPLEX) else expected)


def test_a_frame_sent_ahead_takes_up_room_until_its_start(sending_end: Any) -> None:
    """With room for one frame, a second one is refused until the first has started, and taken after that instant."""
    settings = LinkSettings(rate=8000.0, queue=Queue(limit=1))
    link = sending_end(settings)
    assert link.offer(0, b"x") == []
    link.transmit(0)
    assert link.offer(0, b"y") == []
    start = link.next_start(0)
    assert start == MS
    link.transmit(start, ahead=True)
    assert link.offer(start, b"z") == [2]
    assert link.offer(start + 1, b"z") == []
