"""docs/so3.md: what is measured is near what theory expects."""

from __future__ import annotations

import re

from .conftest import DOCS

TEXT = (DOCS / "so3.md").read_text("utf-8")


def test_what_is_measured_is_what_is_expected() -> None:
    """Factors to three digits, spreads within 5 %; the wander of 24 runs, 6 to 20 % by chance, within 20 %."""
    pairs = re.findall(r"([\d.]+)(?: a step| deg(?: from 30 s to 60 s)?|% remain), expected ([\d.]+)", TEXT)
    assert len(pairs) == 6 + 9 + 2 + 2
    for number, (found, expected) in enumerate((float(found), float(expected)) for found, expected in pairs):
        allowed = 0.001 if number < 6 else 0.05 * expected if number < 15 else 0.2 * expected
        assert abs(found - expected) <= allowed + 1e-9
