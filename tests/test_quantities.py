"""How a quantity is declared, and where its covariance is found."""

from __future__ import annotations

import subprocess
import sys

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


def test_a_declaration_loads_neither_experiments_nor_pydantic() -> None:
    """So that worlds and agents may declare quantities."""
    program = "import sys, volery.quantities; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert "volery.quantities" in loaded
    assert "pydantic" not in loaded
    assert "volery.experiments" not in loaded
