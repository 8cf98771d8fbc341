"""What each link was asked to do to its frames, and what it did: the emulation held to its scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan, prod
from statistics import fmean

from ..transport.faults import LinkFault, LinkName, effective
from ..transport.links import CUT, DELIVERED
from .record import Record
from .stories import Story


@dataclass(frozen=True)
class Channel:
    """Means over the frames that a link put on the air; NaN without any.

    `loss_asked` and `loss_got`: fraction that the loss models lose, frames sent while the link was cut left aside.
    `latency_asked_ns` and `latency_got_ns`: from the last bit out to due, over all frames on the air.
    """

    frames: int
    loss_asked: float
    loss_got: float
    latency_asked_ns: float
    latency_got_ns: float


def channel(record: Record, link: LinkName, frames: Sequence[Story]) -> Channel:
    """Compare one link with its settings, which are read at the start of each frame as the link itself does."""
    base = record.plan.links[link]
    faults = [fault for fault in record.faults if isinstance(fault, LinkFault) and link in fault.links]
    loss_asked: list[float] = []
    loss_got: list[float] = []
    latency_asked: list[float] = []
    latency_got: list[float] = []
    for frame in frames:
        if frame.start_ns is None or frame.airtime_ns is None or frame.due_ns is None:
            continue
        settings = effective(base, link, faults, frame.start_ns)
        latency_asked.append(settings.latency.mean_ns)
        latency_got.append(frame.due_ns - frame.start_ns - frame.airtime_ns)
        if frame.verdict != CUT:
            loss_asked.append(1.0 - prod(1.0 - model.mean for model in settings.loss))
            loss_got.append(frame.verdict != DELIVERED)
    return Channel(len(latency_got), _mean(loss_asked), _mean(loss_got), _mean(latency_asked), _mean(latency_got))


def _mean(values: Sequence[float]) -> float:
    return fmean(values) if values else nan
