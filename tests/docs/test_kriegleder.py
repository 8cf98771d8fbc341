"""The figures of docs/kriegleder.md: their commands, their numbers and their pictures."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import DOCS, blocks, typed

PAGE = "kriegleder.md"
FIGURES = ("fig4", "fig5", "fig7", "fig8", "fig9", "async")
QUICK = ("fig4", "fig7", "fig8")
SMALL_BYTES = 200_000


def test_every_figure_has_its_command_and_picture() -> None:
    """One command a figure, in order; every picture is small and shown."""
    assert typed(PAGE) == [f".venv/bin/python docs/kriegleder.py {name}" for name in FIGURES]
    text = (DOCS / PAGE).read_text("utf-8")
    for name in FIGURES:
        picture = f"images/kriegleder-{name}.png"
        assert f"]({picture})" in text
        assert 0 < (DOCS / picture).stat().st_size < SMALL_BYTES


@pytest.mark.parametrize("name", QUICK)
def test_the_page_quotes_what_the_script_prints(name: str, tmp_path: Path) -> None:
    """The numbers of the figures that are drawn in a moment stand in the page as they are printed."""
    words = [sys.executable, str(DOCS / "kriegleder.py"), name, "--out", str(tmp_path)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    quoted = next(
        block for block in blocks(PAGE, "console") if block.startswith(f"$ .venv/bin/python docs/kriegleder.py {name}")
    )
    assert printed == quoted.partition("\n")[2]
    assert (tmp_path / f"kriegleder-{name}.png").stat().st_size > 0
