"""What the results of the contest say: the table, who wins how surely, and the claims of contest.md as numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations
from pathlib import Path

import contest_figures
import numpy as np
from contest import CONDITIONS, FILTERS, GRAPHS, Result
from scipy.stats import t, wilcoxon

REFERENCE = "local only"
CONTENDERS = tuple(name for name in FILTERS if name != REFERENCE)
HONEST = ("on information", "hybrid by contributions", "covariance intersection", "event-triggered")
"""Those that claim never to be overconfident."""
SIGNIFICANT = 0.05
FRESH = tuple(condition for condition in CONDITIONS if condition not in ("late", "radio"))
"""Conditions in which no message comes samples too late."""


class Results:
    """All results, to be asked by who and where."""

    def __init__(self, found: Iterable[Result]) -> None:
        self.all = tuple(found)
        self.seeds = tuple(sorted({one.seed for one in self.all}))

    def of(
        self,
        who: str,
        condition: str | None = None,
        graph: str | None = None,
        seeds: Sequence[int] | None = None,
    ) -> list[Result]:
        """The results of one contender, somewhere, in the order of the table."""
        return [
            one
            for one in self.all
            if one.contender == who
            and condition in (None, one.condition)
            and graph in (None, one.graph)
            and (seeds is None or one.seed in seeds)
        ]

    def ratio(self, who: str, condition: str, graph: str | None = None, seeds: Sequence[int] | None = None) -> float:
        """Geometric mean of the errors over those of the centralised filter."""
        return mean_ratio(self.of(who, condition, graph, seeds))

    def anees(self, who: str, condition: str, graph: str | None = None) -> float:
        """Mean ANEES."""
        return float(np.mean([one.anees for one in self.of(who, condition, graph)]))

    def halves(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Two disjoint sets of seeds: those of odd place and those of even."""
        return self.seeds[::2], self.seeds[1::2]

    def ranks(self, condition: str, seeds: Sequence[int] | None = None, also: str | None = None) -> dict[str, int]:
        """Contender → its rank by the mean ratio over graphs and seeds, from 1; `also` is one that is not of ours."""
        everybody = CONTENDERS if also is None else (*CONTENDERS, also)
        order = sorted(everybody, key=lambda who: self.ratio(who, condition, None, seeds))
        return {who: place for place, who in enumerate(order, start=1)}

    def moves(self, condition: str) -> dict[str, int]:
        """Contender → how many places apart its ranks in the two halves of the seeds are."""
        first, second = (self.ranks(condition, seeds) for seeds in self.halves())
        return {who: abs(rank - second[who]) for who, rank in first.items()}


def mean_ratio(found: Sequence[Result]) -> float:
    """Geometric mean of error over centralised error; infinite where one diverged."""
    return float(np.exp(np.mean([math.log(one.ratio) for one in found])))


def by_seed(found: Sequence[Result]) -> np.ndarray:
    """For each seed the mean over graphs of the logarithm of the ratio: all graphs of a seed have one target."""
    seeds = sorted({one.seed for one in found})
    return np.array([np.mean([math.log(min(one.ratio, 1e9)) for one in found if one.seed == seed]) for seed in seeds])


def interval(found: Sequence[Result]) -> tuple[float, float]:
    """95 % interval of the geometric mean over seeds, by Student's t over the seeds' means of logarithms."""
    means = by_seed(found)
    half = float(t.ppf(0.975, len(means) - 1) * np.std(means, ddof=1) / math.sqrt(len(means)))
    return math.exp(float(np.mean(means)) - half), math.exp(float(np.mean(means)) + half)


def show(found: Iterable[Result], out: Path) -> Iterator[str]:
    """The table and the findings, line by line; the figures go into a folder."""
    results = Results(found)
    yield f"{len(results.all)} runs: {len(FILTERS)} filters, {len(GRAPHS)} graphs, {len(CONDITIONS)} conditions,"
    yield f"seeds {results.seeds[0]} to {results.seeds[-1]}"
    yield ""
    yield from table(results)
    yield ""
    yield from claims(results)
    contest_figures.draw(results, out)


