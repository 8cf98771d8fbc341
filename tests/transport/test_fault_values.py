"""Faults as data."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.transport.faults import Kill, LinkFault, Pause, effective
from volery.transport.latency_settings import Constant, Normal, Uniform
from volery.transport.links import LinkSettings, Queue
from volery.transport.loss_settings import Bernoulli, GilbertElliott
from volery.transport.media_settings import Aloha, FullDuplex, HalfDuplex, Tdma

LINK = ("1", "2")
BASE = LinkSettings(rate=1e6)

share = st.floats(0.01, 1)
changes = st.fixed_dictionaries(
    {},
    optional={
        "rate": st.none() | st.floats(1, 1e9),
        "cut": st.booleans(),
        "loss": st.lists(st.builds(Bernoulli, share) | st.builds(GilbertElliott, share, share, share), max_size=2).map(
            tuple
        ),
        "latency": st.builds(Constant, st.integers(0, 10**9))
        | st.builds(Normal, st.integers(10, 20), st.integers(0, 5), st.none() | st.integers(0, 9))
        | st.builds(Uniform, st.integers(0, 9), st.integers(9, 20)),
        "queue": st.builds(Queue, st.integers(1, 9), st.sampled_from(["drop-tail", "drop-head", "latest"])),
        "medium": st.just(FullDuplex())
        | st.builds(HalfDuplex, access=st.just(Aloha()) | st.builds(Tdma, st.floats(1, 1000), st.integers(0, 9))),
        "mtu": st.integers(1, 9000),
    },
)
ends = st.none() | st.integers(6, 12)
starts = st.integers(0, 5)
names = st.text("abc0123456789", min_size=1, max_size=3)
links = st.lists(st.sampled_from([LINK, ("2", "1"), ("2", "3")]), max_size=3, unique=True).map(tuple)
link_faults = st.builds(LinkFault, names, starts, ends, links, changes)
faults = link_faults | st.builds(Kill, names, starts, ends, names) | st.builds(Pause, names, starts, ends, names)


@given(st.lists(link_faults, max_size=5, unique_by=lambda fault: fault.id), st.integers(0, 13))
def test_settings_are_layered_by_start(given_faults: list[LinkFault], now: int) -> None:
    """Field by field the fault in force that started last decides, of those that started together the later name."""
    expected = BASE
    for fault in sorted(given_faults, key=lambda fault: (fault.at_ns, fault.id)):
        over = fault.until_ns is not None and now >= fault.until_ns
        if LINK in fault.links and now >= fault.at_ns and not over:
            expected = replace(expected, **fault.changes)
    assert effective(BASE, LINK, given_faults, now) == effective(BASE, LINK, given_faults[::-1], now) == expected


@pytest.mark.parametrize(("now", "cut"), [(0, False), (9, False), (10, True), (19, True), (20, False)])
def test_intervals_are_half_open(now: int, cut: bool) -> None:
    """A fault holds at its start and no more at its end."""
    fault = LinkFault("t1", 10, 20, (LINK,), {"cut": True})
    assert effective(BASE, LINK, [fault], now).cut is cut
    assert Pause("t2", 10, 20, "1").in_force(now) is cut


def test_what_ends_uncovers_what_was_below() -> None:
    """When the fault on top is over, the one below it holds again, and at last the link's own settings."""
    below = LinkFault("b", 0, 30, (LINK,), {"rate": 1.0, "mtu": 9})
    above = LinkFault("a", 10, 20, (LINK,), {"rate": 2.0})
    seen = [effective(BASE, LINK, [above, below], now) for now in (5, 15, 25, 35)]
    assert [(settings.rate, settings.mtu) for settings in seen] == [(1.0, 9), (2.0, 9), (1.0, 9), (1e6, 1500)]
    assert effective(BASE, ("2", "1"), [above, below], 15) is BASE
