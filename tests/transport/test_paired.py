"""Paired channels: what a frame meets is a function of the link and the slot of time, whoever sends how many frames."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import pytest

from volery.errors import BadInput
from volery.transport.directed_link import DirectedLink
from volery.transport.latency_settings import Normal, Uniform
from volery.transport.link_models import Loss
from volery.transport.links import LinkSettings
from volery.transport.loss_settings import Bernoulli, BitError, Distance, GilbertElliott, GilbertElliottTime, Markov
from volery.transport.propagation import Copy, Propagation

MS = 10**6
SLOT = 10 * MS
LOSSES: dict[str, Loss] = {
    "bernoulli": Bernoulli(0.4),
    "correlated": Bernoulli(0.4, 0.7),
    "gilbert-elliott": GilbertElliott(0.2, 0.3, 0.8, 0.1),
    "gilbert-elliott-time": GilbertElliottTime(30 * MS, 30 * MS, 0.8, 0.1),
    "markov": Markov(30 * MS, 30 * MS),
    "bit-error": BitError(1e-3),
    "distance": Distance(2.0, -60.0, shadowing=6.0, decorrelation=30 * MS),
}
LATENCIES = {
    "normal": Normal(5 * MS, MS),
    "correlated": Normal(5 * MS, MS, correlation=0.8),
    "uniform": Uniform(MS, 9 * MS),
}


def sent(settings: LinkSettings, starts_ms: Iterable[int], source: str = "1", life: int = 0) -> dict[int, list[Copy]]:
    """Start [ms] → what became of the frame that starts then, numbered from 0, on the link to agent 2."""
    way = Propagation("2", DirectedLink.of(3, source, "2", life, lambda _time_ns: 10.0), settings)
    return {start: way.send(sequence, start * MS, start * MS + MS, 300) for sequence, start in enumerate(starts_ms)}


def met(copies: list[Copy], start_ms: int) -> list[tuple[str, int]]:
    """Verdict and travel time of a frame and its duplicate."""
    return [(copy.verdict, copy.due_ns - start_ms * MS) for copy in copies]


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_more_frames_meet_the_same_link(loss: Loss) -> None:
    """A sender with seven frames where another has one: at common instants both meet the same, in every model."""
    settings = LinkSettings(
        loss=(loss,), corruption=(loss,), duplication=0.5, latency=LATENCIES["correlated"], paired=SLOT
    )
    few, many = sent(settings, range(0, 3500, 70)), sent(settings, range(0, 3500, 10))
    assert all(met(few[start], start) == met(many[start], start) for start in few)
    assert len({copies[0].verdict for copies in many.values()}) == 3
    apart = replace(settings, paired=None)
    few, many = sent(apart, range(0, 3500, 70)), sent(apart, range(0, 3500, 10))
    assert any(met(few[start], start) != met(many[start], start) for start in few)


@pytest.mark.parametrize("latency", LATENCIES)
@pytest.mark.parametrize("loss", ["bernoulli", "correlated", "gilbert-elliott", "bit-error"])
def test_a_slot_is_one_draw(loss: str, latency: str) -> None:
    """Frames of one slot share their fate, unless that runs in time, and their travel time; other slots have others."""
    settings = LinkSettings(loss=(LOSSES[loss],), latency=LATENCIES[latency], paired=SLOT)
    frames = sent(settings, range(0, 2000, 5))
    assert all(met(frames[start], start) == met(frames[start + 5], start + 5) for start in range(0, 2000, 10))
    assert len({met(frames[start], start)[0][1] for start in range(0, 2000, 10)}) > 100


def test_a_restart_changes_nothing_and_the_other_direction_everything() -> None:
    """The next life of a sender, whose frames are numbered anew, meets the channel of the hour."""
    settings = LinkSettings(loss=(LOSSES["gilbert-elliott"],), latency=LATENCIES["normal"], paired=SLOT)
    whole, restarted = sent(settings, range(0, 2000, 10)), sent(settings, range(1000, 2000, 10), life=1)
    assert all(met(whole[start], start) == met(restarted[start], start) for start in restarted)
    other = sent(settings, range(0, 2000, 10), source="3")
    assert any(whole[start][0].verdict != other[start][0].verdict for start in whole)


@pytest.mark.parametrize("name", ["bernoulli", "correlated", "gilbert-elliott"])
def test_the_law_stays(name: str) -> None:
    """One frame a slot: long-run loss and bursts are those of the model with one frame after the other.

    Ten thousand slots; the long-run variance of a fraction is (1+ρ)/(1−ρ)·p(1−p)/n with ρ at most 0.7: 5 sd are 0.06.
    """
    model = LOSSES[name]
    frames = sent(LinkSettings(loss=(model,), paired=SLOT), range(0, 100_000, 10))
    lost = [copies[0].verdict == "loss" for copies in frames.values()]
    assert sum(lost) / len(lost) == pytest.approx(model.mean, abs=0.06)
    both = sum(one and next_one for one, next_one in pairwise(lost)) / len(lost)
    memory = model.memory
    assert both == pytest.approx(model.mean**2 + memory.covariance * memory.per_frame, abs=0.06)


def test_a_fault_can_pair_a_link() -> None:
    """From the change on the draws belong to slots, as if it had been so from the beginning."""
    settings = LinkSettings(loss=(LOSSES["gilbert-elliott"],), paired=SLOT)
    always = sent(settings, range(0, 2000, 10))
    way = Propagation("2", DirectedLink.of(3, "1", "2"), replace(settings, paired=None))
    for sequence in range(100):
        way.send(sequence, sequence * SLOT, sequence * SLOT, 300)
    way.change(settings)
    later = [way.send(sequence, sequence * SLOT, sequence * SLOT + MS, 300) for sequence in range(100, 200)]
    assert [copies[0].verdict for copies in later] == [always[start][0].verdict for start in range(1000, 2000, 10)]


def test_too_short_a_slot_is_refused() -> None:
    """A chain steps through every slot: a nanosecond would take for ever."""
    with pytest.raises(BadInput, match="at least 100 us"):
        LinkSettings(paired=1000)
