"""The plan in a run's folder."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.record.plan_file import read_plan, write_plan
from volery.experiments.scenario.load import load_scenario


@dataclass(frozen=True, eq=False)
class Recording:
    """Parameters with arrays."""

    rows: NDArray[np.float64]
    again: NDArray[np.float64]


def plan_of(rows: Any, again: Any) -> Plan:
    """A plan whose first agent has arrays."""
    plan = load_scenario("dfa4").plan
    return replace(plan, agents=(replace(plan.agents[0], parameters=Recording(rows, again)), *plan.agents[1:]))


def test_large_arrays_lie_beside_the_plan_once(tmp_path: Path) -> None:
    """In a file that is named by their hash, small ones in the text; a damaged file is noticed."""
    large = np.arange(20_000.0).reshape(100, 200)
    write_plan(tmp_path, plan_of(large, large.copy()))
    (file,) = tmp_path.glob("plan-*.bin")
    assert file.read_bytes() == large.tobytes()
    found = read_plan(tmp_path).agents[0].parameters
    assert (found.rows.shape, found.rows.tobytes()) == (large.shape, large.tobytes())
    assert found.again.flags.writeable
    file.write_bytes(bytes(len(large.tobytes())))
    with pytest.raises(BadInput, match=r"plan-.*\.bin is damaged"):
        read_plan(tmp_path)
    file.unlink()
    with pytest.raises(BadInput, match=r"plan-.*\.bin cannot be read: No such file"):
        read_plan(tmp_path)


def test_small_arrays_stand_in_the_text(tmp_path: Path) -> None:
    """No other file is written."""
    write_plan(tmp_path, plan_of(np.zeros(3), np.ones(3)))
    assert [path.name for path in tmp_path.iterdir()] == ["plan.json"]


def test_folders_of_an_older_form_are_told_apart(tmp_path: Path) -> None:
    """With which volery to read them; a folder that is no run is another thing."""
    with pytest.raises(BadInput, match=r"plan\.json cannot be read: No such file"):
        read_plan(tmp_path)
    (tmp_path / "scenario.yaml").write_text("name: old\n", "utf-8")
    with pytest.raises(
        BadInput, match=r"older form, which keeps its scenario and no plan: .* commit 93240e7 or before"
    ):
        read_plan(tmp_path)
