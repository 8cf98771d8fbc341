"""Media: slots, and who is deaf when."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.transport.media import Transceiver, earliest_start
from volery.transport.media_settings import EDGE_SLOTS, Aloha, Tdma
from volery.units import period_ns

cycles = st.sampled_from([1.0, 7.3, 60.0, 100.0, 333.3, 1000.0])
US = 1000


def slots_of(access: Tdma, slot: int, around_ns: int) -> list[tuple[int, int]]:
    """The own slots [begin, end) from the cycle before an instant to two after it, cut into even parts exactly."""
    first = int(around_ns * access.cycle // 10**9)
    found = []
    for cycle in range(max(0, first - 1), first + 4):
        begin = period_ns(access.cycle, cycle)
        length = period_ns(access.cycle, cycle + 1) - begin
        found.append((begin + length * slot // EDGE_SLOTS, begin + length * (slot + 1) // EDGE_SLOTS))
    return found


@given(
    cycle=cycles,
    guard=st.integers(0, 100 * US),
    half=st.integers(0, 10**5),
    offset=st.integers(-3, 3) | st.integers(0, 10**9),
    tight=st.booleans(),
    share=st.floats(0, 1),
    slot=st.integers(0, EDGE_SLOTS - 1),
)
def test_tdma_starts_at_the_first_instant_that_fits(
    cycle: float, guard: int, half: int, offset: int, tight: bool, share: float, slot: int
) -> None:
    """Brute force over slots: the first start from `ready` on whose frame and guard lie inside the own slot.

    `ready` lies on a border of slots, next to one, or anywhere; or so that the frame just fits, or just does not.
    """
    access = Tdma(cycle, guard)
    assume(access.usable_ns(EDGE_SLOTS) >= 1)
    airtime = 1 + int(share * (access.usable_ns(EDGE_SLOTS) - 1))
    ready = max(0, period_ns(2 * cycle, half) + (offset % (guard + 3) - guard - airtime - 1 if tight else offset))
    starts = [
        max(ready, begin) for begin, end in slots_of(access, slot, ready) if max(ready, begin) + airtime + guard <= end
    ]
    assert earliest_start(access, ready, airtime, slot, EDGE_SLOTS) == min(starts)


@given(cycle=cycles, ready=st.integers(0, 10**11), first=st.floats(0, 1), second=st.floats(0, 1))
def test_tdma_ends_never_meet(cycle: float, ready: int, first: float, second: float) -> None:
    """Two ends that wait for their slots from the same instant on are never on the air together."""
    access = Tdma(cycle)
    usable = access.usable_ns(EDGE_SLOTS)
    airtimes = [1 + int(share * (usable - 1)) for share in (first, second)]
    spans = [
        (earliest_start(access, ready, airtime, slot, EDGE_SLOTS), airtime) for slot, airtime in enumerate(airtimes)
    ]
    (early, early_air), (late, _) = sorted(spans)
    assert early + early_air <= late


@given(cycle=cycles, ready=st.integers(0, 10**10), later=st.integers(0, 10**9), share=st.floats(0, 1))
def test_waiting_longer_never_starts_earlier(cycle: float, ready: int, later: int, share: float) -> None:
    """Promises rest on it: the start grows with the instant of readiness and with the airtime."""
    access = Tdma(cycle)
    longest = access.usable_ns(EDGE_SLOTS)
    start = earliest_start(access, ready, int(share * longest), 1, EDGE_SLOTS)
    assert start <= earliest_start(access, ready + later, int(share * longest), 1, EDGE_SLOTS)
    assert start <= earliest_start(access, ready, longest, 1, EDGE_SLOTS)


def test_what_fits_no_slot_is_refused() -> None:
    """The message names the airtime, the slot and the remedy."""
    access = Tdma(100.0, guard=200 * US)
    longest = access.usable_ns(EDGE_SLOTS)
    assert earliest_start(access, 0, longest, 0, EDGE_SLOTS) == 0
    with pytest.raises(BadInput, match=r"5\.000 ms airtime does not fit a tdma slot of 4\.800 ms: send less"):
        earliest_start(access, 0, 5_000 * US, 0, EDGE_SLOTS)


def test_aloha_waits_for_nobody() -> None:
    """It starts when it is ready."""
    assert earliest_start(Aloha(), 12, 5, 1, EDGE_SLOTS) == 12


@pytest.mark.parametrize(("cycle", "guard", "message"), [(0.0, 0, "cycle is 0 Hz"), (1.0, -1, "guard is -1 ns")])
def test_impossible_slots_are_refused(cycle: float, guard: int, message: str) -> None:
    """The message gives the value and the bound."""
    with pytest.raises(BadInput, match=message):
        Tdma(cycle, guard)


@given(
    gaps=st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), max_size=12),
    heard=st.tuples(st.integers(0, 60), st.integers(0, 8)),
)
def test_who_transmits_hears_nothing(gaps: list[tuple[int, int]], heard: tuple[int, int]) -> None:
    """Brute force over all own transmissions: deaf where one overlaps the frame; half-open ends do not touch."""
    transceiver, now = Transceiver(), 0
    own = []
    for gap, airtime in gaps:
        own.append((now + gap, now + gap + airtime))
        transceiver.transmit(*own[-1])
        now += gap + airtime
    start, end = heard[0], heard[0] + heard[1]
    assert transceiver.deaf(start, end) == any(begin < end and start < stop for begin, stop in own)


@given(
    gaps=st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5), st.integers(0, 20)), max_size=30),
    heard=st.tuples(st.integers(0, 60), st.integers(0, 8)),
)
def test_a_transceiver_forgets_what_no_frame_can_meet(gaps: list[tuple[int, int, int]], heard: tuple[int, int]) -> None:
    """What ended before an instant is forgotten: a frame from then on meets the same."""
    forgetful, full, now, before = Transceiver(), Transceiver(), 0, 0
    for gap, airtime, back in gaps:
        for transceiver in (forgetful, full):
            transceiver.transmit(now + gap, now + gap + airtime)
        now += gap + airtime
        before = max(before, now - back)
        forgetful.forget(before)
    start, end = before + heard[0], before + heard[0] + heard[1]
    assert forgetful.deaf(start, end) == full.deaf(start, end)
    forgetful.forget(now)
    assert (len(forgetful), len(full)) == (0, len(gaps))
