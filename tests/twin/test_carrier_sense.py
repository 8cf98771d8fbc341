"""Carrier sense between a few radios, instant by instant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from volery.agents.agent import Agent, Timer
from volery.agents.plan import Plan
from volery.experiments.analysis.accounting import account
from volery.experiments.record.record import Record
from volery.transport.latency_settings import Constant
from volery.transport.links import Bucket, LinkSettings, Queue
from volery.transport.media_settings import Csma, HalfDuplex

US = 1_000
MS = 1_000 * US
OFFER_NS = 10 * MS
AIRTIME_NS = 4 * MS
CCA_NS, TURNAROUND_NS = 128 * US, 192 * US
PAIR = [("1", "2")]
LINE = [("1", "2"), ("2", "3")]
TRIANGLE = [*LINE, ("1", "3")]


@dataclass(frozen=True)
class CallerParameters:
    """When an agent calls, in nanoseconds, and whom."""

    at_ns: tuple[int, ...] = ()
    target: str = "2"


class Caller(Agent):
    """Sends one payload to its target at each of its instants."""

    Parameters = CallerParameters
    timers_only = True
    parameters: CallerParameters

    def start(self) -> None:
        """Set all timers."""
        for index, time_ns in enumerate(self.parameters.at_ns):
            self.context.set_timer(time_ns, index=index)

    def on_timer(self, timer: Timer) -> None:
        """Call."""
        self.context.send(self.parameters.target, bytes(40))


Calls = Callable[..., Record]


@pytest.fixture
def calls(plan_of: Any, twin_run: Callable[[Plan], Record]) -> Calls:
    """Run radios that call each other: `calls(edges, access, {name: (instants, target)}, …)`."""

    def run(
        edges: list[tuple[str, str]], access: Csma, who: dict[str, tuple[tuple[int, ...], str]], limit: int = 64
    ) -> Record:
        rate = 40 * 8 / (AIRTIME_NS / 1e9)
        medium = HalfDuplex("node", access)
        settings = LinkSettings(medium=medium, rate=rate, queue=Queue(limit), latency=Constant(0))
        names = {name for edge in edges for name in edge}
        each = {name: CallerParameters(*who.get(name, ((), ""))) for name in names}
        plan = plan_of(edges, Caller, settings, (), 300, parameters=each, compute_ns=0)
        return twin_run(plan)

    return run


def starts(record: Record, name: str) -> list[int]:
    """When an agent's frames began, in nanoseconds."""
    return [sent.start_ns for sent in record.batches[name, 0].sent]


def fates(record: Record, name: str) -> dict[str, list[str]]:
    """Source → what became of its frames at an agent."""
    found: dict[str, list[str]] = {}
    for heard in record.batches[name, 0].heard:
        found.setdefault(heard.source, []).append(heard.fate)
    return found


@pytest.mark.parametrize(("behind_ns", "hears"), [(0, False), (TURNAROUND_NS, False), (TURNAROUND_NS + 1, True)])
def test_a_radio_is_not_heard_before_it_has_turned_round(calls: Calls, behind_ns: int, hears: bool) -> None:
    """What listens until the very start of a frame hears nothing of it and spoils it; a nanosecond later it hears it.

    Radio 1 is asked at 10 ms, listens for 128 µs, turns round for 192 µs and begins at 10.32 ms.
    """
    access = Csma(min_be=0, max_be=0, max_backoffs=0)
    second_ns = OFFER_NS + behind_ns
    record = calls(PAIR, access, {"1": ((OFFER_NS,), "2"), "2": ((second_ns,), "1")})
    assert starts(record, "1") == [OFFER_NS + CCA_NS + TURNAROUND_NS]
    if hears:
        assert fates(record, "2") == {"1": ["delivered"]}
        dropped = [(entry.time_ns, entry.cause) for entry in record.batches["2", 0].dropped]
        assert dropped == [(second_ns + CCA_NS, "access")]
    else:
        assert starts(record, "2") == [second_ns + CCA_NS + TURNAROUND_NS]
        assert (fates(record, "1"), fates(record, "2")) == ({"2": ["half-duplex"]}, {"1": ["half-duplex"]})


