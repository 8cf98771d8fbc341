"""Who is better: contestants side by side in each setting that they have in common, with intervals and paired tests."""

from __future__ import annotations

import math
import operator
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from ...errors import BadInput
from ...names import did_you_mean
from ..analysis.filter_consistency import departure
from ..analysis.statistics import CONFIDENCE, SIGNIFICANCE, Interval, holm, mean_interval, paired_test
from ..record.record import load
from ..record.run_files import SCENARIO_FILE
from .sweep_results import Sweep
from .sweep_runs import Values, measure

SWEEP, RUN = "sweep", "run"
"""The axis that several sweeps span together, or several runs."""
_SEED = re.compile(r"^seed:.*\n", re.MULTILINE)
Cost = Callable[[float], float]
"""A value of a measure → what is to be small."""
_ERRORS = ("oracle_error", "truth_error", "disagreement")
_PER_ROUND = "/round"
_LISTED = 12


@dataclass(frozen=True)
class Entry:
    """The values of one cell of one sweep: where it stands on each axis, seed → value, and how many runs there were."""

    place: Mapping[str, str]
    values: Mapping[int, float]
    runs: int


@dataclass(frozen=True)
class Standing:
    """One contestant: its mean over those of its `runs` for which the measure is defined, beside the best.

    `behind`: mean difference to the best on common seeds, relative to the best's mean on them; `p` of that paired test,
    corrected. Both NaN for the best itself. `better_than`: places, from 0, of those that it beats significantly.
    `of_halves`: its places, from 0, in two disjoint halves of the seeds; equal to each other where the order is stable.
    """

    label: str
    interval: Interval
    runs: int
    behind: float
    p: float
    better_than: tuple[int, ...]
    of_halves: tuple[int, int]


@dataclass(frozen=True)
class Contest:
    """All contestants in one setting, the best first."""

    where: Mapping[str, str]
    standings: tuple[Standing, ...]


def main_measure(measures: Iterable[str]) -> str:
    """The steady-state rms of the first quantity: of its error to the oracle, else to the truth, else disagreement.

    Raises:
        BadInput: no quantity was measured.
    """
    known = [name for name in measures if _PER_ROUND not in name]
    for error in _ERRORS:
        for name in known:
            if name.endswith(f".{error}.steady_rms"):
                return name
    raise BadInput("no agent reported an estimate: say what to compare by --measure")


def cost_of(measure: str) -> Cost:
    """What of a measure is to be small: fractions delivered are to be large, NEES and NIS near 1, all else small."""
    if measure.endswith((".nees", ".nis")):
        return departure
    return operator.neg if measure == "links.delivered_fraction" else float


def defined(sweep: Sweep) -> list[str]:
    """Measures that are defined in some run."""
    return [name for name in sweep.measures if any(row.values.get(name) is not None for row in sweep.rows)]


def entries(sweeps: Sequence[Sweep], measure: str) -> list[Entry]:
    """Every cell of some sweeps of one scenario.

    Raises:
        BadInput: sweeps of different scenarios or axes, or nothing of this name was measured.
    """
    first = sweeps[0]
    found = []
    for sweep in sweeps:
        if sweep.plan.name != first.plan.name:
            raise BadInput(
                f"{sweep.folder} has results of another scenario, {sweep.plan.name}, than {first.folder}, "
                f"{first.plan.name}: what is compared must be runs of one experiment"
            )
        axes = [axis.name for axis in sweep.plan.axes]
        if {*axes} != {axis.name for axis in first.plan.axes}:
            raise BadInput(f"{sweep.folder} and {first.folder} go over different keys, so that no cell is in both")
        values = sweep.values(measure)
        runs = Counter(row.cell for row in sweep.rows)
        for index, cell in enumerate(sweep.plan.cells):
            name = {SWEEP: sweep.folder.name} if len(sweeps) > 1 else {}
            found.append(Entry({**name, **dict(zip(axes, cell.labels, strict=True))}, values[index], runs[index]))
    return found


def measured_runs(folders: Sequence[Path]) -> dict[str, tuple[int, str, Values]]:
    """Name of a run's folder → its seed, its scenario without the seed, and what was measured."""
    found = {}
    for folder in folders:
        record = load(folder)
        without_seed = _SEED.sub("", (folder / SCENARIO_FILE).read_text("utf-8"))
        found[folder.resolve().name] = record.plan.seed, without_seed, measure(record)
    return found


def entries_of_runs(found: Mapping[str, tuple[int, str, Values]], name: str) -> list[Entry]:
    """One entry for all runs that differ in their seed only, called by the first of them.

    Runs of the same scenario and seed, as by another engine, are entries of their own.
    """
    first: dict[tuple[str, int], str] = {}
    alike: Counter[tuple[str, int]] = Counter()
    runs: Counter[str] = Counter()
    values: dict[str, dict[int, float]] = {}
    for run, (seed, text, measured) in found.items():
        label = first.setdefault((text, alike[text, seed]), run)
        alike[text, seed] += 1
        value = measured.get(name)
        values.setdefault(label, {}).update({} if value is None else {seed: value})
        runs[label] += 1
    return [Entry({RUN: label}, of_seeds, runs[label]) for label, of_seeds in values.items()]


