"""docs/so3.md: its numbers are those that its script prints, and they are near what theory expects."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from .conftest import DOCS, blocks, typed

PAGE = "so3.md"
TEXT = (DOCS / PAGE).read_text("utf-8")
PICTURE = "so3-consensus.png"
PARTS = ("bounds", "noise", "anchor")
SMALL_BYTES = 120_000


def test_the_page_quotes_what_the_script_prints(tmp_path: Path) -> None:
    """Each part has its command, and its numbers as they are printed; one picture, small and shown, is of all three."""
    assert typed(PAGE) == [f".venv/bin/python docs/so3.py {part}" for part in PARTS]
    words = [sys.executable, str(DOCS / "so3.py"), "all", "--out", str(tmp_path)]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert printed == "".join(block.partition("\n")[2] for block in blocks(PAGE, "console"))
    assert (tmp_path / PICTURE).stat().st_size > 0
    assert f"](images/{PICTURE})" in TEXT
    assert 0 < (DOCS / "images" / PICTURE).stat().st_size < SMALL_BYTES


def test_what_is_measured_is_what_is_expected() -> None:
    """Factors to three digits, spreads within 5 %; the wander of 24 runs, 6 to 20 % by chance, within 20 %."""
    pairs = re.findall(r"([\d.]+)(?: a step| deg(?: from 30 s to 60 s)?|% remain), expected ([\d.]+)", TEXT)
    assert len(pairs) == 6 + 9 + 2 + 2
    for number, (found, expected) in enumerate((float(found), float(expected)) for found, expected in pairs):
        allowed = 0.001 if number < 6 else 0.05 * expected if number < 15 else 0.2 * expected
        assert abs(found - expected) <= allowed + 1e-9
