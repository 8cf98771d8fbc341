"""Media against the laws of their access methods, in the twin: ALOHA, slotted ALOHA, TDMA, half-duplex."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy import stats

from volery.agents.agent import Agent, Timer
from volery.agents.plan import Plan
from volery.experiments.record.record import Record
from volery.experiments.scenario.slots import radio_slots
from volery.transport.faults import LinkFault, effective
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings
from volery.transport.media_settings import Aloha, Csma, HalfDuplex, SlottedAloha, Tdma, on_air

from ..surroundings import seeds

MS = 1_000_000
AIRTIME_NS = 4 * MS
RATE = 8 * 40 / (AIRTIME_NS / 1e9)
LEAVES = 10
HUB = "1"
SECONDS = 60
BATCHES = 24
LEVEL = 1e-3
"""Of the two-sided t test of the batch means; the seed is fixed."""


@dataclass(frozen=True)
class ShoutParameters:
    """The chance of a slot, or the rate in Hz at which a silent leaf begins; the hub does neither."""

    chance: float = 0.0
    rate: float = 0.0


class Shouter(Agent):
    """Fills the air: in each slot with a chance, or after silences of exponential length between its frames."""

    Parameters = ShoutParameters
    timers_only = True
    parameters: ShoutParameters

    def start(self) -> None:
        """Begin in silence."""
        self._draws = self.context.random("shout")
        self._next(self.context.now_ns, 0)

    def _next(self, now_ns: int, index: int) -> None:
        if self.parameters.chance:
            self.context.set_timer(now_ns + AIRTIME_NS, index=index)
        elif self.parameters.rate:
            silence = -math.log(self._draws.uniform(index)) / self.parameters.rate
            self.context.set_timer(now_ns + int(silence * 1e9), index=index)

    def on_timer(self, timer: Timer) -> None:
        """Shout, perhaps."""
        if self.parameters.rate or self._draws.uniform(timer.index) < self.parameters.chance:
            self.context.send(HUB, b"x" * 40)
        self._next(timer.time_ns + (AIRTIME_NS if self.parameters.rate else 0), timer.index + 1)


def star(plan_of: Any, access: Any, parameters: ShoutParameters) -> Plan:
    """Leaves around a silent hub."""
    edges = [(HUB, str(leaf)) for leaf in range(2, LEAVES + 2)]
    settings = LinkSettings(medium=HalfDuplex("node", access), rate=RATE, latency=Constant(MS))
    each = {str(leaf): parameters for leaf in range(2, LEAVES + 2)} | {HUB: ShoutParameters()}
    plan: Plan = plan_of(edges, Shouter, settings, (), SECONDS * 1000, parameters=each)
    return plan


def throughputs(record: Record) -> tuple[list[float], list[float]]:
    """Load offered to the air and load that the hub hears, in each of the batches of time."""
    starts = [sent.start_ns for batch in record.batches.values() for sent in batch.sent]
    heard = [entry.due_ns for entry in record.batches[HUB, 0].heard if entry.fate == "delivered"]
    edges = np.linspace(0, SECONDS * 1e9, BATCHES + 1)
    share = AIRTIME_NS / (edges[1] - edges[0])
    return (np.histogram(starts, edges)[0] * share).tolist(), (np.histogram(heard, edges)[0] * share).tolist()


def assert_mean(samples: list[float], expected: float) -> None:
    """The mean of the batches is the expected one within its sampling error."""
    error = np.std(samples, ddof=1) / len(samples) ** 0.5
    assert abs(np.mean(samples) - expected) < stats.t.ppf(1 - LEVEL / 2, len(samples) - 1) * error
    assert error < 0.03 * max(expected, 0.1)


@pytest.mark.parametrize("load", [0.2, 0.5, 1.0])
def test_pure_aloha(load: float, plan_of: Any, twin_run: Callable[[Plan], Record]) -> None:
    """N leaves that are silent for exponential times: S = G·(p·e^(−λT))^(N−1), which tends to G·e^(−2G).

    A frame comes through if each of the others is silent at its start, p = 1 − G/N, and begins nothing while it lasts;
    a leaf transmits a share G/N = λT/(1 + λT) of its time.
    """
    share = load / LEAVES
    rate = share / (1 - share) / (AIRTIME_NS / 1e9)
    record = twin_run(star(plan_of, Aloha(), ShoutParameters(rate=rate)))
    offered, heard = throughputs(record)
    through = ((1 - share) * math.exp(-rate * AIRTIME_NS / 1e9)) ** (LEAVES - 1)
    assert_mean(offered, load)
    assert_mean(heard, load * through)
    assert through == pytest.approx(math.exp(-2 * load), rel=0.3)


@pytest.mark.parametrize("load", [0.3, *(pytest.param(load, marks=pytest.mark.long) for load in (1.0, 2.0))])
def test_slotted_aloha(load: float, plan_of: Any, twin_run: Callable[[Plan], Record]) -> None:
    """N leaves that send in each slot with probability p: S = N·p·(1 − p)^(N−1), which tends to G·e^(−G)."""
    chance = load / LEAVES
    record = twin_run(star(plan_of, SlottedAloha(AIRTIME_NS), ShoutParameters(chance=chance)))
    offered, heard = throughputs(record)
    assert_mean(offered, load)
    assert_mean(heard, load * (1 - chance) ** (LEAVES - 1))


@pytest.mark.parametrize("load", [0.5, 2.0, pytest.param(6.0, marks=pytest.mark.long)])
def test_carrier_sense_without_backoff(load: float, plan_of: Any, twin_run: Callable[[Plan], Record]) -> None:
    """Non-persistent CSMA (Kleinrock and Tobagi 1975, (9)), with the time that listening takes.

    In units of the airtime T, with a = turnaround / T and c = cca / T, a cycle has an attempt that finds the channel
    free, others within a that do not hear it yet, the frames, the last of which keeps the channel from being found
    free for c more, and the silence until the next attempt: S = e^(−aG) / (1 + 2a + c − (1 − e^(−aG))/G + 1/G).
    G is the rate of attempts as it was; that they are Poisson holds for many radios, so a systematic 2 % is allowed.
    """
    access = Csma(min_be=0, max_be=0, max_backoffs=0)
    count = 24
    edges = [(str(a), str(b)) for a in range(1, count + 1) for b in range(a + 1, count + 1)]
    settings = LinkSettings(medium=HalfDuplex("node", access), rate=RATE, latency=Constant(MS))
    share = load / count
    rate = share / (1 - min(share, 0.9)) / (AIRTIME_NS / 1e9)
    each = {str(name): ShoutParameters(rate=rate) for name in range(2, count + 1)} | {HUB: ShoutParameters()}
    record = twin_run(plan_of(edges, Shouter, settings, (), 40_000, parameters=each, compute_ns=0))
    sent = sum(len(batch.sent) for batch in record.batches.values())
    gave_up = sum(entry.cause == "access" for batch in record.batches.values() for entry in batch.dropped)
    heard = sum(entry.fate == "delivered" for entry in record.batches[HUB, 0].heard)
    frames = 40.0 / (AIRTIME_NS / 1e9)
    attempts, a, c = (sent + gave_up) / frames, access.turnaround / AIRTIME_NS, access.cca / AIRTIME_NS
    clear = math.exp(-a * attempts)
    expected = clear / (1 + 2 * a + c - (1 - clear) / attempts + 1 / attempts)
    assert heard / frames == pytest.approx(expected, rel=0.02 + 3 / heard**0.5)


def intervals(record: Record, radio: bool) -> Iterable[list[tuple[int, int]]]:
    """Of each transceiver: the whole radio of a node, or the end of an edge; in order."""
    found: dict[tuple[str, ...], set[tuple[int, int]]] = {}
    for (agent, incarnation), batch in record.batches.items():
        for sent in batch.sent:
            if on_air(record.plan.links[agent, sent.target].medium) == radio:
                ends = (agent, str(incarnation)) if radio else (agent, sent.target, str(incarnation))
                found.setdefault(ends, set()).add((sent.start_ns, sent.start_ns + sent.airtime_ns))
    return [sorted(of_one) for of_one in found.values()]


@pytest.mark.parametrize("seed", seeds(8, 20))
def test_no_transceiver_transmits_twice_at_once(
    seed: int, drawn_plan: Any, radio_plan: Any, answerer: type[Agent], twin_run: Callable[[Plan], Record]
) -> None:
    """In no journal do two transmissions of one transceiver overlap, and it hears nothing while it transmits."""
    for plan, radio in ((drawn_plan(answerer, seed), False), (radio_plan(answerer, seed), True)):
        record = twin_run(plan)
        for mine in intervals(record, radio):
            assert all(end <= start for (_, end), (start, _) in pairwise(mine))
        if radio:
            assert_deaf(record)


def audible(record: Record, source: str, agent: str, time_ns: int) -> bool:
    """Whether an agent hears what a neighbour transmits at an instant, itself included."""
    if source == agent:
        return True
    faults = [fault for fault in record.plan.faults if isinstance(fault, LinkFault)]
    link = (source, agent)
    return link in record.plan.links and not effective(record.plan.links[link], link, faults, time_ns).cut


def assert_deaf(record: Record) -> None:
    """No delivered frame was on the air together with a transmission of its receiver, or with another that it hears."""
    sent = {
        (agent, one.target, one.sequence): one for (agent, _), batch in record.batches.items() for one in batch.sent
    }
    on_the_air = {(agent, one.start_ns, one.start_ns + one.airtime_ns) for (agent, _, _), one in sent.items()}
    for (agent, _), batch in record.batches.items():
        for heard in batch.heard:
            frame = sent[heard.source, agent, heard.sequence]
            met = {
                source
                for source, begun, ended in on_the_air
                if source != heard.source
                and begun < frame.start_ns + frame.airtime_ns
                and frame.start_ns < ended
                and audible(record, source, agent, begun)
            }
            if heard.fate == "delivered":
                assert not met
            elif heard.fate == "half-duplex":
                assert agent in met
            elif heard.fate == "collision":
                assert met - {agent}


@pytest.mark.parametrize("seed", range(8))
def test_tdma_has_no_collision(
    seed: int, plan_of: Any, talker: type[Agent], twin_run: Callable[[Plan], Record]
) -> None:
    """On random graphs agents that can be heard at one place never send at once, and nobody sends while it hears."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 9))
    tree = [(str(int(rng.integers(1, late))), str(late)) for late in range(2, count + 1)]
    more = {tuple(sorted(map(int, rng.choice(np.arange(1, count + 1), 2, replace=False)))) for _ in range(count)}
    edges = sorted({*tree, *((str(a), str(b)) for a, b in more)})
    settings = LinkSettings(medium=HalfDuplex("node", Tdma(10.0, 200_000)), rate=250_000.0, latency=Constant(MS))
    plan: Plan = plan_of(edges, talker, settings, (), 1000)
    record = twin_run(replace(plan, slots=radio_slots(plan.links)))
    fates = [heard.fate for batch in record.batches.values() for heard in batch.heard]
    assert len(fates) > 100
    assert set(fates) == {"delivered"}