def contests(
    found: Sequence[Entry], by: Sequence[str] = (), confidence: float = CONFIDENCE, cost: Cost = float
) -> list[Contest]:
    """Let cells that differ on the axes `by` compete, wherever they agree on all others.

    By default sweeps compete, or the values of the first axis that has words for values, see `default_by`.

    Raises:
        BadInput: no such axis, or no setting in which two compete.
    """
    axes = list(dict.fromkeys(axis for entry in found for axis in entry.place))
    for axis in by:
        if axis not in axes:
            raise BadInput(f"--by {axis}: no such axis{did_you_mean(axis, axes)}")
    settings: dict[tuple[tuple[str, str], ...], dict[str, Entry]] = {}
    for entry in found:
        where = tuple((axis, value) for axis, value in entry.place.items() if axis not in by)
        label = ", ".join(entry.place[axis] for axis in by) or "all"
        settings.setdefault(where, {})[label] = entry
    every = [_contest(dict(where), rivals, confidence, cost) for where, rivals in settings.items()]
    if SWEEP not in by:
        return every
    shared = [contest for contest in every if len(contest.standings) > 1]
    if not shared:
        raise BadInput("the sweeps have no cell in common, so that nothing can be compared")
    return shared


def default_by(sweeps: Sequence[Sweep]) -> tuple[str, ...]:
    """What competes if nobody says: several sweeps; else the first axis whose values are no numbers, or the first."""
    if len(sweeps) > 1:
        return (SWEEP,)
    axes = sweeps[0].plan.axes
    return next(((axis.name,) for axis in axes if axis.numbers is None), tuple(axis.name for axis in axes[:1]))


def _contest(where: Mapping[str, str], rivals: Mapping[str, Entry], confidence: float, cost: Cost) -> Contest:
    intervals = {label: mean_interval(list(entry.values.values()), confidence) for label, entry in rivals.items()}
    seeds = sorted({seed for entry in rivals.values() for seed in entry.values})
    costs = {label: {seed: cost(value) for seed, value in entry.values.items()} for label, entry in rivals.items()}
    ranked, *of_halves = (_ranked(costs, some) for some in (seeds, seeds[::2], seeds[1::2]))
    pairs = list(combinations(range(len(ranked)), 2))
    tests = [paired_test(costs[ranked[i]], costs[ranked[j]]) for i, j in pairs]
    ps = dict(zip(pairs, holm([test.p for test in tests]), strict=True))
    beaten: dict[int, list[int]] = {place: [] for place in range(len(ranked))}
    for (one, other), test in zip(pairs, tests, strict=True):
        if ps[one, other] < SIGNIFICANCE:
            winner, loser = (one, other) if test.first_smaller else (other, one)
            beaten[winner].append(loser)
    standings = [
        Standing(
            label,
            intervals[label],
            rivals[label].runs,
            _behind(rivals[ranked[0]].values, rivals[label].values) if place else math.nan,
            ps.get((0, place), math.nan),
            tuple(sorted(beaten[place])),
            (of_halves[0].index(label), of_halves[1].index(label)),
        )
        for place, label in enumerate(ranked)
    ]
    return Contest(where, tuple(standings))


def _ranked(costs: Mapping[str, Mapping[int, float]], seeds: Sequence[int]) -> list[str]:
    """The contestants by their mean cost over some seeds, the best first, those without a value last."""

    def order(label: str) -> tuple[bool, float]:
        values = [costs[label][seed] for seed in seeds if seed in costs[label]]
        mean = math.fsum(values) / len(values) if values else math.nan
        return math.isnan(mean), mean

    return sorted(costs, key=order)


def _behind(best: Mapping[int, float], other: Mapping[int, float]) -> float:
    """Σ(other − best) / Σ|best| over common seeds; NaN without any, or where it is not finite."""
    seeds = best.keys() & other.keys()
    scale = math.fsum(abs(best[seed]) for seed in seeds)
    if not scale or not math.isfinite(scale):
        return math.nan
    return sum(other[seed] - best[seed] for seed in sorted(seeds)) / scale


def check_measure(measure: str, known: Sequence[str]) -> str:
    """A measure that there is.

    Raises:
        BadInput: there is none of this name; the message has the nearest.
    """
    if measure not in known:
        near = did_you_mean(measure, known) if len(known) > _LISTED else f" (known: {', '.join(known)})"
        raise BadInput(f"--measure {measure}: no such measure{near}")
    return measure
