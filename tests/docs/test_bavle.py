"""The figures of docs/bavle.md: their commands, their numbers and their pictures."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from .conftest import DOCS, blocks, typed

PAGE = "bavle.md"
FIGURES = ("fig3", "fig4", "fig5", "tuning", "loss", "lossy")
QUICK = "lossy"
SMALL_BYTES = 250_000


def test_every_figure_has_its_command_and_picture() -> None:
    """One command a figure, in order; every picture is small and shown."""
    assert typed(PAGE) == [f".venv/bin/python docs/bavle.py {name}" for name in FIGURES]
    text = (DOCS / PAGE).read_text("utf-8")
    for name in FIGURES:
        picture = f"images/bavle-{name}.png"
        assert f"]({picture})" in text
        assert 0 < (DOCS / picture).stat().st_size < SMALL_BYTES


def test_the_page_quotes_what_the_script_prints(tmp_path: Path) -> None:
    """The numbers of the figure that is drawn in a moment stand in the page as they are printed."""
    words = [sys.executable, str(DOCS / "bavle.py"), QUICK, "--out", str(tmp_path)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    command = f"$ .venv/bin/python docs/bavle.py {QUICK}\n"
    quoted = next(block for block in blocks(PAGE, "console") if block.startswith(command))
    assert printed == quoted.removeprefix(command)
    assert (tmp_path / f"bavle-{QUICK}.png").stat().st_size > 0
