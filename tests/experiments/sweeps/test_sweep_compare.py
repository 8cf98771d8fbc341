"""Contests: who is better in which setting, at which significance."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from volery.errors import BadInput
from volery.experiments.cli.sweep_tables import contest_table, notes, short_names, to_plain, too_few_seeds
from volery.experiments.sweeps.significance import (
    Entry,
    check_measure,
    contests,
    cost_of,
    default_by,
    defined,
    entries,
    main_measure,
)
from volery.experiments.sweeps.sweep_plan import SweepPlan, SweptAxis, SweptCell
from volery.experiments.sweeps.sweep_results import Row, Sweep

SEEDS = range(10)
ERROR = "x.oracle_error.steady_rms"


def entry(name: str, values: dict[int, float], loss: str = "0") -> Entry:
    """A cell of the axes `filter` and `loss`."""
    return Entry({"loss": loss, "filter": name}, values, len(SEEDS))


def level(height: float, wobble: float = 0.1) -> dict[int, float]:
    """Values about a height, differently for each seed."""
    return {seed: height + wobble * math.sin(3 * seed + height) for seed in SEEDS}


def test_the_clear_order_is_found() -> None:
    """Three far apart: each is better than those behind it, with p = 3 tests · 2/2¹⁰ after Holm for the clearest."""
    (contest,) = contests([entry("c", level(9)), entry("a", level(1)), entry("b", level(3))], ["filter"])
    assert [one.label for one in contest.standings] == ["a", "b", "c"]
    assert [one.better_than for one in contest.standings] == [(1, 2), (2,), ()]
    assert contest.standings[1].p == pytest.approx(3 * 2 / 2**10)
    assert contest.standings[2].behind == pytest.approx(8.0, rel=0.05)
    assert math.isnan(contest.standings[0].p)


def test_what_chance_explains_is_not_better() -> None:
    """Equal values, and values that win as often as they lose."""
    same = level(2)
    mixed = {seed: value + (-1) ** seed * 0.01 * (seed + 1) for seed, value in same.items()}
    (contest,) = contests([entry("a", same), entry("b", dict(same)), entry("c", mixed)], ["filter"])
    assert all(one.better_than == () for one in contest.standings)
    assert all(one.p == 1.0 for one in contest.standings[1:])


def test_more_may_be_better() -> None:
    """Of fractions that are delivered the largest comes first."""
    found = [entry("a", level(1)), entry("b", level(3))]
    (contest,) = contests(found, ["filter"], cost=cost_of("links.delivered_fraction"))
    assert [(one.label, one.better_than) for one in contest.standings] == [("b", (1,)), ("a", ())]


def test_a_mean_nees_is_best_near_one() -> None:
    """A filter that is twice too cautious is better than one that is three times overconfident."""
    found = [entry("cautious", dict.fromkeys(SEEDS, 0.5)), entry("confident", dict.fromkeys(SEEDS, 3.0))]
    (contest,) = contests(found, ["filter"], cost=cost_of("pose.nees"))
    assert [(one.label, one.better_than) for one in contest.standings] == [("cautious", (1,)), ("confident", ())]


def test_a_rare_disaster_does_not_hide_who_is_usually_better() -> None:
    """One seed of sixteen makes the mean of a larger than that of b, yet a is better on all others: it is said so."""
    often = {seed: 1.0 + 0.01 * seed for seed in range(1, 16)}
    steady = dict.fromkeys(range(16), 3.0)
    (contest,) = contests([entry("a", {**often, 0: 1000.0}), entry("b", steady)], ["filter"])
    assert [one.label for one in contest.standings] == ["b", "a"]
    assert [one.better_than for one in contest.standings] == [(), (0,)]


def test_an_order_that_halves_of_the_seeds_do_not_agree_on_is_shown() -> None:
    """Even seeds favour a, odd ones b; c is third in both."""
    turns = {seed: 1.0 + (seed % 2) for seed in SEEDS}
    others = {seed: 2.1 - (seed % 2) for seed in SEEDS}
    (contest,) = contests([entry("a", turns), entry("b", others), entry("c", level(9))], ["filter"])
    assert [(one.label, one.of_halves) for one in contest.standings] == [("a", (0, 1)), ("b", (1, 0)), ("c", (2, 2))]
    places = list(contest_table("title", [contest], 0.95).columns[1].cells)
    assert places == ["1 (1,2)", "2 (2,1)", "3"]
    (said,) = to_plain([contest])
    assert [one["places_of_halves"] for one in said["standings"]] == [[1, 2], [2, 1], [3, 3]]


def test_settings_are_apart() -> None:
    """Who competes agrees on all other axes; on request the values of another axis compete, or of two."""
    found = [entry(name, level(height + loss), str(loss)) for loss in (0, 1) for name, height in (("a", 1), ("b", 5))]
    assert [dict(one.where) for one in contests(found, ["filter"])] == [{"loss": "0"}, {"loss": "1"}]
    assert [dict(one.where) for one in contests(found, ["loss"])] == [{"filter": "a"}, {"filter": "b"}]
    (all_of_them,) = contests(found, ["filter", "loss"])
    assert [one.label for one in all_of_them.standings] == ["a, 0", "a, 1", "b, 0", "b, 1"]
    with pytest.raises(BadInput, match=r"--by filtr: no such axis .did you mean 'filter'"):
        contests(found, ["filtr"])


def sweep(folder: str, name: str = "dfa4", filters: tuple[str, ...] = ("a", "b"), repeat: int = 10) -> Sweep:
    """A finished sweep over filters at two losses."""
    axes = (SweptAxis("loss", ("0", "1"), (0.0, 1.0), ""), SweptAxis("agents.filter", filters, None, ""))
    cells = tuple(SweptCell((loss, one), "", "frame by frame") for loss in ("0", "1") for one in filters)
    plan = SweepPlan(name, 0, "twin", axes, cells, {})
    rows = [
        Row(cell, number, number, {ERROR: 1.0 + cell + 0.01 * number, "x.truth_error.ise": None, "links.age_s": 1.0})
        for cell in range(len(cells))
        for number in range(repeat)
    ]
    return Sweep(Path(folder), plan, repeat, tuple(rows))


def test_sweeps_compete_where_they_have_cells_in_common() -> None:
    """Cells that only one of them has are left out; of one sweep the axis without numbers competes."""
    one, other = sweep("runs/one"), sweep("runs/other", filters=("b", "c"))
    assert default_by([one]) == ("agents.filter",)
    assert default_by([one, other]) == ("sweep",)
    held = contests(entries([one, other], ERROR), ("sweep",))
    assert [dict(contest.where) for contest in held] == [{"loss": loss, "agents.filter": "b"} for loss in ("0", "1")]
    assert [standing.label for standing in held[0].standings] == ["other", "one"]
    with pytest.raises(BadInput, match="no cell in common"):
        contests(entries([one, sweep("runs/other", filters=("c",))], ERROR), ("sweep",))


def test_results_of_another_scenario_are_refused() -> None:
    """What is compared must be one experiment, over the same keys."""
    with pytest.raises(BadInput, match="another scenario, dfa16, than runs/one, dfa4"):
        entries([sweep("runs/one"), sweep("runs/other", name="dfa16")], ERROR)
    one = sweep("runs/one")
    fewer = replace(one, plan=replace(one.plan, axes=one.plan.axes[1:]))
    with pytest.raises(BadInput, match="different keys"):
        entries([one, fewer], ERROR)


def test_measures() -> None:
    """What is never defined is not offered; the error to the oracle comes first; a slip is mended."""
    one = sweep("runs/one")
    assert defined(one) == ["links.age_s", ERROR]
    assert main_measure(defined(one)) == ERROR
    assert main_measure(["x.disagreement.steady_rms", "x.truth_error.steady_rms"]) == "x.truth_error.steady_rms"
    with pytest.raises(BadInput, match="--measure"):
        main_measure(["links.age_s"])
    with pytest.raises(BadInput, match=r"known: links.age_s, x"):
        check_measure("links.age", defined(one))
    with pytest.raises(BadInput, match="nothing called"):
        one.values("links.age")


def test_the_table_says_what_its_reader_must_know() -> None:
    """Runs that are missing, undefined or too few, and how far links are paired."""
    one = sweep("runs/one", repeat=4)
    few = replace(one, rows=one.rows[:-1])
    held = contests(entries([few], ERROR), ("agents.filter",))
    assert list(too_few_seeds(held)) == ["too few seeds to tell: it takes 6 or more for each before any can be better"]
    enough = contests(entries([sweep("x")], ERROR), ("agents.filter",))
    assert list(too_few_seeds(enough)) == []
    assert next(too_few_seeds([*enough, held[0]])).startswith("too few seeds to tell in 1 of 3 settings")
    told = list(notes([few]))
    assert told[0] == "runs/one: 15 of 16 runs are finished"
    assert "links.paired" in told[1]
    table = contest_table("title", held, 0.9)
    assert [column.header for column in table.columns][:5] == ["loss", "#", "contestant", "mean", "± 90 %"]
    partly = contests([Entry({"a": "1"}, {1: 2.0, 2: 4.0}, 5), Entry({"a": "2"}, {}, 5)], ["a"])
    cells = [list(column.cells) for column in contest_table("title", partly, 0.95).columns]
    assert cells[4] == ["2 of 5", "0 of 5"]
    assert cells[2] == ["3", "–"]
    assert short_names(["links.loss", "agents.rounds", "b.loss"]) == ["links.loss", "rounds", "b.loss"]


def test_plain_values() -> None:
    """For JSON: None for what is not known, text for what is infinite."""
    (contest,) = to_plain(contests([entry("a", level(1)), entry("b", dict.fromkeys(SEEDS, math.inf))], ["filter"]))
    first, second = contest["standings"]
    assert contest["where"] == {"loss": "0"}
    assert first["better_than"] == ["b"]
    assert (first["p"], first["behind"]) == (None, None)
    assert (second["mean"], second["low"], second["runs"]) == ("inf", None, 10)
