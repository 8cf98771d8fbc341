"""Faults as they are written: names of links, times, live faults, link settings."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.experiments.link_schema import LinkFields, link_changes
from volery.experiments.timeline import parse_fault, parse_links
from volery.experiments.writing import spelled
from volery.transport.faults import Kill, LinkFault, Pause, from_plain, to_plain
from volery.transport.latencies import Constant, Gamma, LatencyTrace, LogNormal, Normal, Pareto, Uniform
from volery.transport.links import Queue
from volery.transport.losses import (
    Bernoulli,
    BitError,
    Distance,
    Frames,
    GilbertElliott,
    GilbertElliottTime,
    LossTrace,
    Markov,
)
from volery.transport.media import Aloha, FullDuplex, HalfDuplex, Tdma

EDGES = [("1", "2"), ("2", "3"), ("2", "10")]
SECOND = 1_000_000_000

_times = st.integers(0, 10**13)
_probabilities = st.floats(0, 1)
_leaving = st.floats(0.001, 1)
_sojourns = st.integers(100_000, 10**13)
_levels = st.floats(-200, 200)
_spreads = st.floats(0.1, 50)
_correlations = st.floats(-0.99, 0.99)
_numbers = st.integers(0, 10**6)
_instants = st.lists(st.integers(1, 10**13), max_size=4, unique=True).map(lambda times: (0, *sorted(times)))


def _traces(kind: Any, values: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Traces with as many values as times, some of which repeat."""
    return _instants.flatmap(
        lambda times: st.builds(
            kind,
            st.just(times),
            st.tuples(*[values] * len(times)),
            st.none() | st.integers(times[-1] + 1, 10**14),
        )
    )


_losses = st.one_of(
    st.builds(Bernoulli, _probabilities, st.floats(0, 0.99)),
    st.builds(GilbertElliott, _leaving, _leaving, _probabilities, _probabilities),
    st.builds(GilbertElliottTime, _sojourns, _sojourns, _probabilities, _probabilities),
    st.builds(Markov, _sojourns, _sojourns),
    st.builds(BitError, _probabilities),
    st.builds(Distance, _spreads, _levels, _levels, _levels, _spreads, _spreads, _spreads, st.none() | _sojourns),
    _traces(LossTrace, _probabilities),
    st.builds(
        Frames,
        st.lists(
            _numbers | st.builds(lambda first, more: (first, first + more), _numbers, _numbers), min_size=1, max_size=4
        ).map(tuple),
    ),
)
_latencies = st.one_of(
    st.builds(Constant, _times),
    st.builds(lambda low, span, correlation: Uniform(low, low + span, correlation), _times, _sojourns, _correlations),
    st.builds(
        lambda kind, floor, above, sd, correlation: kind(floor + above, sd, floor, correlation),
        st.sampled_from([Normal, Gamma, LogNormal]),
        _times,
        _sojourns,
        _sojourns,
        _correlations,
    ),
    st.builds(Normal, _times, _times),
    st.builds(Pareto, _sojourns, st.floats(1.01, 100), _correlations),
    _traces(LatencyTrace, _times),
)
_media = st.one_of(
    st.just(FullDuplex()),
    st.just(HalfDuplex("edge", Aloha())),
    st.builds(lambda cycle, guard: HalfDuplex("edge", Tdma(cycle, guard)), st.floats(1e-3, 1e6), _times),
)
_changes = st.fixed_dictionaries(
    {},
    optional={
        "cut": st.booleans(),
        "medium": _media,
        "rate": st.none() | st.floats(1e-3, 1e12),
        "overhead": st.integers(0, 10**6),
        "bits_per_byte": st.integers(1, 16),
        "mtu": st.integers(1, 10**6),
        "queue": st.builds(Queue, st.integers(1, 99), st.sampled_from(["drop-tail", "drop-head", "latest"])),
        "loss": st.lists(_losses, max_size=3).map(tuple),
        "corruption": st.lists(_losses, max_size=3).map(tuple),
        "latency": _latencies,
    },
).filter(bool)