@pytest.mark.parametrize(("edges", "fate"), [(LINE, "collision"), (TRIANGLE, "delivered")])
def test_hidden_terminals_collide_at_the_one_between(calls: Calls, edges: list[tuple[str, str]], fate: str) -> None:
    """3 is asked while 1 is on the air: where it does not hear 1 both are lost at 2, where it does it holds back."""
    access = Csma(min_be=0, max_be=0, max_backoffs=0)
    record = calls(edges, access, {"1": ((OFFER_NS,), "2"), "3": ((OFFER_NS + 2 * MS,), "2")})
    assert fates(record, "2")["1"] == [fate]
    assert bool(starts(record, "3")) is (edges == LINE)


@pytest.mark.parametrize("max_backoffs", [0, 1, 4])
def test_a_radio_gives_up_after_so_many_backoffs(calls: Calls, max_backoffs: int) -> None:
    """Without waiting it listens max_backoffs + 1 times in a row, hears a frame each time, and gives its own up.

    The frame that waited behind it has its own attempts from then on.
    """
    access = Csma(min_be=0, max_be=0, max_backoffs=max_backoffs)
    asked_ns = OFFER_NS + 2 * MS
    record = calls(PAIR, access, {"1": ((OFFER_NS,), "2"), "2": ((asked_ns, asked_ns), "1")})
    heard_ns = (max_backoffs + 1) * CCA_NS
    dropped = [(entry.sequence, entry.time_ns, entry.cause) for entry in record.batches["2", 0].dropped]
    assert dropped == [(0, asked_ns + heard_ns, "access"), (1, asked_ns + 2 * heard_ns, "access")]
    assert account(record)["2", "1"].lost == {"access": 2}
    assert all(link.closes for link in account(record).values())


def test_backoffs_let_a_frame_wait_until_the_air_is_free(calls: Calls) -> None:
    """With the standard's parameters the mean of five backoffs is longer than the frame that is in the way."""
    record = calls(PAIR, Csma(), {"1": ((OFFER_NS,), "2"), "2": ((OFFER_NS + 4 * MS,), "1")})
    (first,), (second,) = starts(record, "1"), starts(record, "2")
    assert first + AIRTIME_NS <= second - TURNAROUND_NS - CCA_NS
    assert (fates(record, "1"), fates(record, "2")) == ({"2": ["delivered"]}, {"1": ["delivered"]})


def test_a_waiting_frame_contends_when_the_own_one_has_left(calls: Calls) -> None:
    """Two frames of one radio follow each other: the second is listened for from the end of the first on."""
    access = Csma(min_be=0, max_be=0, max_backoffs=0)
    record = calls(PAIR, access, {"1": ((OFFER_NS, OFFER_NS), "2")})
    begins = OFFER_NS + CCA_NS + TURNAROUND_NS
    assert starts(record, "1") == [begins, begins + AIRTIME_NS + CCA_NS + TURNAROUND_NS]
    assert fates(record, "2") == {"1": ["delivered", "delivered"]}


def test_a_bucket_holds_carrier_sense_back(plan_of: Any, twin_run: Callable[[Plan], Record]) -> None:
    """A bucket of one frame fills in 100 ms: the second of two frames contends only then, the first at once."""
    medium = HalfDuplex("node", Csma(min_be=0, max_be=0))
    settings = LinkSettings(medium=medium, rate=80e3, latency=Constant(0), bucket=Bucket(3200.0, 40))
    parameters = {"1": CallerParameters((OFFER_NS, OFFER_NS + MS)), "2": CallerParameters()}
    record = twin_run(plan_of(PAIR, Caller, settings, (), 300, parameters=parameters, compute_ns=0))
    first = OFFER_NS + CCA_NS + TURNAROUND_NS
    assert starts(record, "1") == [first, first + 100 * MS + CCA_NS + TURNAROUND_NS]
