"""Loss and latency models of users' own: keyed draws, states that begin anew, and errors that name model and link."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace

import pytest

from volery.errors import BadInput, RunFailed
from volery.transport.directed_link import DirectedLink
from volery.transport.latency_settings import Constant
from volery.transport.link_models import LatencyModel, Loss, LossModel, Memory, SentFrame
from volery.transport.links import CORRUPT, DELIVERED, LOST, LinkSettings
from volery.transport.loss_settings import LOSSES, Bernoulli
from volery.transport.loss_stages import loss_stage
from volery.transport.propagation import Propagation
from volery.units import Probability

MS = 1_000_000
LOSE_ALL = LinkSettings(loss=(Bernoulli(1.0),))


@dataclass(frozen=True)
class Reach(LossModel):
    """Loses by distance and length."""

    reach_m: float

    def probability(self, frame: SentFrame) -> float:
        """1 at the reach, for frames of 1000 bits."""
        return min(1.0, frame.distance_m / self.reach_m) * min(1.0, frame.bits / 1000)


@dataclass(frozen=True)
class Every(LossModel):
    """Loses every n-th frame of a life."""

    number: int

    def begin(self, link: DirectedLink) -> Callable[[SentFrame], bool]:
        """Count."""
        count = 0

        def lost(_frame: SentFrame) -> bool:
            nonlocal count
            count += 1
            return count % self.number == 0

        return lost


@dataclass(frozen=True)
class Says(LossModel):
    """Loses with whatever probability it is given, NaN included, and fails without one."""

    value: float | None

    def probability(self, frame: SentFrame) -> float:
        """The value, from frame 3 on."""
        if self.value is None:
            raise ZeroDivisionError("no value")
        return self.value if frame.index >= 3 else 0.0


@dataclass(frozen=True)
class Travel(LatencyModel):
    """A minimum of 5 ms, and what frame 2 takes beyond it."""

    beyond_ns: float = 0.0
    least_ns: int = 5 * MS

    @property
    def minimum_ns(self) -> int:
        """The minimum."""
        return self.least_ns

    def latency_ns(self, frame: SentFrame) -> float:
        """More by up to 1 ms for all but frame 2."""
        return 5 * MS + (self.beyond_ns if frame.index == 2 else MS * frame.uniform())


def ends(distance_m: float, incarnation: int = 0) -> DirectedLink:
    """The link from 1 to 2, with its ends so far apart."""
    return DirectedLink.of(7, "1", "2", incarnation, lambda _time_ns: distance_m)


def way(settings: LinkSettings, incarnation: int = 0, distance_m: float = 10.0) -> Propagation:
    """What becomes of frames on that link."""
    return Propagation("2", ends(distance_m, incarnation), settings)


def verdicts(link: Propagation, count: int, bits: int = 1000) -> list[str]:
    """Of so many frames."""
    return [link.send(link.count(), 0, 0, bits)[0].verdict for _ in range(count)]


def test_frames_are_lost_with_the_probability_of_distance_and_length() -> None:
    """Within 4 standard errors; what is expected of a frame is just that."""
    for distance_m, bits, asked in ((10.0, 1000, 0.5), (10.0, 400, 0.2), (30.0, 1000, 1.0)):
        model = Reach(20.0)
        found = verdicts(way(LinkSettings(loss=(model,)), distance_m=distance_m), 4000, bits).count(LOST) / 4000
        assert abs(found - asked) <= 4 * (asked * (1 - asked) / 4000) ** 0.5
        assert loss_stage(model, ends(distance_m)).expected(3, 0, bits) == asked


def test_random_numbers_belong_to_frame_purpose_and_link() -> None:
    """The same whenever they are asked for, others for another purpose, link or life, and none that others draw."""

    def draws(link: DirectedLink) -> list[float]:
        frame = SentFrame(link.within("own"), 5, 0, 8)
        return [frame.uniform(), frame.uniform(), frame.uniform("x"), frame.uniform("loss")]

    first = draws(DirectedLink.of(7, "1", "2"))
    assert first == draws(DirectedLink.of(7, "1", "2"))
    assert first[0] == first[1]
    others = [draws(DirectedLink.of(7, *ends)) for ends in (("2", "1"), ("1", "3"))]
    others += [draws(DirectedLink.of(7, "1", "2", 1)), [DirectedLink.of(7, "1", "2").stream("loss").uniform(5)]]
    assert len({*first, *(draw for found in others for draw in found)}) == 3 + 4 - 1 + 4 - 1 + 4 - 1 + 1


def test_a_state_begins_anew_where_models_are_set() -> None:
    """With each life, and when a fault sets another model; other settings leave it alone."""
    settings = LinkSettings(loss=(Every(3),))
    link = way(settings)
    pattern = [DELIVERED, DELIVERED, LOST]
    assert verdicts(link, 4) == [*pattern, DELIVERED]
    link.change(replace(settings, latency=Constant(MS)))
    assert verdicts(link, 2) == [DELIVERED, LOST]
    assert verdicts(link, 1) == [DELIVERED]
    link.change(LOSE_ALL)
    link.change(settings)
    assert verdicts(link, 3) == pattern
    assert verdicts(way(settings, incarnation=1), 3) == pattern
    assert verdicts(way(LinkSettings(corruption=(Every(2),))), 2) == [DELIVERED, CORRUPT]


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (Says(math.nan), "test_link_models:Says on link 1>2: the probability of frame 3 is nan, and not from 0 to 1"),
        (Says(1.25), "test_link_models:Says on link 1>2: the probability of frame 3 is 1.25, and not from 0 to 1"),
        (Says(None), "test_link_models:Says on link 1>2: ZeroDivisionError: no value"),
    ],
)
def test_what_is_no_probability_is_an_error(model: Loss, message: str) -> None:
    """It names the model, the link, the frame and the value."""
    with pytest.raises(RunFailed, match=r"^loss model ") as refusal:
        verdicts(way(LinkSettings(loss=(model,))), 5)
    assert message in str(refusal.value)


@dataclass(frozen=True)
class Silent(LossModel):
    """Forgets to return what it says."""

    leaves: bool = False

    def probability(self, frame: SentFrame) -> float:  # type: ignore[return]
        """Nothing."""
        if self.leaves:
            sys.exit(3)


@dataclass(frozen=True)
class Unready(LatencyModel):
    """Forgets to return its function."""

    minimum_ns = 0

    def begin(self, link: DirectedLink) -> Callable[[SentFrame], float]:  # type: ignore[empty-body]
        """Nothing."""


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (LinkSettings(loss=(Silent(),)), "Silent on link 1>2: the probability of frame 0 is None, and no number$"),
        (LinkSettings(loss=(Silent(leaves=True),)), "(?s)Silent on link 1>2: SystemExit: 3\n.*test_link_models.py"),
        (LinkSettings(latency=Unready()), "Unready on link 1>2: begin returned None: return the function that is"),
    ],
)
def test_a_model_that_says_nothing_is_an_error(settings: LinkSettings, message: str) -> None:
    """In one sentence, without volery's own lines."""
    with pytest.raises(RunFailed, match=message) as raised:
        verdicts(way(settings), 2)
    assert "link_models.py" not in str(raised.value).replace("test_link_models.py", "")


