"""Which reports of several agents stand side by side.

Agents that number their samples are compared sample by sample: what an agent reported last under an index counts, and
the instant of a sample is that of its last report. Agents that do not, whose indices repeat or go back in between, are
compared instant by instant: at each instant at which anybody reported, everybody's latest report counts.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...quantities import Floats
from ...transport.faults import Fault, Kill
from ..evaluation.evaluation import Series
from ..evaluation.evaluation_result import Whole

Aligned = tuple[Whole, Whole, dict[str, Whole]]
"""Instants and indices (T,), and agent → the row of its report that counts (T,), −1 where it has none."""


def side_by_side(series: Mapping[str, Series], faults: tuple[Fault, ...]) -> Aligned:
    """The rows of all agents' reports that belong together."""
    if _are_numbered([mine.sample for mine in series.values()]):
        return _by_sample(series)
    return _by_instant(series, faults)


def take(values: Floats, rows: Whole) -> Floats:
    """The rows of an array, NaN for row −1."""
    return np.where(rows[:, np.newaxis] >= 0, values[rows], np.nan)


def _are_numbered(indices: list[Whole]) -> bool:
    """Whether agents go up through their samples, perhaps with several reports for one, and do not all stay at one."""
    ascend = all((np.diff(index) >= 0).all() for index in indices)
    return ascend and any(len(index) == 1 or index[0] != index[-1] for index in indices)


def _by_sample(series: Mapping[str, Series]) -> Aligned:
    index = np.unique(np.concatenate([mine.sample for mine in series.values()]))
    time_ns = np.zeros(len(index), dtype=np.int64)
    rows: dict[str, Whole] = {}
    for agent, mine in series.items():
        last = np.searchsorted(mine.sample, index, side="right") - 1
        has = (last >= 0) & (mine.sample[last] == index)
        rows[agent] = np.where(has, last, -1)
        time_ns = np.where(has, np.maximum(time_ns, mine.time_ns[last]), time_ns)
    return np.maximum.accumulate(time_ns), index, rows


def _by_instant(series: Mapping[str, Series], faults: tuple[Fault, ...]) -> Aligned:
    time_ns = np.unique(np.concatenate([mine.time_ns for mine in series.values()]))
    index = np.full(len(time_ns), -1, dtype=np.int64)
    rows: dict[str, Whole] = {}
    for agent, mine in series.items():
        last = np.searchsorted(mine.time_ns, time_ns, side="right") - 1
        for fault in faults:
            if isinstance(fault, Kill) and fault.agent == agent:
                last[(time_ns >= fault.at_ns) & (mine.time_ns[last] < fault.at_ns)] = -1
        rows[agent] = last
        index = np.maximum(index, np.where(last >= 0, mine.sample[last], -1))
    return time_ns, index, rows
