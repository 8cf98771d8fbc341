"""docs/formation-world.md: its numbers are those that its script prints, and its picture is small and shown."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from .conftest import DOCS, blocks, typed

PAGE = "formation-world.md"
PICTURE = "formation-world.png"
PARTS = ("motion", "view", "passage")
SMALL_BYTES = 160_000


def test_the_page_quotes_what_the_script_prints(tmp_path: Path) -> None:
    """Each part has its command, and its numbers as they are printed; one picture is of the last two."""
    assert typed(PAGE) == [f".venv/bin/python docs/formation_world.py {part}" for part in PARTS]
    words = [sys.executable, str(DOCS / "formation_world.py"), "all", "--out", str(tmp_path)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert printed == "".join(block.partition("\n")[2] for block in blocks(PAGE, "console"))
    assert (tmp_path / PICTURE).stat().st_size > 0
    assert f"](images/{PICTURE})" in (DOCS / PAGE).read_text("utf-8")
    assert 0 < (DOCS / "images" / PICTURE).stat().st_size < SMALL_BYTES
