"""docs/csma.md: how close its numbers are to the models."""

from __future__ import annotations

import re

import pytest

from .conftest import DOCS

TEXT = (DOCS / "csma.md").read_text("utf-8")
AIRTIMES = 10 / 0.004
SYSTEMATIC = 0.04
"""What is said of 24 radios instead of infinitely many."""


def test_one_attempt_is_as_the_models_say() -> None:
    """Within three standard errors of as many frames as came through, and what the finite number of radios explains."""
    found = re.findall(r"^throughput: one attempt.*: S ([\d.]+), model ([\d.]+)", TEXT, re.MULTILINE)
    assert len(found) == 10
    for heard, model in ((float(heard), float(model)) for heard, model in found):
        error = (max(model, 1 / AIRTIMES) / AIRTIMES) ** 0.5
        assert abs(heard - model) < 3 * error + SYSTEMATIC * model


@pytest.mark.parametrize(("what", "bound"), [("S", 0.04), ("given up", 0.05), ("collided", 0.08)])
def test_saturation_is_as_close_to_the_fixed_point_as_is_said(what: str, bound: float) -> None:
    """The bounds stand in the page, and hold for every number of radios."""
    found = re.findall(rf"^saturation: \d+ radios: .*?{what} ([\d.]+), model ([\d.]+)", TEXT, re.MULTILINE)
    assert len(found) == 6
    assert f"within {bound}" in TEXT
    assert all(abs(float(heard) - float(model)) <= bound for heard, model in found)
