"""What a transmitter does beyond a plain queue: token buckets, radios, slots by its clock; and the way to a target."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.transport.clock import Clock
from volery.transport.directed_link import DirectedLink
from volery.transport.faults import ClockFault
from volery.transport.latency_settings import Constant, Uniform
from volery.transport.links import CORRUPT, CUT, DELIVERED, LOST, Bucket, LinkSettings, Queue
from volery.transport.loss_settings import Bernoulli
from volery.transport.media import Ether, earliest_start
from volery.transport.media_settings import HalfDuplex, SlottedAloha, Tdma
from volery.transport.propagation import Propagation
from volery.transport.transmitter import Transmitter

MS = 1_000_000
FRAMES = 100_000


def way(settings: LinkSettings, target: str = "2") -> Propagation:
    """The way from 1 to a target."""
    return Propagation(target, DirectedLink.of(7, "1", target), settings)


def test_rate_is_what_was_asked_for() -> None:
    """From 10 kbit/s to 10 Mbit/s a saturated link carries its rate, within 0.5 % and rounding."""
    for rate in (1e4, 115_200.0, 1e6, 1e7):
        link = Transmitter([way(LinkSettings(rate=rate, overhead=4, bits_per_byte=10, queue=Queue(200)))])
        for _ in range(200):
            link.offer(0, ("2",), b"x" * 46)
        now = 0
        for _ in range(200):
            start = link.next_start(now)
            assert start is not None
            now = start + link.transmit(start).airtime_ns
        assert 200 * 500 / (now / 1e9) == pytest.approx(rate, rel=0.005)


def test_the_earliest_next_start_follows_what_has_changed_since_it_was_asked_for() -> None:
    """A frame that was transmitted, new settings and another clock each count at once."""
    settings = LinkSettings(medium=HalfDuplex(access=Tdma(100.0)), rate=1e6)
    link = Transmitter([way(settings)])
    assert link.earliest_next(0) == 0
    link.offer(0, ("2",), b"x" * 125)
    link.transmit(0)
    assert link.earliest_next(0) == MS
    link.change("2", replace(settings, medium=HalfDuplex(access=SlottedAloha(2 * MS))))
    assert link.earliest_next(0) == 2 * MS
    link.set_clock(Clock([ClockFault("c", 0, None, "1", MS // 2, 0)]))
    assert link.earliest_next(0) == 2 * MS - MS // 2


@given(st.lists(st.tuples(st.integers(0, 30 * MS), st.integers(1, 90)), min_size=1, max_size=40))
def test_a_bucket_never_lets_more_than_burst_and_rate_through(offers: list[tuple[int, int]]) -> None:
    """In any window no more bits start than a full bucket and what flows in meanwhile."""
    bucket = Bucket(rate=8000.0, burst=100)
    link = Transmitter([way(LinkSettings(bucket=bucket, queue=Queue(100)))])
    now, starts = 0, []
    for wait, size in offers:
        now += wait
        link.offer(now, ("2",), b"x" * size)
        start = link.next_start(now)
        assert start is not None
        link.transmit(start)
        starts.append((start, 8 * size))
        now = start
    for first, (begun, _) in enumerate(starts):
        bits = 0
        for start, length in starts[first:]:
            bits += length
            assert bits <= 800 + 8000.0 * (start - begun) / 1e9 + 1e-3


def test_a_full_bucket_lets_a_burst_through_and_then_its_rate() -> None:
    """100 bytes at once, then a byte per millisecond."""
    link = Transmitter([way(LinkSettings(bucket=Bucket(rate=8000.0, burst=100)))])
    starts = []
    for _ in range(4):
        link.offer(0, ("2",), b"x" * 50)
        start = link.next_start(0)
        assert start is not None
        link.transmit(start)
        starts.append(start)
    assert starts == [0, 0, 50 * MS, 100 * MS]


def test_duplicates_come_as_often_as_asked_and_with_a_latency_of_their_own() -> None:
    """The fraction is within 3 standard errors; a copy has the number of its frame and mostly another due time."""
    link = way(LinkSettings(duplication=0.2, latency=Uniform(0, 9 * MS)))
    arrivals = [link.send(link.count(), 0, 0, 8) for _ in range(FRAMES // 10)]
    twice = [copies for copies in arrivals if len(copies) == 2]
    assert abs(len(twice) / len(arrivals) - 0.2) < 3 * (0.2 * 0.8 / len(arrivals)) ** 0.5
    assert all((first.sequence, first.copy, second.copy) == (second.sequence, 0, 1) for first, second in twice)
    assert sum(first.due_ns == second.due_ns for first, second in twice) < 5


def test_each_copy_is_damaged_on_its_own() -> None:
    """One of two copies, both or none, each with the same probability; a frame that is lost or cut has none.

    Fractions are within 4 standard errors.
    """
    link, count = way(LinkSettings(corruption=(Bernoulli(0.3),), duplication=1.0)), FRAMES // 10
    pairs = Counter(tuple(copy.verdict for copy in link.send(link.count(), 0, 0, 8)) for _ in range(count))
    for first, one in ((CORRUPT, 0.3), (DELIVERED, 0.7)):
        for second, other in ((CORRUPT, 0.3), (DELIVERED, 0.7)):
            share = one * other
            assert abs(pairs[first, second] / count - share) < 4 * (share * (1 - share) / count) ** 0.5
    for settings in (LinkSettings(loss=(Bernoulli(1.0),), duplication=1.0), LinkSettings(cut=True, duplication=1.0)):
        link.change(settings)
        assert len(link.send(link.count(), 0, 0, 8)) == 1


def test_causes_count_in_their_order() -> None:
    """Cut before loss before corruption; each model draws whatever the others say."""
    settings = LinkSettings(loss=(Bernoulli(0.3),), corruption=(Bernoulli(0.5),))
    link = way(settings)
    verdicts = Counter(link.send(link.count(), 0, 0, 8)[0].verdict for _ in range(FRAMES // 10))
    for verdict, share in ((LOST, 0.3), (CORRUPT, 0.35), (DELIVERED, 0.35)):
        error = (share * (1 - share) / (FRAMES // 10)) ** 0.5
        assert abs(verdicts[verdict] / (FRAMES // 10) - share) < 3 * error
    link.change(LinkSettings(loss=(Bernoulli(1.0),), corruption=(Bernoulli(1.0),), cut=True))
    assert link.send(link.count(), 0, 0, 8)[0].verdict == CUT
    link.change(LinkSettings(present=False))
    assert link.send(link.count(), 0, 0, 8)[0].verdict == CUT


def test_frames_stay_in_order_where_reordering_is_off() -> None:
    """With it latencies that fall let later frames overtake; without it nobody is due before an earlier one."""
    for reordering in (True, False):
        link = way(LinkSettings(latency=Uniform(0, 9 * MS), reordering=reordering))
        due = [link.send(link.count(), now * MS, now * MS, 8)[0].due_ns for now in range(200)]
        assert (due == sorted(due)) is not reordering


def test_one_transmission_of_a_radio_has_an_arrival_at_each_target() -> None:
    """All its links count the frame; a frame for one of them is counted by that one only."""
    settings = LinkSettings(medium=HalfDuplex("node"), rate=8000.0, latency=Constant(MS))
    ways = [way(settings, target) for target in ("2", "3", "4")]
    radio = Transmitter(ways)
    radio.offer(0, ("2", "3", "4"), b"all")
    radio.offer(0, ("3",), b"one")
    everybody, one = radio.transmit(0), radio.transmit(3 * MS)
    assert [(copy.target, copy.sequence, copy.due_ns) for copy in everybody.copies] == [
        ("2", 0, 4 * MS),
        ("3", 0, 4 * MS),
        ("4", 0, 4 * MS),
    ]
    assert [(copy.target, copy.sequence) for copy in one.copies] == [("3", 1)]
    assert [link.next_sequence for link in ways] == [1, 2, 1]
    assert radio.transceiver.deaf(0, 1)
    assert not radio.transceiver.deaf(6 * MS, 7 * MS)


@given(ready=st.integers(0, 10**10), slot=st.integers(1, 10**7))
def test_slotted_aloha_begins_with_a_slot(ready: int, slot: int) -> None:
    """The first multiple of the slot's length from then on; a frame that is longer than a slot is refused."""
    start = earliest_start(SlottedAloha(slot), ready, slot, 0, 1)
    assert start % slot == 0
    assert 0 <= start - ready < slot
    with pytest.raises(BadInput, match="does not fit a slot"):
        earliest_start(SlottedAloha(slot), ready, slot + 1, 0, 1)


