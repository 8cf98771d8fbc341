"""NeighbourPromisess: how far an agent may go on what its neighbours have promised."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.transport.events import FOREVER_NS
from volery.transport.faults import LinkFault, effective
from volery.transport.frames import Frame, promise
from volery.transport.latency_settings import Constant
from volery.transport.links import SHORTEST_TRAVEL_NS, LinkSettings
from volery.transport.promises import FrameMissing, NeighbourPromises, earliest_due, lookahead_segments

LINK = ("1", "2")
BASE = LinkSettings(latency=Constant(7))

changes = st.fixed_dictionaries(
    {},
    optional={
        "latency": st.builds(Constant, st.sampled_from([0, 1, 7, 20])),
        "rate": st.just(1e9),
        "overhead": st.integers(0, 2),
    },
)
faults = st.lists(
    st.builds(
        LinkFault,
        st.text("abc", min_size=1),
        st.integers(0, 30),
        st.none() | st.integers(31, 60),
        st.sampled_from([(LINK,), (("2", "1"),), (("2", "1"), LINK)]),
        changes,
    ),
    max_size=4,
    unique_by=lambda fault: fault.id,
)


def sent(number: int, promise_ns: int) -> Frame:
    """The frame with this number, and what it promises."""
    return Frame(0, number, 0, 0, 5, "delivered", b"", number + 1, promise_ns)


@given(faults, st.integers(0, 70))
def test_the_earliest_due_is_the_least_over_all_starts(given_faults: list[LinkFault], promised: int) -> None:
    """Brute force: the least start plus lookahead at that start, over every start from the promise on."""
    starts = range(promised, promised + 100)
    lookaheads = (effective(BASE, LINK, given_faults, start).lookahead_ns() for start in starts)
    expected = min(start + max(SHORTEST_TRAVEL_NS, ahead) for start, ahead in zip(starts, lookaheads, strict=True))
    assert earliest_due(promised, lookahead_segments(BASE, LINK, given_faults)) == expected


def test_an_agent_may_go_as_far_as_the_least_promise() -> None:
    """Every neighbour holds it back; promises only grow; a neighbour that is done holds back nobody."""
    segments = {"1": lookahead_segments(BASE, LINK, []), "3": ((0, 2 * FOREVER_NS, 100),)}
    promises = NeighbourPromises("2", segments)
    assert promises.safe_ns() == 7
    promises.heard("1", promise(0, 1000, 0))
    assert promises.safe_ns() == 100
    promises.heard("3", promise(0, 500, 0))
    promises.heard("3", promise(0, 400, 0))
    assert promises.safe_ns() == 600
    promises.heard("3", promise(0, FOREVER_NS, 0))
    assert promises.safe_ns() == 1007


def test_who_blocks_must_be_heard() -> None:
    """Those, and only those, on whose promises it rests whether an instant is safe."""
    promises = NeighbourPromises("2", dict.fromkeys("134", ((0, 2 * FOREVER_NS, 100),)))
    assert promises.blocking(100) == {"1", "3", "4"}
    promises.heard("1", promise(0, 50, 0))
    promises.heard("3", promise(0, 20, 0))
    promises.heard("4", promise(0, 20, 0))
    assert (promises.blocking(119), promises.blocking(120), promises.blocking(150)) == (set(), {"3", "4"}, {*"134"})
    assert promises.blocking(120, {"1", "3"}) == {"3"}
    promises.heard("3", promise(0, 30, 0))
    assert (promises.blocking(120), promises.safe_ns()) == ({"4"}, 120)
    assert NeighbourPromises("1", {}).blocking(FOREVER_NS) == set()


def test_who_has_handled_what() -> None:
    """Credit is what the slowest living neighbour says to have handled; frames say so too, the dead say nothing."""
    promises = NeighbourPromises("2", dict.fromkeys("134", ((0, 2 * FOREVER_NS, 100),)), start_ns=10)
    assert (promises.credit_ns(), promises.behind(11)) == (10, {"1", "3", "4"})
    promises.heard("1", promise(0, 50, 0, 40))
    promises.heard("3", sent(0, 70)._replace(start_ns=60))
    assert (promises.credit_ns(), promises.behind(60)) == (10, {"1", "4"})
    promises.down("4")
    assert (promises.credit_ns(), promises.behind(60)) == (40, {"1"})


def test_without_neighbours_there_is_no_limit() -> None:
    """An agent that hears nobody may go on for ever."""
    assert NeighbourPromises("1", {}).safe_ns() == FOREVER_NS


def test_a_live_fault_moves_the_horizon() -> None:
    """A shorter latency from an instant on shortens what a promise is worth from there on."""
    promises = NeighbourPromises("2", {"1": lookahead_segments(BASE, LINK, [])})
    promises.heard("1", promise(0, 100, 0))
    assert promises.safe_ns() == 107
    promises.relink(
        "1", lookahead_segments(BASE, LINK, [LinkFault("l1", 103, None, (LINK,), {"latency": Constant(1)})])
    )
    assert promises.safe_ns() == 104


@pytest.mark.parametrize("gap", [sent(1, 9), sent(2, 9), promise(0, 9, 2)])
def test_a_gap_is_noticed(gap: Frame) -> None:
    """One frame came, then a frame or a promise that says that two or more were sent before or with it."""
    promises = NeighbourPromises("2", {"1": lookahead_segments(BASE, LINK, [])})
    if gap.sequence != 1:
        promises.heard("1", sent(0, 3))
    with pytest.raises(FrameMissing, match=rf"link 1>2: {gap.sent} frames were sent, {gap.sent - 1} have come"):
        promises.heard("1", gap)
