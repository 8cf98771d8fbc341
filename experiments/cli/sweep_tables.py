"""Comparisons as tables for the terminal, and as plain data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from rich.table import Table

from ..analysis.statistics import SIGNIFICANCE, Interval, seeds_needed
from ..record.encoding import defined
from ..sweeps.significance import Contest, Standing
from ..sweeps.sweep_results import Sweep

_NOTHING = "–"


def contest_table(title: str, contests: Sequence[Contest], confidence: float) -> Table:
    """A table with one row a contestant, the best of each setting first."""
    table = Table(title=title, title_justify="left", caption_justify="left")
    for axis in short_names(list(contests[0].where) if contests else []):
        table.add_column(axis, overflow="fold")
    for column in (
        "#",
        "contestant",
        "mean",
        f"± {100 * confidence:g} %",
        "seeds",
        "to the first",
        "better than",
    ):
        words = column in ("contestant", "better than")
        table.add_column(column, justify="left" if words else "right", overflow="fold", no_wrap=not words)
    for contest in contests:
        for place, standing in enumerate(contest.standings):
            where = contest.where.values() if place == 0 else [""] * len(contest.where)
            table.add_row(*where, *_cells(place, standing), end_section=place == len(contest.standings) - 1)
    table.caption = (
        f"Intervals: Student's t over the seeds. Better: p < {SIGNIFICANCE:g} in Wilcoxon's signed-rank test on common "
        "seeds, Holm-corrected over all pairs of a setting. In brackets: places in two halves of the seeds that differ."
    )
    return table


def short_names(keys: Sequence[str]) -> list[str]:
    """The last parts of dotted keys, if they are unique."""
    last = [key.rpartition(".")[2] for key in keys]
    return [short if last.count(short) == 1 else key for short, key in zip(last, keys, strict=True)]


def _cells(place: int, standing: Standing) -> Iterator[str]:
    one = standing.interval
    first, second = standing.of_halves
    yield f"{place + 1}" if first == second else f"{place + 1} ({first + 1},{second + 1})"
    yield standing.label
    yield number(one.mean)
    yield half_width(one)
    yield str(one.count) if one.count == standing.runs else f"{one.count} of {standing.runs}"
    behind = "" if math.isnan(standing.behind) else f"{percent(standing.behind)}, "
    yield "" if place == 0 else _NOTHING if math.isnan(standing.p) else f"{behind}p {standing.p:.2g}"
    yield ", ".join(_ranges([other + 1 for other in standing.better_than]))


def number(value: float) -> str:
    """A number with four digits."""
    return _NOTHING if math.isnan(value) else f"{value:.4g}"


def percent(part: float) -> str:
    """A relative difference, with two digits where it is small."""
    return f"{100 * part:+,.0f} %" if abs(part) >= 0.1 else f"{100 * part:+.2g} %"


def half_width(one: Interval) -> str:
    """Half the width of an interval."""
    return _NOTHING if math.isnan(one.low) else f"{(one.high - one.low) / 2:.2g}"


def _ranges(numbers: Sequence[int]) -> Iterator[str]:
    """Ascending numbers, with consecutive ones joined: 2–4, 7."""
    start = 0
    for place in range(1, len(numbers) + 1):
        if place == len(numbers) or numbers[place] != numbers[place - 1] + 1:
            first, last = numbers[start], numbers[place - 1]
            yield str(first) if first == last else f"{first}–{last}"
            start = place


def notes(sweeps: Sequence[Sweep]) -> Iterator[str]:
    """Notes on sweeps for readers of the table."""
    for sweep in sweeps:
        if sweep.missing:
            yield f"{sweep.folder}: {len(sweep.rows)} of {len(sweep.rows) + sweep.missing} runs are finished"
    kinds = {cell.pairing for sweep in sweeps for cell in sweep.plan.cells}
    if "channel, half-duplex apart" in kinds:
        yield "channels are paired, but not what half-duplex or shared media lose: that depends on who sends when"
    if "frame by frame" in kinds:
        yield "links are alike frame by frame: who sends more meets other losses, unless links.paired says otherwise"


def too_few_seeds(contests: Sequence[Contest]) -> Iterator[str]:
    """A note if there are too few seeds for any difference to be significant."""
    few = [needed for contest in contests if (needed := _needed(contest)) > _most(contest)]
    if few:
        where = "" if len(few) == len(contests) else f" in {len(few)} of {len(contests)} settings"
        yield f"too few seeds to tell{where}: it takes {max(few)} or more for each before any can be better"


def _needed(contest: Contest) -> int:
    count = len(contest.standings)
    return seeds_needed(count * (count - 1) // 2)


def _most(contest: Contest) -> int:
    return max(standing.interval.count for standing in contest.standings)


def to_plain(contests: Sequence[Contest]) -> list[dict[str, Any]]:
    """Contests as plain data for JSON, None for unknown numbers."""
    return [
        {"where": dict(contest.where), "standings": [_plain(one, contest) for one in contest.standings]}
        for contest in contests
    ]


def _plain(standing: Standing, contest: Contest) -> dict[str, Any]:
    plain: dict[str, Any] = defined(
        {
            "contestant": standing.label,
            **vars(standing.interval),
            "runs": standing.runs,
            "behind": standing.behind,
            "p": standing.p,
            "places_of_halves": [place + 1 for place in standing.of_halves],
            "better_than": [contest.standings[other].label for other in standing.better_than],
        }
    )
    return plain
