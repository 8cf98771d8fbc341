"""How a quantity is declared, and where its covariance is found."""

from __future__ import annotations

import re
import subprocess
import sys
from typing import Any

import pytest

from volery.errors import BadInput
from volery.quantities import Quantity, covariance_name, declared

POSE = Quantity("pose", is_shared=False, covariance="spread")


def test_what_is_declared_first_counts() -> None:
    """A quantity of another name is a plain estimate that all agents share."""
    assert declared("pose", (POSE, Quantity("pose"))) is POSE
    assert declared("speed", (POSE,)) == Quantity("speed")


def test_a_covariance_is_a_diagnostic() -> None:
    """Under the name that a report writes it down under, and under a name that a quantity declares."""
    assert declared(covariance_name("speed"), ()).role == "diagnostic"
    assert declared("spread", (POSE,)).role == "diagnostic"
    assert POSE.covariance_quantity == "spread"
    assert Quantity("speed").covariance_quantity == covariance_name("speed")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"role": "estimation"},
            "quantity 'x': role is 'estimation': it must be one of estimate, innovation, diagnostic",
        ),
        ({"components": ("x", "y")}, "quantity 'x': 'x' is no component: write Component('x', unit)"),
        ({"difference_components": ["angle"]}, "quantity 'x': 'angle' is no component"),
    ],
)
def test_what_cannot_be_declared_is_refused(fields: dict[str, Any], message: str) -> None:
    """Where it is declared, so that the error comes with the user's line."""
    with pytest.raises(BadInput, match=f"^{re.escape(message)}"):
        Quantity("x", **fields)


def test_a_declaration_loads_neither_experiments_nor_pydantic() -> None:
    """So that worlds and agents may declare quantities."""
    program = "import sys, volery.quantities; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert "volery.quantities" in loaded
    assert "pydantic" not in loaded
    assert "volery.experiments" not in loaded
