"""What each link was asked to do to its frames, and what it did: the emulation held to its scenario.

The settings are read at the start of each transmission, as the link itself does. What a half-duplex or shared medium
did to a frame at its receiver does not follow from settings, and is left out.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np

from ...agents.plan_codec import Opaque
from ...transport.directed_link import DirectedLink
from ...transport.faults import LinkFault, LinkName, effective
from ...transport.link_models import OwnModel
from ...transport.links import CORRUPT, CUT, LOST, NANOSECONDS, LinkSettings
from ...transport.loss_settings import loss_variance
from ...transport.loss_stages import expected_loss, loss_stages
from ...transport.media_settings import on_air
from ..evaluation.comparisons import (
    NOTHING,
    Channel,
    Comparison,
    compare_all,
    compare_fraction,
    compare_mean,
    significance,
)
from .frame_fates import FrameFate, frame_fates
from .record import Record

_Place = Callable[[int], DirectedLink]
_ROUNDING_NS = 1.0
_WALL_CLOCK_NS = 1e6
"""A process wakes up and is scheduled to about a millisecond: by so much a mean latency may be off in realtime pace."""
_BY_CHANCE = 4
"""Comparisons of a link that chance has a part in: loss, corruption, duplication, latency."""


class LinkCourse:
    """The settings of one link through a run."""

    def __init__(self, record: Record, link: LinkName) -> None:
        faults = [fault for fault in record.faults if isinstance(fault, LinkFault) and link in fault.links]
        ends = [fault.until_ns for fault in faults if fault.until_ns is not None]
        self._changes = sorted({0, *(fault.at_ns for fault in faults), *ends})
        base = record.plan.links[link]
        self.settings = [effective(base, link, faults, change) for change in self._changes]

    def at(self, time_ns: int) -> LinkSettings:
        """Those that hold at an instant."""
        return self.settings[bisect_right(self._changes, time_ns) - 1]


class _Transmission(NamedTuple):
    """A frame on the air, or a duplicate, and the settings that it met; `timed`: its arrival is by the wall clock."""

    incarnation: int
    sequence: int
    copy: int
    size: int
    start_ns: int
    airtime_ns: int
    due_ns: int
    latency_ns: int
    timed: bool
    verdict: str
    settings: LinkSettings

    @property
    def draw(self) -> int:
        """Index of the draws that decided about it."""
        return self.settings.draw_index(self.sequence, self.start_ns)


def channels(record: Record) -> dict[LinkName, Channel]:
    """Compare each link of a run with its settings; what its evaluation has is taken from there."""
    fates = frame_fates(record)
    kept = {} if record.evaluation is None else record.evaluation.channels
    alpha = significance(_BY_CHANCE * len(fates))
    sent = {link: list(_transmissions(LinkCourse(record, link), frames)) for link, frames in fates.items()}
    radios: dict[str, dict[tuple[int, int], _Transmission]] = {}
    for (source, target), frames in sent.items():
        if on_air(record.plan.links[source, target].medium):
            radios.setdefault(source, {}).update({(frame.incarnation, frame.start_ns): frame for frame in frames})
    return {
        link: kept.get(link) or _channel(frames, radios.get(link[0], {}), _place(record, link), alpha)
        for link, frames in sent.items()
    }


def channels_to_keep(record: Record) -> dict[LinkName, Channel]:
    """The comparisons of links with models of users' own, whose code only evaluations run."""
    links = [link for link in record.plan.links if any(map(_runs_own_code, LinkCourse(record, link).settings))]
    return {link: channel for link, channel in channels(record).items() if link in links} if links else {}


def _runs_own_code(settings: LinkSettings) -> bool:
    models = (*settings.loss, *settings.corruption, settings.latency)
    return any(isinstance(model, OwnModel) for model in models)


def _place(record: Record, link: LinkName) -> _Place:
    """The surroundings of a link's stages in each life of its source."""
    plan, (source, target) = record.plan, link

    def distance_m(time_ns: int) -> float:
        return plan.distance_m(source, target, time_ns)

    return lambda incarnation: DirectedLink.of(plan.seed, source, target, incarnation, distance_m)


def _independent(sent: Sequence[_Transmission]) -> list[_Transmission]:
    """Of the frames that had the same draws, as those of one slot of a paired channel have, the first."""
    first: dict[tuple[LinkSettings, int], tuple[int, int]] = {}
    for frame in sent:
        if frame.settings.paired is not None:
            first.setdefault((frame.settings, frame.draw), (frame.incarnation, frame.sequence))
    return [
        frame
        for frame in sent
        if frame.settings.paired is None or first[frame.settings, frame.draw] == (frame.incarnation, frame.sequence)
    ]


def _transmissions(course: LinkCourse, frames: Sequence[FrameFate]) -> Iterator[_Transmission]:
    for frame in frames:
        size, start, airtime, due, verdict = frame.size, frame.start_ns, frame.airtime_ns, frame.due_ns, frame.verdict
        latency = frame.latency_ns
        if size is None or start is None or airtime is None or due is None or latency is None or verdict is None:
            continue
        timed = frame.arrived_ns is not None
        number = (frame.incarnation, frame.sequence, frame.copy)
        yield _Transmission(*number, size, start, airtime, due, latency, timed, verdict, course.at(start))