class Plain(LossModel):
    """Has a field, and no decorator."""

    reach_m: float


@dataclass(frozen=True)
class Blind(LossModel):
    """Does not take the frame."""

    def probability(self) -> float:  # type: ignore[override]
        """Never called."""
        return 0.0


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (Plain, "has fields and is no dataclass: write @dataclass(frozen=True) above it"),
        (Blind, "probability takes other arguments than (self, frame)"),
    ],
)
def test_a_class_that_cannot_work_is_refused(model: type[LossModel], message: str) -> None:
    """Where a scenario names it."""
    with pytest.raises(BadInput, match=f"^loss model .*:{model.__name__}':? {re.escape(message)}"):
        LOSSES.find(f"{__name__}:{model.__name__}")


@pytest.mark.parametrize("beyond_ns", [-1.0, math.nan, math.inf])
def test_a_latency_below_its_minimum_is_an_error(beyond_ns: float) -> None:
    """Or one that is no number: it names model, link, frame and both values."""
    link = way(LinkSettings(latency=Travel(beyond_ns)))
    with pytest.raises(RunFailed, match=r"Travel on link 1>2: the latency of frame 2 is .* minimum_ns is 5000000 ns"):
        verdicts(link, 3)


def test_latencies_are_whole_nanoseconds_from_the_minimum_on() -> None:
    """Copies have numbers of their own; the minimum is what neighbours may rely on."""
    settings = LinkSettings(latency=Travel(), duplication=1.0)
    link = way(settings)
    pairs = [link.send(link.count(), 0, MS, 8) for _ in range(50)]
    due = [copy.due_ns for pair in pairs for copy in pair]
    assert all(type(one) is int and 6 * MS <= one <= 7 * MS for one in due)
    assert sum(first.due_ns == second.due_ns for first, second in pairs) == 1  # frame 2, of which both take the minimum
    assert settings.lookahead_ns() == settings.typical_latency_ns() == 5 * MS


class NoMinimum(LatencyModel):
    """Says nothing of its minimum."""


class Certain(LossModel):
    """More than certain."""

    mean = 1.5


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"latency": NoMinimum()}, r"NoMinimum: .* property minimum_ns"),
        ({"latency": Travel(least_ns=-1)}, r"Travel: minimum_ns is -1, it is a whole number of nanoseconds from 0 on"),
        ({"latency": Travel(least_ns=5e6)}, r"Travel: minimum_ns is 5000000\.0, it is a whole number"),  # type: ignore[arg-type]
        ({"loss": (Certain(),)}, r"Certain: mean is 1\.5, a probability lies between 0 and 1"),
    ],
)
def test_statistics_that_cannot_be_are_refused(settings: dict[str, object], message: str) -> None:
    """Before anything runs."""
    with pytest.raises(BadInput, match=message):
        LinkSettings(**settings)  # type: ignore[arg-type]


def test_a_field_does_not_take_a_member_of_the_base_as_its_default() -> None:
    """A field `mean` without a default would have the property of the base class as its value."""
    with pytest.raises(TypeError, match=r"Named\.mean is a member of its base class: give the field another name"):

        class Named(LossModel):
            mean: Probability


def test_what_a_model_says_of_its_bursts_becomes_a_memory() -> None:
    """(1 + ρ) / (1 − ρ) = 3 for ρ = 0.5; without a state frames are independent, with one nothing is known."""

    class Bursts(LossModel):
        mean = 0.2
        variance_inflation = 3.0

    assert Bursts().memory == pytest.approx(Memory(0.16, 0.5, 0.0))
    assert Reach(1.0).variance_inflation == 1.0
    assert math.isnan(Every(2).variance_inflation)
