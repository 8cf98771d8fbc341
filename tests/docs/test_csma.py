"""docs/csma.md: its figure, its numbers, and how close they are to the models."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from .conftest import DOCS, blocks, typed

PAGE = "csma.md"
PICTURE = "images/csma-throughput.png"
SMALL_BYTES = 80_000
AIRTIMES = 10 / 0.004
SYSTEMATIC = 0.04
"""What is said of 24 radios instead of infinitely many."""


def test_the_page_quotes_what_the_script_prints(tmp_path: Path) -> None:
    """The figure has its command, its picture and its numbers."""
    assert typed(PAGE) == [".venv/bin/python docs/csma.py throughput"]
    words = [sys.executable, str(DOCS / "csma.py"), "throughput", "--out", str(tmp_path)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    (block,) = blocks(PAGE, "console")
    assert printed == block.partition("\n")[2]
    assert (tmp_path / "csma-throughput.png").stat().st_size > 0
    assert f"]({PICTURE})" in (DOCS / PAGE).read_text("utf-8")
    assert 0 < (DOCS / PICTURE).stat().st_size < SMALL_BYTES


def test_the_numbers_are_those_of_the_models() -> None:
    """One attempt a frame: within three standard errors of as many frames as came through, and the finite number."""
    found = re.findall(r"S ([\d.]+), model ([\d.]+)", (DOCS / PAGE).read_text("utf-8"))
    assert len(found) == 10
    for heard, model in ((float(heard), float(model)) for heard, model in found):
        error = (max(model, 1 / AIRTIMES) / AIRTIMES) ** 0.5
        assert abs(heard - model) < 3 * error + SYSTEMATIC * model
