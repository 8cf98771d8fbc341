"""Links with models of users' own are held to what these say of themselves, also where nobody may import them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from volery.agents.plan import Plan
from volery.agents.plan_codec import Opaque, decode_plan, decode_value, encode_plan, encode_value
from volery.experiments.evaluation.evaluation_result import load_evaluation, save_evaluation
from volery.experiments.record.channels import channels
from volery.experiments.record.record import Record
from volery.transport.directed_link import DirectedLink
from volery.transport.faults import LinkFault
from volery.transport.link_models import LatencyModel, LossModel, SentFrame
from volery.transport.links import LinkSettings

MS = 1_000_000
Make = Callable[..., Any]
TwinRun = Callable[[Plan], Record]
LINK = ("1", "2")


@dataclass(frozen=True)
class Alternating(LossModel):
    """Loses some share of the frames of each second."""

    shares: tuple[float, ...]

    def probability(self, frame: SentFrame) -> float:
        """By the second."""
        return self.shares[frame.start_ns // (1000 * MS) % len(self.shares)]


@dataclass(frozen=True)
class Bursts(LossModel):
    """Correlated losses, and what the model claims of them."""

    enter: float
    leave: float
    claimed: float = 0.2
    inflated: float = 7.0

    @property
    def mean(self) -> float:
        """As claimed."""
        return self.claimed

    @property
    def variance_inflation(self) -> float:
        """As claimed."""
        return self.inflated

    def begin(self, link: DirectedLink) -> Callable[[SentFrame], bool]:
        """Two states."""
        lost = False

        def next_frame(frame: SentFrame) -> bool:
            nonlocal lost
            lost = frame.uniform() < (1 - self.leave if lost else self.enter)
            return lost

        return next_frame


@dataclass(frozen=True)
class Travel(LatencyModel):
    """From 2 to 6 ms, and the mean that the model claims."""

    claimed_ns: float

    @property
    def minimum_ns(self) -> int:
        """2 ms."""
        return 2 * MS

    @property
    def mean_ns(self) -> float:
        """As claimed."""
        return self.claimed_ns

    def latency_ns(self, frame: SentFrame) -> float:
        """Uniform."""
        return 2 * MS + 4 * MS * frame.uniform()


UNKNOWN = float("nan")


@pytest.mark.parametrize(
    ("settings", "name", "decision"),
    [
        ({"loss": (Alternating((0.1, 0.6)),)}, "loss", "within"),
        ({"corruption": (Alternating((0.1, 0.6)),)}, "corruption", "within"),
        ({"loss": (Bursts(0.05, 0.2),)}, "loss", "within"),
        ({"loss": (Bursts(0.05, 0.2, 0.45),)}, "loss", "outside"),
        ({"loss": (Bursts(0.05, 0.2, UNKNOWN),)}, "loss", "not comparable"),
        ({"loss": (Bursts(0.05, 0.2, 0.2, UNKNOWN),)}, "loss", "not comparable"),
        ({"latency": Travel(4.0 * MS)}, "latency", "within"),
        ({"latency": Travel(4.5 * MS)}, "latency", "outside"),
        ({"latency": Travel(UNKNOWN)}, "latency", "not comparable"),
    ],
)
def test_models_are_held_to_what_they_say(
    plan_of: Make, twin_run: TwinRun, settings: dict[str, Any], name: str, decision: str
) -> None:
    """The probabilities of the frames, a mean with its long-run variance, or nothing."""
    record = twin_run(plan_of([LINK], 30_000, settings=LinkSettings(**settings)))
    assert channels(record)[LINK].comparisons()[name].decision == decision


def test_readers_take_comparisons_from_the_evaluation(plan_of: Make, twin_run: TwinRun, tmp_path: Path) -> None:
    """They import no model: without an evaluation the loss is not comparable, with it all is as it was found."""
    settings = LinkSettings(loss=(Alternating((0.1, 0.6)),), latency=Travel(4.0 * MS))
    record = twin_run(plan_of([LINK], 10_000, settings=settings))
    found = channels(record)
    save_evaluation(record.evaluated, tmp_path / "evaluation.npz")
    Alternating.__module__ = Travel.__module__ = "gone"
    try:
        read = replace(record, plan=decode_plan(encode_plan(record.plan), only_read=True))
    finally:
        Alternating.__module__ = Travel.__module__ = __name__
    (model,) = read.plan.links[LINK].loss
    assert isinstance(model, Opaque)
    unknown = channels(replace(read, evaluation=None))[LINK]
    assert (unknown.loss.decision, unknown.latency.decision) == ("not comparable", "not comparable")
    assert unknown.loss.got == found[LINK].loss.got
    kept = channels(replace(read, evaluation=load_evaluation(tmp_path / "evaluation.npz")))
    assert {link: channel.loss for link, channel in kept.items()} == {link: one.loss for link, one in found.items()}
    assert {link: one.latency for link, one in kept.items()} == {link: one.latency for link, one in found.items()}


def test_only_links_with_own_models_are_kept(plan_of: Make, twin_run: TwinRun) -> None:
    """Where a fault sets one they are, too."""
    fault = LinkFault("t1", 500 * MS, None, (LINK,), {"loss": (Alternating((0.5,)),)})
    assert twin_run(plan_of([LINK])).evaluated.channels == {}
    assert set(twin_run(plan_of([LINK, ("2", "3")], faults=(fault,))).evaluated.channels) == {LINK}


def test_live_faults_set_models_again_where_code_runs(plan_of: Make, twin_run: TwinRun) -> None:
    """A replay gets the model of a live fault, a reader its name."""
    fault = LinkFault("f1", 500 * MS, None, (LINK,), {"loss": (Alternating((0.5,)),)})
    record = twin_run(plan_of([LINK]))
    event = {"event": "fault", "time_ns": 500 * MS, "fault": encode_value(fault)}
    replayed = replace(record, events=(*record.events, event))
    assert replayed.faults == (fault,) == (decode_value(event["fault"]),)
    event = json.loads(json.dumps(event).replace(f"{__name__}:", "gone:"))
    read = replace(record, events=(*record.events, event), only_read=True)
    (only,) = read.faults
    assert isinstance(only, LinkFault)
    assert only.changes["loss"] == (Opaque("gone:Alternating", {"shares": (0.5,)}),)
