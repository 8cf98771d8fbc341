"""Age of information: how old the newest that a receiver knows of its neighbour is, per link and over time.

Δ(t) = t − g(t), with g(t) the start of the newest frame that was delivered by t   Kaul, Yates and Gruteser 2012
It grows with time and falls at a delivery; a frame that was overtaken by a newer one changes nothing. Counted from the
start of the transmission: what a frame waits in its sender's queue is not in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...transport.faults import LinkName
from ...transport.links import DELIVERED
from ..record.frame_fates import FrameFate, frame_fates
from ..record.record import Record

_HIGH = 0.99


class AgeCourse(NamedTuple):
    """The sawtooth of one link: from each of `time_ns` (n,), ascending, the age grows from `age_ns` (n,) on.

    Until `end_ns`; n = 0 for a link that never delivered anything.
    """

    time_ns: NDArray[np.int64]
    age_ns: NDArray[np.int64]
    end_ns: int

    def at(self, time_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """The age at some instants; NaN before the first delivery."""
        if not len(self.time_ns):
            return np.full(len(time_ns), np.nan)
        last = np.searchsorted(self.time_ns, time_ns, side="right") - 1
        ages = self.age_ns[last] + (time_ns - self.time_ns[last])
        return np.where(last >= 0, ages.astype(float), np.nan)

    def peaks(self, edges_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """The largest age in each span between two edges (m + 1,), ascending; NaN before the first delivery, (m,)."""
        ends = self.at(edges_ns[1:] - 1)
        before = self.at(self.time_ns - 1)
        spans = np.searchsorted(edges_ns, self.time_ns, side="right") - 1
        inside = (spans < len(ends)) & ~np.isnan(before)
        np.fmax.at(ends, spans[inside], before[inside])
        return ends


@dataclass(frozen=True)
class AgeMetrics:
    """Age of information of one link from its first delivery to the end; NaN if it never delivered anything.

    `mean_ns` over time; `p99_ns`: below it for 99 % of the time; `peak_ns`: the largest.
    """

    mean_ns: float
    p99_ns: float
    peak_ns: float


def age_courses(record: Record) -> dict[LinkName, AgeCourse]:
    """The age of information of each link through a run."""
    return {link: age_course(frames, record.last_ns) for link, frames in frame_fates(record).items()}


def age_course(frames: Sequence[FrameFate], end_ns: int) -> AgeCourse:
    """That of one link, from its frames."""
    drops = list(_drops(sorted(_deliveries(frames, end_ns))))
    times, ages = (np.array([drop[number] for drop in drops], dtype=np.int64) for number in (0, 1))
    return AgeCourse(times, ages, end_ns)


def _deliveries(frames: Sequence[FrameFate], end_ns: int) -> Iterator[tuple[int, int]]:
    """When each delivered frame was handed over, and when it started."""
    for frame in frames:
        start_ns, handed_ns = frame.start_ns, frame.handed_ns
        if frame.fate == DELIVERED and start_ns is not None and handed_ns is not None and handed_ns < end_ns:
            yield handed_ns, start_ns


def _drops(deliveries: Sequence[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    """Where the age falls, and to what."""
    newest = -1
    for arrived, start in deliveries:
        if start > newest:
            newest = start
            yield arrived, arrived - start


def age_metrics(course: AgeCourse) -> AgeMetrics:
    """Mean, 99 % quantile and peak over time, exact for the sawtooth."""
    if not len(course.time_ns):
        return AgeMetrics(math.nan, math.nan, math.nan)
    low = course.age_ns.astype(float)
    grown = np.diff(course.time_ns, append=course.end_ns).astype(float)
    mean = float(((low + grown / 2) * grown).sum() / grown.sum())
    return AgeMetrics(mean, _time_quantile(low, low + grown), float((low + grown).max()))


def _time_quantile(low: NDArray[np.float64], high: NDArray[np.float64]) -> float:
    """The age below which a sawtooth with these teeth is for 99 % of its time; between the corners it is linear."""
    corners = np.unique([low, high])
    rising, falling = np.searchsorted(np.sort(low), corners, "right"), np.searchsorted(np.sort(high), corners, "right")
    teeth = rising - falling
    below = np.concatenate(([0.0], np.cumsum(teeth[:-1] * np.diff(corners))))
    return float(np.interp(_HIGH * below[-1], below, corners))