def table(results: Results) -> Iterator[str]:
    """Payload of each filter, and for each condition its error over the centralised one, and its ANEES; † unstable."""
    moves = {condition: results.moves(condition) for condition in CONDITIONS}
    yield "| filter | B/s | " + " | ".join(CONDITIONS) + " |"
    yield "| --- " * (len(CONDITIONS) + 2) + "|"
    for who in FILTERS:
        bytes_per_s = np.mean([one.bytes_per_s for one in results.of(who, "no loss")])
        cells = [cell(results, who, condition) + "†" * (moves[condition].get(who, 0) > 1) for condition in CONDITIONS]
        yield f"| {who} | {bytes_per_s:.0f} | " + " | ".join(cells) + " |"


def cell(results: Results, who: str, condition: str) -> str:
    """Error over the centralised one and ANEES, or in how many runs it diverged."""
    found = results.of(who, condition)
    diverged = sum(math.isinf(one.error) for one in found)
    if diverged:
        return f"diverges, {diverged} of {len(found)}"
    return f"{mean_ratio(found):.2f} ({results.anees(who, condition):.2f})"


def claims(results: Results) -> Iterator[str]:
    """What the page says, as numbers."""
    yield from honesty(results)
    yield from equality(results)
    yield from winners(results)
    yield from crowding(results)
    yield from stability(results)


def honesty(results: Results) -> Iterator[str]:
    """The largest mean ANEES of those that are never overconfident, and that of all others."""
    for who in CONTENDERS:
        worst, where = max(
            (results.anees(who, condition, graph), f"{graph}, {condition}")
            for condition in CONDITIONS
            for graph in GRAPHS
        )
        kind = "honest" if who in HONEST else "others"
        yield f"{kind}: {who}: largest ANEES {worst:.2f} ({where})"


def equality(results: Results) -> Iterator[str]:
    """How far the information-weighted filter and the hybrid with ω = N are apart where no message is samples late."""
    apart = max(
        abs(one.error / other.error - 1.0)
        for condition in FRESH
        for one, other in zip(
            results.of("information-weighted", condition), results.of("hybrid, ω = N", condition), strict=True
        )
    )
    yield f"equal: information-weighted and hybrid, ω = N, without late messages: to six digits apart by {apart:.0e}"


def winners(results: Results) -> Iterator[str]:
    """For each condition the best three, and against how many others the best wins by Wilcoxon's test after Holm."""
    for condition in CONDITIONS:
        order = list(results.ranks(condition))
        best = order[0]
        told = ", ".join(f"{who} {results.ratio(who, condition):.2f}" for who in order[:3])
        low, high = interval(results.of(best, condition))
        wins = beaten(results, best, condition)
        yield f"best: {condition}: {told}; the first {low:.2f} to {high:.2f}, better than {wins}"


def beaten(results: Results, best: str, condition: str) -> str:
    """Of how many contenders one is better, two-sided over the seeds, corrected for their number."""
    own = by_seed(results.of(best, condition))
    chances = []
    for who in CONTENDERS:
        if who != best:
            apart = own - by_seed(results.of(who, condition))
            chances.append(float(wilcoxon(apart).pvalue) if np.any(np.abs(apart) > 1e-5) else 1.0)
    wins = 0
    for place, chance in enumerate(sorted(chances)):
        if chance * (len(chances) - place) >= SIGNIFICANT:
            break
        wins += 1
    return f"{wins} of {len(chances)}"


def crowding(results: Results) -> Iterator[str]:
    """How many frames arrive on the radio, where least and where most do, and the order of all contenders there."""
    arrived = sorted(
        (float(np.mean([one.delivered for one in results.of(who, "radio", graph)])), f"{who}, {graph}")
        for who in CONTENDERS
        for graph in GRAPHS
    )
    (least, there), (most, elsewhere) = arrived[0], arrived[-1]
    yield f"radio: from {least:.0%} ({there}) to {most:.0%} of the frames arrive ({elsewhere})"
    yield "radio: " + ", ".join(f"{place} {who}" for who, place in results.ranks("radio").items())


def stability(results: Results) -> Iterator[str]:
    """How far the ranks of two disjoint sets of seeds agree: the part of all pairs in the same order."""
    for condition in CONDITIONS:
        first, second = (results.ranks(condition, seeds) for seeds in results.halves())
        pairs = list(combinations(CONTENDERS, 2))
        same = sum((first[a] < first[b]) == (second[a] < second[b]) for a, b in pairs)
        most = max(results.moves(condition).values())
        yield f"ranks: {condition}: {same} of {len(pairs)} pairs in one order in both halves, {most} places apart"
