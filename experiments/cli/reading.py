"""Reading of a scenario by a command."""

from __future__ import annotations

from collections.abc import Sequence

from ..scenario.load import LoadedScenario, load_scenario
from .output import print_note


def read_scenario(source: str, overrides: Sequence[str]) -> LoadedScenario:
    """The scenario and its plan; prints notes on parts that are not in the plan.

    Raises:
        BadInput: as `load_scenario`.
    """
    read = load_scenario(source, overrides)
    for note in read.notes:
        print_note(f"note: {note}")
    return read
