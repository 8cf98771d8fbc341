"""docs/contest.md: its table, its findings, its figures, and whether the numbers that were kept can be had again."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import astuple
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from volery.experiments.sweeps.sweep_plan import plan_sweep
from volery.experiments.sweeps.sweep_runs import run_job

from .conftest import DOCS, blocks, typed

PAGE = "contest.md"
TEXT = (DOCS / PAGE).read_text("utf-8")
FIGURES = ("errors", "anees", "loss", "conditions", "pareto", "ranks")
SAMPLES = (
    ("ring", "loss 0.6", "hybrid by contributions"),
    ("star", "late", "on information"),
    ("geometric", "radio", "event-triggered"),
)
SMALL_BYTES = 350_000


@pytest.fixture(scope="module")
def contest() -> Iterator[ModuleType]:
    """The script, as it is imported from its folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DOCS))
        yield import_module("contest")
        for name in ("contest", "contest_report", "contest_figures"):
            sys.modules.pop(name, None)


def test_the_page_says_what_the_script_says_of_the_numbers_that_were_kept(contest: ModuleType, tmp_path: Path) -> None:
    """Table and findings, word by word; and all six figures are drawn."""
    printed = "\n".join(import_module("contest_report").show(contest.read(), tmp_path))
    table = "\n".join(line for line in printed.splitlines() if line.startswith("|"))
    assert table in TEXT
    quoted = "".join(block for block in blocks(PAGE, "console") if "contest.py show" in block)
    claim = re.compile(r"(honest|others|equal|best|radio|ranks): ")
    claims = [line for line in printed.splitlines() if claim.match(line)]
    assert claims == [line for line in quoted.splitlines() if claim.match(line)]
    assert {path.name for path in tmp_path.iterdir()} == {f"contest-{name}.png" for name in FIGURES}


def test_figures_are_shown() -> None:
    """Each small, and in the page."""
    for name in FIGURES:
        assert f"](images/contest-{name}.png)" in TEXT
        assert 0 < (DOCS / "images" / f"contest-{name}.png").stat().st_size < SMALL_BYTES


def test_everybody_was_everywhere_the_same_number_of_times(contest: ModuleType) -> None:
    """All filters, graphs and conditions, with the same seeds."""
    kept = contest.read()
    seeds = {one.seed for one in kept}
    assert len(kept) == len(contest.FILTERS) * len(contest.GRAPHS) * len(contest.CONDITIONS) * len(seeds)
    assert len({astuple(one)[:4] for one in kept}) == len(kept)


@pytest.mark.parametrize("chosen", SAMPLES, ids=[" ".join(sample[:2]) for sample in SAMPLES])
def test_a_run_of_the_contest_gives_the_numbers_that_were_kept(
    contest: ModuleType, chosen: tuple[str, str, str]
) -> None:
    """To five digits: bits hang on the machine's libraries."""
    graph, condition, who = chosen[0], chosen[1], chosen[2]
    over = {
        "filter": {who: [f"agents.filter={contest.FILTERS[who]}"]},
        "setting": {"here": contest.settings()[f"{graph}: {condition}"]},
    }
    (job,) = plan_sweep(contest.SCENARIO, [], over, None, "twin").jobs(1, [], None, lambda *_: False)
    found = run_job(job)
    (kept,) = (
        one for one in contest.read() if (one.graph, one.condition, one.contender, one.seed) == (*chosen[:2], who, 1)
    )
    for name, value in {
        contest.ERROR: kept.error,
        contest.BEST: kept.best,
        contest.CONSISTENCY: kept.anees,
        contest.BYTES: kept.bytes_per_s,
        contest.DELIVERED: kept.delivered,
    }.items():
        assert found[name] == pytest.approx(value, rel=1e-5)


def test_commands_of_the_page() -> None:
    """They are those of the script and the Makefile."""
    assert {
        "make contest-small",
        "make contest",
        "volery compare runs/contest --measure 'findings.position error'",
    } <= set(typed(PAGE))