@given(offset=st.integers(-5 * MS, 5 * MS), ready=st.integers(10 * MS, 10**9))
def test_slots_follow_the_clock_of_the_sender(offset: int, ready: int) -> None:
    """A clock that is ahead sends so much earlier than true time has it."""
    link = Transmitter([way(LinkSettings(medium=HalfDuplex(access=Tdma(100.0)), rate=1e6))], slot=1)
    clock = Clock([ClockFault("c", 0, None, "1", offset)])
    link.set_clock(clock)
    start = link.earliest_next(ready)
    assert (start + offset) % (10 * MS) >= 5 * MS
    assert clock.reading(start - 1) < clock.reading(ready) or (start - 1 + offset) % (10 * MS) < 5 * MS


@given(offset=st.integers(-(10**8), 10**8), drift=st.integers(-(10**8), 10**8), ready=st.integers(10**9, 2 * 10**9))
def test_a_slot_that_was_found_is_found_again(offset: int, drift: int, ready: int) -> None:
    """However fast or slow the clock: at the start that was found a frame may start."""
    link = Transmitter([way(LinkSettings(medium=HalfDuplex("node", SlottedAloha(4 * MS)), rate=1e6))])
    link.set_clock(Clock([ClockFault("c", 0, None, "1", offset, drift)]))
    start = link.earliest_next(ready)
    assert link.earliest_next(start) == start


