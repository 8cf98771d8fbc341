"""Loss models one by one: what each asks of a frame, what it leaves alone, and what it refuses."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.errors import BadInput
from volery.transport.directed_link import DirectedLink
from volery.transport.link_models import Loss
from volery.transport.links import LOST, LinkSettings
from volery.transport.loss_settings import (
    LOSSES,
    Bernoulli,
    BitError,
    Distance,
    Frames,
    GilbertElliott,
    GilbertElliottTime,
    LossTrace,
    Markov,
)
from volery.transport.loss_stages import loss_stage

MS, SECOND = 10**6, 10**9
EACH: dict[str, Loss] = {
    "bernoulli": Bernoulli(0.3, 0.5),
    "gilbert-elliott": GilbertElliott(0.1, 0.3, 0.8, 0.1),
    "gilbert-elliott-time": GilbertElliottTime(30 * MS, 10 * MS, 0.8, 0.1),
    "markov": Markov(30 * MS, 10 * MS),
    "bit-error": BitError(1e-3),
    "distance": Distance(2.0, -60.0, shadowing=6.0, decorrelation=10 * MS),
    "trace": LossTrace((0, 20 * MS), (0.2, 0.9), 50 * MS),
    "frames": Frames((2, (5, 9), (7, 8), 1)),
}


def around(source: str = "1", target: str = "2", seed: int = 3, incarnation: int = 0) -> DirectedLink:
    """A link whose ends are 10 m apart."""
    return DirectedLink.of(seed, source, target, incarnation, lambda _time_ns: 10.0)


def fates(model: Loss, link: DirectedLink, frames: int = 200) -> list[bool]:
    """Which of the frames of one link are lost, one a millisecond of 300 bits."""
    stage = loss_stage(model, link)
    return [stage.lost(index, index * MS, 300) for index in range(frames)]


def test_every_model_is_tried() -> None:
    """The models of this page are those that scenarios have."""
    assert {name: type(model) for name, model in EACH.items()} == LOSSES.built_in


@pytest.mark.parametrize("model", EACH.values(), ids=EACH)
def test_a_link_has_its_own_draws(model: Loss) -> None:
    """The same link loses the same frames, whatever other links do meanwhile; other links lose others."""
    alone, other = fates(model, around()), fates(model, around("2", "3"))
    first, second = loss_stage(model, around()), loss_stage(model, around("2", "3"))
    together = [(first.lost(index, index * MS, 300), second.lost(index, index * MS, 300)) for index in range(200)]
    assert together == list(zip(alone, other, strict=True))
    assert 0 < sum(alone) < 200
    assert (alone == other) == isinstance(model, Frames)


@pytest.mark.parametrize("model", EACH.values(), ids=EACH)
def test_to_ask_what_is_expected_changes_nothing(model: Loss) -> None:
    """Probabilities may be asked for at any time; the losses stay as they are."""
    stage, losses = loss_stage(model, around()), []
    for index in range(200):
        asked = stage.expected(199 - index, (199 - index) * MS, 300)
        assert 0.0 <= asked <= 1.0
        losses.append(stage.lost(index, index * MS, 300))
    assert losses == fates(model, around())


@pytest.mark.parametrize(("probability", "fate"), [(0.0, False), (1.0, True)])
@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_what_is_certain_happens(probability: float, correlation: float, fate: bool) -> None:
    """A loss of 0 loses nothing and a loss of 1 everything."""
    assert set(fates(Bernoulli(probability, correlation), around())) == {fate}


@pytest.mark.parametrize("bits", [1, 80, 1000, 12_000])
@pytest.mark.parametrize("probability", [0.0, 1e-9, 1e-4, 0.3, 1.0])
def test_longer_frames_die_of_bit_errors_sooner(bits: int, probability: float) -> None:
    """1 − (1 − p)ⁿ, to full precision for small p too; a frame without bits survives."""
    assert BitError(probability).loss_of(bits) == pytest.approx(1 - (1 - probability) ** bits, rel=1e-6)
    assert BitError(probability).loss_of(0) == 0.0


def test_bit_errors_go_by_the_length_of_each_frame() -> None:
    """Short and long frames in turn: at 0.1 a bit, 1000 bits have no chance, and none have nothing to lose."""
    stage = loss_stage(BitError(0.1), around())
    assert [stage.lost(index, 0, 1000 * (index % 2)) for index in range(100)] == [False, True] * 50


def test_named_frames_are_lost_and_no_others() -> None:
    """Single ones and pairs of first and last, in any order and on top of each other."""
    lost = [index for index, fate in enumerate(fates(EACH["frames"], around())) if fate]
    assert lost == [1, 2, 5, 6, 7, 8, 9]


def test_time_goes_on_while_nobody_sends() -> None:
    """Up and down are functions of the instant: seldom or often asked, forwards or back, in the next life as well."""
    model, instants = Markov(5 * MS, 5 * MS), range(0, 2 * SECOND, MS)
    often = loss_stage(model, around())
    course = {instant: often.lost(index, instant, 8) for index, instant in enumerate(instants)}
    seldom, later = loss_stage(model, around()), loss_stage(model, around(incarnation=1))
    backwards = loss_stage(model, around())
    assert all(seldom.lost(index, time, 8) == course[time] for index, time in enumerate(instants[::37]))
    assert all(later.lost(index, time, 8) == course[time] for index, time in enumerate(instants[900:]))
    assert all(backwards.lost(index, time, 8) == course[time] for index, time in enumerate(instants[::-90]))
    assert 500 < sum(course.values()) < 1500


@pytest.mark.parametrize(
    ("time_ns", "expected"), [(0, 0.2), (19 * MS, 0.2), (20 * MS, 0.9), (49 * MS, 0.9), (50 * MS, 0.2), (220 * MS, 0.9)]
)
def test_a_trace_holds_from_its_times_on(time_ns: int, expected: float) -> None:
    """Each value from its own instant until the next; at the repetition the first one again."""
    assert loss_stage(EACH["trace"], around()).expected(0, time_ns, 8) == expected


def test_the_last_value_of_a_trace_stays() -> None:
    """Without repetition; then it is the long-run mean, with one the mean over time."""
    trace = LossTrace((0, 20 * MS), (0.2, 0.9))
    assert loss_stage(trace, around()).expected(0, 10**15, 8) == trace.mean == 0.9
    assert EACH["trace"].mean == pytest.approx(0.4 * 0.2 + 0.6 * 0.9)


def test_loss_grows_with_distance() -> None:
    """By hand: 0 dBm − 40 dB − 27 dB a decade is −67 dBm at 10 m and −94 dBm at 100 m; nearer than 1 m is 1 m.

    A margin of 0 dB is a half, one of ±3 dB at a width of 1.5 dB is 1 / (1 + e^±2); shadowing of 5 dB costs 5 dB.
    """
    model = Distance(2.7, -67.0, width=1.5)
    assert model.loss_at(10.0) == pytest.approx(0.5)
    assert Distance(2.7, -70.0, width=1.5).loss_at(10.0) == pytest.approx(1 / (1 + math.e**2))
    assert Distance(2.7, -64.0, width=1.5).loss_at(10.0) == pytest.approx(1 / (1 + math.e**-2))
    assert Distance(2.7, -94.0, width=1.5).loss_at(100.0) == pytest.approx(0.5)
    assert Distance(2.7, -72.0, width=1.5).loss_at(10.0, 5.0) == pytest.approx(0.5)
    assert model.loss_at(0.0) == model.loss_at(0.5) == model.loss_at(1.0) < 1e-6
    assert [Distance(2.0, -60.0, width=0.0).loss_at(place) for place in (9.0, 11.0, 1e9)] == [0.0, 1.0, 1.0]
    nearer = Distance(2.0, -54.0, power=-4.0, reference_loss=30.0, reference_distance=2.0)
    assert nearer.loss_at(20.0) == pytest.approx(0.5)


def test_distance_is_that_of_the_instant() -> None:
    """Ends that drift apart lose everything from the threshold on."""
    drifting = DirectedLink.of(1, "1", "2", 0, lambda time_ns: time_ns / SECOND)
    stage = loss_stage(Distance(2.0, -60.0, width=0.0), drifting)
    assert [stage.lost(index, index * SECOND, 8) for index in range(1, 21)] == [False] * 10 + [True] * 10


def test_both_directions_are_in_one_shadow() -> None:
    """Where the mean margin is 0 and the receiver a threshold, a frame is lost where the shadowing is above 0."""
    model = Distance(2.0, -60.0, width=0.0, shadowing=6.0, decorrelation=10 * MS)
    there, back, elsewhere = (fates(model, around(*ends)) for ends in (("1", "2"), ("2", "1"), ("1", "3")))
    assert there == back != elsewhere
    assert {True, False} == set(there)
    assert len(set(fates(Distance(2.0, -60.0, width=0.0, shadowing=6.0), around()))) == 1


@given(st.integers(0, 50), st.integers(1, 50))
def test_a_list_of_models_is_their_sum(sending_end: Any, first: int, frames: int) -> None:
    """A frame is lost if any of the models loses it; each draws from streams of its own."""
    never, some, bursts = Bernoulli(0.0), Bernoulli(0.3), GilbertElliott(0.2, 0.4, 0.8)
    verdicts = []
    for models in ((some, bursts), (some,), (never, bursts)):
        sender = sending_end(LinkSettings(loss=models), seed=first)
        for _ in range(frames):
            sender.offer(0, b"x")
        verdicts.append([sender.transmit(index).verdict == LOST for index in range(frames)])
    together, *apart = verdicts
    assert together == [any(fates) for fates in zip(*apart, strict=True)]


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        *[
            (kind, arguments, f"is {bad:g}, a probability lies between 0 and 1")
            for bad in (-0.1, 1.1, math.nan)
            for kind, arguments in [
                (Bernoulli, (bad,)),
                (GilbertElliott, (0.5, bad)),
                (GilbertElliottTime, (MS, MS, bad)),
                (BitError, (bad,)),
                (LossTrace, ((0,), (bad,))),
            ]
        ],
        *[(Bernoulli, (0.5, bad), f"correlation is {bad:g}, it must be at least 0") for bad in (-0.1, 1.0, math.nan)],
        (GilbertElliott, (0.0, 0.5), "to_bad is 0, the good state would never end: .* use bernoulli: 0"),
        (GilbertElliott, (0.5, 0.0, 0.7), "to_good is 0, the bad state would never end: .* use bernoulli: 0.7"),
        (GilbertElliottTime, (99_999, MS), "mean_good is 99999 ns, it must be at least 100 us"),
        (GilbertElliottTime, (MS, 0), "mean_bad is 0 ns"),
        (Markov, (-1, MS), "mean_up is -1 ns"),
        (Markov, (MS, 0), "mean_down is 0 ns"),
        (Frames, ((),), "names no frame"),
        (Frames, ((3, (5, 4)),), "frames from 5 to 4"),
        (Frames, ((-1,),), "frames from -1 to -1: sequence numbers are at least 0"),
        (LossTrace, ((), ()), "0 times and 0 losses"),
        (LossTrace, ((0, 1), (0.5,)), "2 times and 1 losses"),
        (LossTrace, ((5,), (0.5,)), "starts at 0"),
        (LossTrace, ((0, 2 * SECOND, SECOND), (0.1, 0.2, 0.3)), "time 3 of the trace is 1 s after 2 s"),
        (LossTrace, ((0, SECOND, SECOND), (0.1, 0.2, 0.3)), "time 3 of the trace is 1 s after 1 s"),
        (LossTrace, ((0, SECOND), (0.1, 0.2), SECOND), "repeat is 1 s and the trace's last time 1 s"),
        (Distance, (0.0, -80.0), "exponent is 0, it must be above 0"),
        (Distance, (2.0, math.nan), "sensitivity is nan"),
        (Distance, (2.0, -80.0, math.inf), "power is inf"),
        (Distance, (2.0, -80.0, 0.0, 40.0, 0.0), "reference_distance is 0"),
        (Distance, (2.0, -80.0, 0.0, 40.0, 1.0, -1.0), "width is -1 dB"),
        (Distance, (2.0, -80.0, 0.0, 40.0, 1.0, 1.0, -1.0), "shadowing is -1 dB"),
        (Distance, (2.0, -80.0, 0.0, 40.0, 1.0, 1.0, 0.0, SECOND), "decorrelation is of shadowing, and there is none"),
        (Distance, (2.0, -80.0, 0.0, 40.0, 1.0, 1.0, 3.0, 10), "decorrelation is 10 ns, it must be at least 100 us"),
    ],
)
def test_what_makes_no_sense_is_refused(kind: Any, arguments: tuple[Any, ...], message: str) -> None:
    """The message gives the value, the bound and the remedy."""
    with pytest.raises(BadInput, match=message):
        kind(*arguments)


def test_ends_without_places_have_no_distance() -> None:
    """A stage says so when it is asked, for whoever did not check before."""
    nowhere = DirectedLink.of(1, "1", "2")
    with pytest.raises(BadInput, match="no positions"):
        loss_stage(Distance(2.0, -60.0), nowhere).lost(0, 0, 8)


def test_streams_of_models_do_not_meet() -> None:
    """A list of equal models loses more than one of them: each has draws of its own, in both places of a list."""
    model = EACH["gilbert-elliott-time"]
    first, second, corruption = (fates(model, around().within(name)) for name in ("", "1", "corruption"))
    for one, other in itertools.combinations((first, second, corruption), 2):
        assert one != other
