"""docs/csma.md: its figures, its numbers, and how close they are to the models."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import DOCS, blocks, typed

PAGE = "csma.md"
TEXT = (DOCS / PAGE).read_text("utf-8")
FIGURES = ("throughput", "saturation")
SMALL_BYTES = 80_000
AIRTIMES = 10 / 0.004
SYSTEMATIC = 0.04
"""What is said of 24 radios instead of infinitely many."""


@pytest.mark.parametrize("name", FIGURES)
def test_the_page_quotes_what_the_script_prints(name: str, tmp_path: Path) -> None:
    """Each figure has its command, its picture and its numbers."""
    assert typed(PAGE) == [f".venv/bin/python docs/csma.py {name}" for name in FIGURES]
    words = [sys.executable, str(DOCS / "csma.py"), name, "--out", str(tmp_path)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert printed == blocks(PAGE, "console")[FIGURES.index(name)].partition("\n")[2]
    picture = f"csma-{name}.png"
    assert (tmp_path / picture).stat().st_size > 0
    assert f"](images/{picture})" in TEXT
    assert 0 < (DOCS / "images" / picture).stat().st_size < SMALL_BYTES


def test_one_attempt_is_as_the_models_say() -> None:
    """Within three standard errors of as many frames as came through, and what the finite number of radios explains."""
    found = re.findall(r"^one attempt.*: S ([\d.]+), model ([\d.]+)", TEXT, re.MULTILINE)
    assert len(found) == 10
    for heard, model in ((float(heard), float(model)) for heard, model in found):
        error = (max(model, 1 / AIRTIMES) / AIRTIMES) ** 0.5
        assert abs(heard - model) < 3 * error + SYSTEMATIC * model


@pytest.mark.parametrize(("what", "bound"), [("S", 0.04), ("given up", 0.05), ("collided", 0.08)])
def test_saturation_is_as_close_to_the_fixed_point_as_is_said(what: str, bound: float) -> None:
    """The bounds stand in the page, and hold for every number of radios."""
    found = re.findall(rf"^\d+ radios: .*?{what} ([\d.]+), model ([\d.]+)", TEXT, re.MULTILINE)
    assert len(found) == 6
    assert f"within {bound}" in TEXT
    assert all(abs(float(heard) - float(model)) <= bound for heard, model in found)
