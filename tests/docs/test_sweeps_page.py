"""The figures of docs/sweeps.md: their commands, their numbers and their pictures."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import volery
from volery.experiments.cli.app import app
from volery.experiments.sweeps.axes import axis_of
from volery.experiments.sweeps.sweep_plan import SweepPlan, plan_sweep

from .conftest import DOCS, blocks, typed

PAGE = "sweeps.md"
TEXT = (DOCS / PAGE).read_text("utf-8")
PICTURES = ("paired", "curves", "heat", "pareto")
QUICK = "paired"
SMALL_BYTES = 200_000


def test_every_part_has_its_command_and_pictures() -> None:
    """Two commands, four pictures; every picture is small and shown."""
    assert typed(PAGE) == [f".venv/bin/python docs/sweeps.py {part}" for part in ("paired", "laws")]
    for name in PICTURES:
        picture = f"images/sweeps-{name}.png"
        assert f"]({picture})" in TEXT
        assert 0 < (DOCS / picture).stat().st_size < SMALL_BYTES


def test_the_page_quotes_what_the_script_prints(tmp_path: Path) -> None:
    """The numbers of the part that takes a moment stand in the page as they are printed."""
    words = [sys.executable, str(DOCS / "sweeps.py"), QUICK, "--out", str(tmp_path)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    quoted = next(block for block in blocks(PAGE, "console") if f"docs/sweeps.py {QUICK}\n" in block)
    assert printed == quoted.partition("\n")[2]
    assert (tmp_path / f"sweeps-{QUICK}.png").stat().st_size > 0


def test_ranges_of_the_page_are_ranges() -> None:
    """Everything in the first column of the table of ranges is understood."""
    table = TEXT[TEXT.index("| written |") : TEXT.index("`--random N` draws")]
    written = re.findall(r"`([^`]+)`", "\n".join(line.split(" | ")[0] for line in table.splitlines()))
    assert len(written) == 9
    for each in written:
        axis = axis_of(f"key={each}")
        assert axis.points or axis.between


@pytest.mark.parametrize("line", [line for block in blocks(PAGE, "sh") for line in block.splitlines()])
def test_commands_parse(line: str) -> None:
    """Every command line of the page is one."""
    app.parse_args(shlex.split(line)[1:], exit_on_error=False)


def test_the_python_of_the_page_plans_a_sweep(monkeypatch: pytest.MonkeyPatch) -> None:
    """Named points that set several fields are cells that can be."""
    (code,) = blocks(PAGE, "python")
    plans: list[SweepPlan] = []
    monkeypatch.setattr(volery, "sweep", lambda scenario, over: plans.append(plan_sweep(scenario, (), over)))
    exec(compile(code, PAGE, "exec"), {"volery": volery})  # noqa: S102 - our own page
    assert [cell.labels for cell in plans[0].cells] == [("plain",), ("thorough",)]


def test_columns_of_the_page_are_columns() -> None:
    """What the table of columns names for links is measured."""
    from volery.experiments.scenario.load import load_scenario
    from volery.experiments.sweeps.sweep_runs import measure
    from volery.experiments.twin import recorded

    measured = measure(recorded(load_scenario("dfa4", ["duration=0.2 s"]).plan))
    assert {*re.findall(r"`(links\.[a-z_]+)`", TEXT)} >= {name for name in measured if name.startswith("links.")}
