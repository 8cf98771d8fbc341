"""The figures of docs/bassolillo.md: their commands, their numbers and their pictures."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import DOCS, blocks, typed

PAGE = "bassolillo.md"
FIGURES = ("fig2", "fig3", "fig4", "altitude", "sign", "ranges", "bounds", "bias", "links")
QUICK = ("bounds",)
SMALL_BYTES = 200_000


def test_every_figure_has_its_command_and_picture() -> None:
    """One command a figure, in order, whose lines begin with its name; every picture is small and shown."""
    assert typed(PAGE) == [f".venv/bin/python docs/bassolillo.py {name}" for name in FIGURES]
    text = (DOCS / PAGE).read_text("utf-8")
    for name, block in zip(FIGURES, blocks(PAGE, "console"), strict=True):
        assert all(line.startswith(f"{name}: ") for line in block.splitlines()[1:])
        picture = f"images/bassolillo-{name}.png"
        assert f"]({picture})" in text
        assert 0 < (DOCS / picture).stat().st_size < SMALL_BYTES


@pytest.mark.parametrize("name", QUICK)
def test_the_page_quotes_what_the_script_prints(name: str, tmp_path: Path) -> None:
    """The numbers of the figures that are drawn in a moment stand in the page as they are printed."""
    words = [sys.executable, str(DOCS / "bassolillo.py"), name, "--out", str(tmp_path)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    quoted = next(
        block
        for block in blocks(PAGE, "console")
        if block.startswith(f"$ .venv/bin/python docs/bassolillo.py {name}\n")
    )
    assert printed == quoted.partition("\n")[2]
    assert (tmp_path / f"bassolillo-{name}.png").stat().st_size > 0
