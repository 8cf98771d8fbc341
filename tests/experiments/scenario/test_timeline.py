"""Faults as they are written: names of links, times, live faults, link settings."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.agents.plan_codec import decode_value, encode_value
from volery.errors import BadInput
from volery.experiments.scenario.expansion import entry_of, parse_fault
from volery.experiments.scenario.explaining import read
from volery.experiments.scenario.fault_places import Places, parse_agents, parse_links
from volery.experiments.scenario.link_schema import LinkChanges, dumped_changes
from volery.transport.faults import ClockFault, Fault, Hog, Kill, LinkFault, Pause
from volery.transport.latency_settings import Constant, Gamma, LatencyTrace, LogNormal, Normal, Pareto, Uniform
from volery.transport.links import Queue
from volery.transport.loss_settings import (
    Bernoulli,
    BitError,
    Distance,
    Frames,
    GilbertElliott,
    GilbertElliottTime,
    LossTrace,
    Markov,
)
from volery.transport.media_settings import Aloha, FullDuplex, HalfDuplex, Tdma

PLACES = Places([("1", "2"), ("2", "3"), ("2", "10")], {"left": ("1", "2"), "right": ("3", "10")}, seed=7)
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
    assert read(LinkChanges, json.loads(json.dumps(dumped_changes(changes)))) == changes
    assert decode_value(json.loads(json.dumps(encode_value(changes)))) == changes


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("1-2", [("1", "2"), ("2", "1")]),
        ("2>1", [("2", "1")]),
        ("10", [("2", "10"), ("10", "2")]),
        ("1>2, 3>2", [("1", "2"), ("3", "2")]),
        (["1-2", "1>2"], [("1", "2"), ("2", "1")]),
        ("left", [("1", "2"), ("2", "1"), ("2", "3"), ("2", "10"), ("3", "2"), ("10", "2")]),
        ("left>right", [("2", "3"), ("2", "10")]),
        ("left-10", [("2", "10"), ("10", "2")]),
        ("all", [("1", "2"), ("2", "1"), ("2", "3"), ("2", "10"), ("3", "2"), ("10", "2")]),
    ],
)
def test_links_are_named(words: str | list[str], named: list[tuple[str, str]]) -> None:
    """An edge is both directions, an agent all its links; natural order, each once."""
    assert parse_links(words, PLACES) == tuple(named)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("1-3", "1-3: 1 and 3 have no link; neighbours of 1: 2"),
        ("2>7", "2>7: there is no agent '7'; agents: 1, 2, 3, 10"),
        ("7", "there is no agent '7'"),
        ("1-", "1-: there is no agent ''"),
        ("right-1", "right-1: right and 1 have no link; neighbours of right: 2"),
        ("", "nothing is named"),
        ([], "nothing is named"),
        ("random", "random is not given"),
        ("random 1.5", "random is 1.5, a fraction lies above 0 and is at most 1"),
        ("random many", "random is many"),
    ],
)
def test_a_link_that_does_not_exist_is_refused(words: str | list[str], message: str) -> None:
    """The message says who is there instead."""
    with pytest.raises(BadInput) as caught:
        parse_links(words, PLACES)
    assert message in str(caught.value)


def live(written: dict[str, Any], name: str = "f1", lasting_ns: int = 100 * SECOND) -> tuple[Fault, ...]:
    """The live faults that are meant, in a run that lasts so much longer."""
    return parse_fault(written, name, PLACES, lasting_ns)


def test_live_faults_are_written_as_in_the_timeline() -> None:
    """Each action gives its own fault, with the times counted from the command."""
    edge = (("2", "3"), ("3", "2"))
    assert live({"cut": "2-3", "for": "2s"}) == (LinkFault("f1", 0, 2 * SECOND, edge, {"cut": True}),)
    assert live({"hold": "2>3"}) == (LinkFault("f1", 0, None, (("2", "3"),), {"hold": True}),)
    assert live({"set": {"loss": 0.3}, "where": "2>1"}) == (
        LinkFault("f1", 0, None, (("2", "1"),), {"loss": (Bernoulli(0.3),)}),
    )
    assert live({"kill": 3, "for": "4 s"}) == (Kill("f1", 0, 4 * SECOND, "3"),)
    assert live({"kill": 3, "keep_state": True}) == (Kill("f1", 0, None, "3", keep_state=True),)
    assert live({"pause": "3"}) == (Pause("f1", 0, None, "3"),)
    assert live({"hog": 3}) == (Hog("f1", 0, None, "3", 1.0),)
    assert live({"hog": 3, "share": 0.25}) == (Hog("f1", 0, None, "3", 0.25),)
    assert live({"clock": 3, "offset": "-20 ms", "drift": "50 ppm"}) == (
        ClockFault("f1", 0, None, "3", -20_000_000, 50_000),
    )


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ({"cut": "2-3", "fors": "2s"}, "fors: unknown field (did you mean 'for'?)"),
        ({"set": {"los": 0.3}, "where": "all"}, "set.los: unknown field (did you mean 'loss'?)"),
        ({"set": {"loss": -0.3}, "where": "all"}, "set.loss: loss probability is -0.3"),
        ({"cut": "2-3", "until": "1 s"}, "until: write for: 2 s"),
        ({"cut": "2-3", "at": "1 s"}, "at: a live fault starts at once"),
        ({"kill": "2-3"}, "there is no agent '2-3'; agents: 1, 2, 3, 10; groups: left, right"),
        ({"kill": True}, "kill: True names nothing"),
        ({"cut": True}, "cut: True names nothing"),
        ({"set": {"medium": "full-duplex"}, "where": "2>1"}, "an edge has one medium, 2>1 is half of one: write 2-1"),
        ({"pause": 3, "share": 0.5}, "share belongs to hog and says nothing of a pause"),
        ({"hog": 3, "share": 1.5}, "share: share is 1.5, it must be above 0 and at most 1"),
        ({"hog": 3, "keep_state": True}, "keep_state belongs to kill"),
        ({"kill": 3, "keep_state": False}, "keep_state: is false, which says nothing: leave it out"),
        ({"clock": 3}, "a clock fault has an offset, a drift or both"),
        ({"clock": 3, "offset": "0 ms"}, "a clock fault has an offset, a drift or both"),
        ({"clock": 3, "drift": 50}, "drift: 50 has no unit: write it with one of ppb, ppm"),
        ({"clock": 3, "drift": "-1000000 ppm"}, "a clock does not stand still or go back"),
        ({"sensor": "3.distance"}, "a sensor fault is exactly one of failed, stuck, bias, noise, spikes, not none"),
        ({"sensor": "3.distance", "stuck": True, "bias": 1}, "not stuck and bias"),
        ({"sensor": "3.distance", "bias": "much"}, "bias: 'much' should be a number"),
        ({"sensor": "3.distance", "spikes": {"size": 1, "probability": 0}}, "probability is 0"),
        ({"sensor": "3.distance", "stuck": True}, "there is no world, so no agent has a sensor"),
        ({"cut": "1-2", "kill": 1}, "a fault is exactly one of cut, hold, partition, set, kill"),
        ({"cut": "1-2", "every": {"mtbf": "0 s", "mttr": "1 s"}}, "mtbf is 0 s, a mean time is above 0"),
        ({"cut": "1-2", "every": {"mtbf": "1 us", "mttr": "1 us"}}, "faults would come of this"),
    ],
)
def test_a_wrong_live_fault_is_refused(written: dict[str, Any], message: str) -> None:
    """The message names the field."""
    with pytest.raises(BadInput) as caught:
        live(written)
    assert message in str(caught.value)


def test_several_agents_are_several_faults_of_one_name() -> None:
    """Groups, lists and all; natural order, each agent once; one alone keeps the plain name."""
    assert [(fault.id, getattr(fault, "agent")) for fault in live({"pause": "right, 1"})] == [  # noqa: B009
        ("f1.1", "1"),
        ("f1.2", "3"),
        ("f1.3", "10"),
    ]
    assert [fault.id for fault in live({"clock": "all", "offset": "1 ms"})] == ["f1.1", "f1.2", "f1.3", "f1.4"]
    assert [fault.id for fault in live({"kill": [3, "3"]})] == ["f1"]
    assert {entry_of(fault.id) for fault in live({"kill": "left"}, "f12")} == {"f12"}


def test_a_random_fraction_is_drawn_from_the_seed_and_the_name_of_the_fault() -> None:
    """The same again and again, another for another fault; halves are rounded up, nothing at all is refused."""
    places = Places([(str(one), str(one + 1)) for one in range(1, 41)], seed=7)

    def drawn(word: str, fault_id: str = "t1") -> tuple[tuple[str, str], ...]:
        return parse_links(word, replace(places, fault_id=fault_id))

    half = drawn("random 0.5")
    assert len(half) == 40
    assert {link[::-1] for link in half} == set(half)
    assert half == drawn("random 0.5")
    assert half != drawn("random 0.5", "t2")
    assert set(drawn("random 0.25")) < set(half)
    assert set(drawn("random 0.25, 1-2")) == {*drawn("random 0.25"), ("1", "2"), ("2", "1")}
    assert len(parse_agents(["random 0.5"], places)) == 21
    with pytest.raises(BadInput, match=r"random 0\.01 of 40 edges is none of them"):
        drawn("random 0.01")


def test_another_edge_moves_no_draw() -> None:
    """With one place more to give, all that were drawn before are drawn again."""
    edges = [(str(one), str(one + 1)) for one in range(1, 41)]
    before = set(parse_links("random 0.5", Places(edges, seed=7)))
    after = set(parse_links("random 0.5", Places([*edges, ("41", "42")], seed=7)))
    assert (len(before), len(after)) == (40, 42)
    assert before < after


def test_link_settings_are_read_alone() -> None:
    """What is written in words becomes the transport's values; nothing else is in the result."""
    assert read(LinkChanges, {"latency": "2 ms", "rate": "9600 bit/s"}) == {
        "latency": Constant(2_000_000),
        "rate": 9600.0,
    }
    with pytest.raises(BadInput, match=r"rate: rate is 0 bit/s, it must be above 0; queue.limit: should be a valid"):
        read(LinkChanges, {"rate": "0 bit/s", "queue": {"limit": "many"}})
