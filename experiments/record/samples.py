"""Reports of all agents side by side: one row a sample, one column an agent, with what they should have been.

Agents that number their samples are compared sample by sample: what an agent reported last under an index counts, and
the instant of a sample is that of its last report. Agents that do not, whose indices repeat or go back in between, are
compared instant by instant: at each instant at which anybody reported, everybody's latest report counts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...agents.coupled_world import ORACLE
from ...agents.registry import find
from ...errors import BadInput
from ...estimators.error_measures import disagreement, error
from ...transport.faults import Fault, Kill
from .record import Record, Series

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]


@dataclass(frozen=True)
class Samples:
    """T samples of N agents with k components each; NaN where an agent has no estimate or a reference is not known.

    time_ns (T,) int64; index (T,) int64; estimate, oracle, truth (T, N, k) in the agents' units, each entry of oracle
    and truth belonging to the report beside it. `apart`: by how much values are off, (…, k) and (…, k) to (…, m).
    """

    quantity: str
    agents: tuple[str, ...]
    time_ns: Whole
    index: Whole
    estimate: Floats
    oracle: Floats
    truth: Floats
    apart: Callable[[Floats, Floats], Floats]

    @cached_property
    def disagreement(self) -> Floats:
        """Of the agents at each sample, (T,), see `spread`."""
        return spread(self.estimate, self.apart)

    @cached_property
    def oracle_error(self) -> Floats:
        """Two-norm of each agent's difference to the oracle, (T, N)."""
        return error(self.apart(self.estimate, self.oracle), 0.0)

    @cached_property
    def truth_error(self) -> Floats:
        """Two-norm of each agent's difference to the truth, (T, N)."""
        return error(self.apart(self.estimate, self.truth), 0.0)


def spread(estimates: Floats, apart: Callable[[Floats, Floats], Floats]) -> Floats:
    """Disagreement of agents about what may be no vector: their differences to the first that has an estimate.

    Args:
        estimates: (…, N, k), rows of NaN for agents without one.
        apart: by how much values are off, as in `Samples`.
    Returns:
        Root mean square distance to the mean, (…).
    """
    first = np.argmin(np.isnan(estimates).any(axis=-1), axis=-1)
    reference = np.take_along_axis(estimates, first[..., np.newaxis, np.newaxis], axis=-2)
    return disagreement(apart(estimates, np.broadcast_to(reference, estimates.shape)))


def samples(record: Record, quantity: str) -> Samples:
    """The reports of a quantity side by side.

    Raises:
        BadInput: nobody reported it, or in different lengths.
    """
    series = record.estimates(quantity)
    beside = references(record, quantity, series)
    if _numbered([mine.sample for mine in series.values()]):
        time_ns, index, rows = _by_sample(series)
    else:
        time_ns, index, rows = _by_instant(series, record.faults)
    estimate, oracle, truth = (
        np.stack([_take(of[agent], rows[agent]) for agent in series], axis=1)
        for of in (
            {agent: mine.value for agent, mine in series.items()},
            {agent: oracle for agent, (oracle, _) in beside.items()},
            {agent: truth for agent, (_, truth) in beside.items()},
        )
    )
    apart = partial(find(record.plan.agent(next(iter(series))).kind).difference, quantity)
    return Samples(quantity, tuple(series), time_ns, index, estimate, oracle, truth, apart)


def _numbered(indices: list[Whole]) -> bool:
    """Whether agents go up through their samples, perhaps with several reports for one, and do not all stay at one."""
    ascend = all((np.diff(index) >= 0).all() for index in indices)
    return ascend and any(len(index) == 1 or index[0] != index[-1] for index in indices)


def _take(values: Floats, rows: Whole) -> Floats:
    """The rows of an array, NaN for row −1."""
    return np.where(rows[:, np.newaxis] >= 0, values[rows], np.nan)


def _by_sample(series: Mapping[str, Series]) -> tuple[Whole, Whole, dict[str, Whole]]:
    index = np.unique(np.concatenate([mine.sample for mine in series.values()]))
    time_ns = np.zeros(len(index), dtype=np.int64)
    rows: dict[str, Whole] = {}
    for agent, mine in series.items():
        last = np.searchsorted(mine.sample, index, side="right") - 1
        has = (last >= 0) & (mine.sample[last] == index)
        rows[agent] = np.where(has, last, -1)
        time_ns = np.where(has, np.maximum(time_ns, mine.time_ns[last]), time_ns)
    return np.maximum.accumulate(time_ns), index, rows


def _by_instant(series: Mapping[str, Series], faults: tuple[Fault, ...]) -> tuple[Whole, Whole, dict[str, Whole]]:
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


def references(record: Record, quantity: str, series: Mapping[str, Series]) -> dict[str, tuple[Floats, Floats]]:
    """Agent → what the oracle says and what is true for each of its reports, (n, k), rows of NaN where not known.

    In a closed loop these are what the world wrote down under the same index.

    Raises:
        BadInput: the agents' class gives references of another length than its agents report.
    """
    width = next(iter(series.values())).value.shape[1]
    plan = record.as_run
    if plan.coupled is not None:
        return {
            agent: (
                _written_down(
                    record.world_reports, mine, width, (f"{ORACLE}{quantity}@{agent}", f"{ORACLE}{quantity}")
                ),
                _written_down(record.world_reports, mine, width, (f"{quantity}@{agent}", quantity)),
            )
            for agent, mine in series.items()
        }

    @cache
    def oracle(kind: str, index: int) -> Floats:
        return _row(find(kind).oracle(plan, quantity, index), width, f"oracle of {quantity!r} in {kind}")

    @cache
    def truth(kind: str, index: int, time_ns: int) -> Floats:
        return _row(find(kind).truth(plan, quantity, index, time_ns), width, f"truth of {quantity!r} in {kind}")

    found = {}
    for agent, mine in series.items():
        kind = plan.agent(agent).kind
        reports = list(zip(mine.sample.tolist(), mine.time_ns.tolist(), strict=True))
        oracles = [oracle(kind, index) for index, _ in reports]
        found[agent] = np.array(oracles), np.array([truth(kind, *report) for report in reports])
    return found


def _written_down(beside: Mapping[str, Series], mine: Series, width: int, names: tuple[str, str]) -> Floats:
    """What the world wrote down, under the first of the names that it knows, for each report of an agent."""
    name = next((name for name in names if name in beside), None)
    if name is None:
        return np.full((len(mine.sample), width), np.nan)
    written = beside[name]
    _row(written.value[0], width, f"what the world wrote down as {name!r}")
    rows = np.searchsorted(written.sample, mine.sample)
    known = np.append(written.sample, -1)[rows] == mine.sample
    return _take(written.value, np.where(known, rows, -1))


def _row(value: ArrayLike | None, width: int, what: str) -> Floats:
    if value is None:
        return np.full(width, np.nan)
    flat = np.asarray(value, dtype=np.float64).ravel()
    if len(flat) != width:
        raise BadInput(f"{what} has {len(flat)} components, the agents report {width}")
    return flat
