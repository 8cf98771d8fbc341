"""Where agents are, and are believed to be, through a run: at most so many times a second, where anything changes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...agents.plan import moving
from ...errors import BadInput
from ...quantities import Floats
from ...topologies import natural_key
from ...units import first_period, period_ns
from ..evaluation.evaluation import Evaluation, Series, View
from ..evaluation.evaluation_result import Places, Whole
from .record import Record

RATE_HZ = 50.0
POSITIONS = "positions"
"""What a coupled world calls its truth of where all agents are: a row each, in natural order."""
Reports = Mapping[str, Mapping[str, Series]]
"""Quantity → agent → its reports."""
Truth = Mapping[str, Mapping[str, Floats]]
"""The same for what was true for each report."""
_View = tuple[int, View]
"""The instant from which on it holds."""


def true_places(record: Record) -> Places | None:
    """Of all agents, in natural order: as a world wrote down, as one tells that moves them, or as the topology has."""
    names = tuple(sorted((agent.name for agent in record.plan.agents), key=natural_key))
    positions, world = record.world_reports.get(POSITIONS), moving(record.plan.world)
    if positions is not None:
        rows = _changes(positions.time_ns)
        return Places(
            names, positions.time_ns[rows], positions.value[rows].reshape(len(rows), len(names), -1)[:, :, :2]
        )
    if world is not None:
        times = np.array([*_instants(record.last_ns)], dtype=np.int64)
        everywhere = [[world.position(name, time_ns)[:2] for name in names] for time_ns in times.tolist()]
        return Places(names, times, np.array(everywhere))
    fixed = {agent.name: agent.position[:2] for agent in record.plan.agents if agent.position is not None}
    if len(fixed) < len(names):
        return None
    return Places(names, np.zeros(1, dtype=np.int64), np.array([[fixed[name] for name in names]]))


def _instants(last_ns: int) -> Iterator[int]:
    """The instants of the rate, and the last one."""
    yield from (period_ns(RATE_HZ, index) for index in range(first_period(RATE_HZ, last_ns)))
    yield last_ns


def _changes(times_ns: Whole) -> list[int]:
    """The rows, ascending in time, that are the last before or at an instant of the rate."""
    following = [first_period(RATE_HZ, time_ns) for time_ns in times_ns.tolist()]
    return [row for row, count in enumerate(following) if following[row + 1 : row + 2] != [count]]


def view_places(reports: Reports, judges: Mapping[str, Evaluation]) -> dict[str, Places]:
    """Agent → where it believes whom to be."""
    found = {agent: list(_views(judge, agent, _of_agent(reports, agent))) for agent, judge in judges.items()}
    return {agent: _packed(views) for agent, views in found.items() if views}


def followed_places(reports: Reports, truth: Truth, judges: Mapping[str, Evaluation]) -> Places | None:
    """What is no agent, at its true place: where the truth of what the first agent reported has it."""
    first = min(judges, key=natural_key)
    known = {
        quantity: Series(mine.time_ns, mine.sample, truth[quantity][first])
        for quantity, mine in _of_agent(reports, first).items()
        if np.isfinite(truth[quantity][first]).any()
    }
    found = [
        (time_ns, View({name: place for name, place in view.places.items() if name not in judges}))
        for time_ns, view in _views(judges[first], first, known)
    ]
    return _packed(found) if any(view.places for _, view in found) else None


def _of_agent(reports: Reports, agent: str) -> dict[str, Series]:
    """Quantity → what an agent reported of it."""
    return {quantity: series[agent] for quantity, series in reports.items() if agent in series}


def _views(judge: Evaluation, agent: str, reports: Mapping[str, Series]) -> Iterator[_View]:
    """What an agent's latest reports say, at the rate where any is new."""
    times = np.unique(np.concatenate([mine.time_ns for mine in reports.values()])) if reports else np.zeros(0, np.int64)
    for row in _changes(times):
        time_ns = int(times[row])
        latest = {}
        for quantity, mine in reports.items():
            last = int(np.searchsorted(mine.time_ns, time_ns, side="right")) - 1
            if last >= 0:
                latest[quantity] = mine.value[last]
        view = judge.view(agent, latest)
        if view is None:
            continue
        if not isinstance(view, View):
            raise BadInput(f"evaluation {type(judge).__name__}: view returned {view!r}: return a View, or None")
        yield time_ns, view


def _packed(views: Sequence[_View]) -> Places:
    names = tuple(dict.fromkeys(name for _, view in views for name in view.places))
    column = {name: number for number, name in enumerate(names)}
    places = np.full((len(views), len(names), 2), np.nan)
    has_covariances = any(view.covariances for _, view in views)
    covariances: Floats = np.full((len(views), len(names) if has_covariances else 0, 2, 2), np.nan)
    for row, (_, view) in enumerate(views):
        for name, place in view.places.items():
            if np.isfinite(place[:2]).all():
                places[row, column[name]] = place[:2]
        for name, covariance in view.covariances.items():
            covariances[row, column[name]] = covariance
    times = np.array([time_ns for time_ns, _ in views], dtype=np.int64)
    return Places(names, times, places, covariances, np.array([view.relative for _, view in views]))