@given(_changes)
def test_what_is_written_of_a_link_reads_back_equal(changes: dict[str, Any]) -> None:
    """Through text and back every setting is equal, to the last bit of every model's parameters; as a fault too."""
    assert link_changes(json.loads(json.dumps(spelled(changes, LinkFields)))) == changes
    assert from_plain(json.loads(json.dumps(to_plain(changes)))) == changes


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("1-2", [("1", "2"), ("2", "1")]),
        ("2>1", [("2", "1")]),
        ("10", [("2", "10"), ("10", "2")]),
        ("1>2, 3>2", [("1", "2"), ("3", "2")]),
        (["1-2", "1>2"], [("1", "2"), ("2", "1")]),
        ("all", [("1", "2"), ("2", "1"), ("2", "3"), ("2", "10"), ("3", "2"), ("10", "2")]),
    ],
)
def test_links_are_named(words: str | list[str], named: list[tuple[str, str]]) -> None:
    """An edge is both directions, an agent all its links; natural order, each once."""
    assert parse_links(words, EDGES) == tuple(named)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("1-3", "1-3: 1 and 3 have no link; neighbours of 1: 2"),
        ("2>7", "2>7: there is no agent '7'; agents: 1, 2, 3, 10"),
        ("7", "there is no agent '7'"),
        ("1-", "1-: there is no agent ''"),
        ("", "names no link"),
        ([], "names no link"),
    ],
)
def test_a_link_that_does_not_exist_is_refused(words: str | list[str], message: str) -> None:
    """The message says who is there instead."""
    with pytest.raises(BadInput) as caught:
        parse_links(words, EDGES)
    assert message in str(caught.value)


def test_live_faults_are_written_as_in_the_timeline() -> None:
    """`fault cut 2-3 --for 2s`, `fault set all loss=0.3`, `fault kill 3`, `fault pause 3`."""
    cut = parse_fault({"cut": "2-3", "for": "2s"}, "f1", SECOND, EDGES)
    assert cut == LinkFault("f1", SECOND, 3 * SECOND, (("2", "3"), ("3", "2")), {"cut": True})
    lossy = parse_fault({"set": {"loss": 0.3}, "where": "2>1"}, "f2", 0, EDGES)
    assert lossy == LinkFault("f2", 0, None, (("2", "1"),), {"loss": (Bernoulli(0.3),)})
    assert parse_fault({"kill": 3, "until": "4 s"}, "f3", SECOND, EDGES) == Kill("f3", SECOND, 4 * SECOND, "3")
    assert parse_fault({"pause": "3"}, "f4", SECOND, EDGES) == Pause("f4", SECOND, None, "3")


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ({"cut": "2-3", "fors": "2s"}, "fors: unknown field (did you mean 'for'?)"),
        ({"set": {"los": 0.3}, "where": "all"}, "set.los: unknown field (did you mean 'loss'?)"),
        ({"set": {"loss": -0.3}, "where": "all"}, "set.loss: loss probability is -0.3"),
        ({"cut": "2-3", "until": "1 s"}, "until: until is 1 s and at 1 s"),
        ({"kill": "2-3"}, "there is no agent '2-3'"),
        ({"kill": [2, 3]}, "kill: [2, 3] should be the name of one agent"),
        ({"cut": True}, "cut: True names no link"),
        ({"set": {"medium": "full-duplex"}, "where": "2>1"}, "an edge has one medium, 2>1 is half of one: write 2-1"),
    ],
)
def test_a_wrong_live_fault_is_refused(written: dict[str, Any], message: str) -> None:
    """The message names the field."""
    with pytest.raises(BadInput) as caught:
        parse_fault(written, "f1", SECOND, EDGES)
    assert message in str(caught.value)


def test_link_settings_are_read_alone() -> None:
    """What is written in words becomes the transport's values; nothing else is in the result."""
    assert link_changes({"latency": "2 ms", "rate": "9600 bit/s"}) == {"latency": Constant(2_000_000), "rate": 9600.0}
    with pytest.raises(BadInput, match="nothing to set"):
        link_changes({})
    with pytest.raises(BadInput, match=r"rate: rate is 0 bit/s, it must be above 0; queue.limit: should be a valid"):
        link_changes({"rate": "0 bit/s", "queue": {"limit": "many"}})
