"""The figures of docs/betanzos.md: their commands, their numbers and their pictures."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import DOCS, blocks, typed

PAGE = "betanzos.md"
FIGURES = ("fig4", "fig5", "fig6", "gain", "loss", "trust")
QUICK = ("algebra", "fig4")
SMALL_BYTES = 200_000


def test_every_figure_has_its_command_and_picture() -> None:
    """One command a figure, in order, after that of the algebra; every picture is small and shown."""
    assert typed(PAGE) == [f".venv/bin/python docs/betanzos.py {name}" for name in ("algebra", *FIGURES)]
    text = (DOCS / PAGE).read_text("utf-8")
    for name in FIGURES:
        picture = f"images/betanzos-{name}.png"
        assert f"]({picture})" in text
        assert 0 < (DOCS / picture).stat().st_size < SMALL_BYTES


@pytest.mark.parametrize("name", QUICK)
def test_the_page_quotes_what_the_script_prints(name: str, tmp_path: Path) -> None:
    """The numbers of what is worked out in a moment stand in the page as they are printed."""
    words = [sys.executable, str(DOCS / "betanzos.py"), name, "--out", str(tmp_path)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    quoted = next(
        block for block in blocks(PAGE, "console") if block.startswith(f"$ .venv/bin/python docs/betanzos.py {name}")
    )
    assert printed == quoted.partition("\n")[2]