@given(
    st.lists(st.tuples(st.integers(0, 100), st.integers(1, 20), st.sampled_from("abc")), min_size=1, max_size=20),
    st.tuples(st.integers(0, 110), st.integers(1, 20)),
)
def test_the_ether_knows_every_overlap(heard: list[tuple[int, int, str]], frame: tuple[int, int]) -> None:
    """A frame meets every transmission of somebody else that is on the air with it, and touching is not meeting."""
    ether = Ether()
    for start, length, source in heard:
        ether.hear(start, start + length, source)
    start, end = frame[0], frame[0] + frame[1]
    meets = [one for one in heard if one[2] != "a" and max(one[0], start) < min(one[0] + one[1], end)]
    assert ether.collided(start, end, "a") == bool(meets)


@given(
    st.lists(st.tuples(st.integers(0, 100), st.integers(1, 20), st.sampled_from("abc")), max_size=30),
    st.lists(st.tuples(st.integers(0, 40), st.integers(1, 20), st.sampled_from("abc")), max_size=10),
    st.integers(0, 120),
    st.tuples(st.integers(0, 60), st.integers(0, 20)),
)
def test_the_ether_forgets_what_no_frame_can_meet(
    heard: list[tuple[int, int, str]], later: list[tuple[int, int, str]], before: int, frame: tuple[int, int]
) -> None:
    """What ended before an instant is forgotten: a frame from then on meets the same, also of what comes later."""
    forgetful, full = Ether(), Ether()
    for ether in (forgetful, full):
        for start, length, source in heard:
            ether.hear(start, start + length, source)
    forgetful.forget(before)
    assert len(forgetful) == sum(start + length > before for start, length, _ in heard)
    for ether in (forgetful, full):
        for start, length, source in later:
            ether.hear(before + start, before + start + length, source)
    start, end = before + frame[0], before + sum(frame)
    assert forgetful.collided(start, end, "a") == full.collided(start, end, "a")
    assert forgetful.busy(start, end) == full.busy(start, end)