def _channel(
    sent: Sequence[_Transmission], radio: Mapping[tuple[int, int], _Transmission], place: _Place, alpha: float
) -> Channel:
    """Compare one link; `radio`: what the radio that it goes over transmitted, by incarnation and start."""
    ordered = sorted(sent, key=lambda frame: (frame.incarnation, frame.start_ns))
    originals = [frame for frame in ordered if not frame.copy]
    independent = _independent(ordered)
    uncut = [frame for frame in independent if frame.verdict != CUT and not frame.copy]
    copies = [frame for frame in independent if frame.copy]
    kept = [frame for frame in uncut if frame.verdict != LOST]
    return Channel(
        frames=len(originals),
        loss=_swallowed(uncut, place, "loss", LOST, alpha),
        corruption=_swallowed([*kept, *copies], place, "corruption", CORRUPT, alpha),
        duplication=_duplication(kept, len(copies), alpha),
        latency=_latency(independent, alpha),
        rate=_rate(originals),
        burst=_burst([radio[key] for key in sorted(radio)] if radio else originals),
    )


def _swallowed(frames: Sequence[_Transmission], place: _Place, field: str, verdict: str, alpha: float) -> Comparison:
    """Frames that the models of a field lose; the models restart where they change and with each incarnation.

    Copies come last, and have models of their own.
    """
    expected: list[float] = []
    variance, happened = 0.0, sum(frame.verdict == verdict for frame in frames)
    for (life, copy, models), group in groupby(
        frames, lambda frame: (frame.incarnation, frame.copy, getattr(frame.settings, field))
    ):
        stretch = list(group)
        if any(isinstance(model, Opaque) for model in models):
            return Comparison(len(frames), got=happened / len(frames), decision="not comparable")
        link = place(life).within("duplicate") if copy else place(life)
        stages = loss_stages(models, link, "" if verdict == LOST else field)
        expected_here = [
            expected_loss(stages, frame.draw, frame.start_ns, frame.settings.bits(frame.size)) for frame in stretch
        ]
        expected += expected_here
        variance += loss_variance(models, [(frame.draw, frame.start_ns) for frame in stretch], expected_here)
    return compare_fraction(expected, happened, variance, alpha)


def _duplication(kept: Sequence[_Transmission], copies: int, alpha: float) -> Comparison:
    expected = [frame.settings.duplication for frame in kept]
    return compare_fraction(expected, copies, math.fsum(p * (1 - p) for p in expected), alpha)


def _latency(sent: Sequence[_Transmission], alpha: float) -> Comparison:
    asked, got = [], []
    held_up, last_due, life, inflations = False, -1, 0, [1.0]
    for frame in sent:
        if frame.incarnation != life:
            last_due, life = -1, frame.incarnation
        held_up |= not frame.settings.reordering and frame.due_ns == last_due
        last_due = max(last_due, frame.due_ns)
        if not frame.copy:
            model = frame.settings.latency
            inflations.append(math.nan if isinstance(model, Opaque) else model.variance_inflation)
            asked.append(
                math.nan if isinstance(model, Opaque) else model.expected_ns(frame.start_ns + frame.airtime_ns)
            )
            got.append(frame.latency_ns)
    rounding_ns = _WALL_CLOCK_NS if any(frame.timed for frame in sent) else _ROUNDING_NS
    found = compare_mean(asked, got, float(np.max(inflations)), alpha, rounding_ns, least=0.0)
    if held_up and found.decision != "within":
        return replace(found, decision="not comparable")
    return found


def _rate(frames: Sequence[_Transmission]) -> Comparison:
    asked = [frame.settings.airtime_ns(frame.size) for frame in frames]
    if not any(asked) and not any(frame.airtime_ns for frame in frames):
        return NOTHING
    bits = sum(frame.settings.bits(frame.size) for frame, airtime in zip(frames, asked, strict=True) if airtime)

    def rate(airtimes: Sequence[float]) -> float:
        return bits * NANOSECONDS / total if (total := sum(airtimes)) else math.nan

    found = compare_all(asked, [frame.airtime_ns for frame in frames], rate)
    lives = (list(life) for _, life in groupby(frames, lambda frame: frame.incarnation))
    pairs = (pair for life in lives for pair in pairwise(life))
    if any(later.start_ns < earlier.start_ns + earlier.airtime_ns for earlier, later in pairs):
        return replace(found, decision="outside")
    return found


def _burst(frames: Sequence[_Transmission]) -> Comparison:
    """Of the spans in which a bucket was in force, the one in which most of its burst was used."""
    found = NOTHING
    for (_, bucket), stretch in groupby(frames, lambda frame: (frame.incarnation, frame.settings.bucket)):
        if bucket is None:
            continue
        sent = list(stretch)
        asked = float(
            max(
                bucket.burst * sent[0].settings.bits_per_byte,
                sent[0].settings.bits(sent[0].size),
            )
        )
        got = _excess(sent, bucket.rate)
        if found.decision == "nothing" or got / asked > found.got / found.asked:
            found = Comparison(len(sent), asked, got, 0.0, asked, "within" if got <= asked + 1 else "outside")
    return found


def _excess(frames: Sequence[_Transmission], rate: float) -> float:
    """The largest Σ bits − rate · span over all spans from one start to another [bit]."""
    sent = most = 0.0
    least = math.inf
    for frame in frames:
        given = rate * frame.start_ns / NANOSECONDS
        least = min(least, sent - given)
        sent += frame.settings.bits(frame.size)
        most = max(most, sent - given - least)
    return most
