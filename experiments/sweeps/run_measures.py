"""Runs as contestants: those that differ in nothing but their seed are repetitions of one."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..record.record import load
from ..record.run_files import SCENARIO_FILE
from .significance import Entry
from .sweep_runs import Values, measure

RUN = "run"
_SEED = re.compile(r"^seed:.*\n", re.MULTILINE)


def measured_runs(folders: Sequence[Path]) -> dict[str, tuple[int, str, Values]]:
    """Name of a run's folder → its seed, its scenario without the seed, and what was measured."""
    found = {}
    for folder in folders:
        record = load(folder)
        without_seed = _SEED.sub("", (folder / SCENARIO_FILE).read_text("utf-8"))
        found[folder.resolve().name] = record.plan.seed, without_seed, measure(record)
    return found


def entries_of_runs(found: Mapping[str, tuple[int, str, Values]], name: str) -> list[Entry]:
    """One entry for all runs that differ in their seed only, called by the first of them."""
    first: dict[str, str] = {}
    runs: Counter[str] = Counter()
    values: dict[str, dict[int, float]] = {}
    for run, (seed, text, measured) in found.items():
        label = first.setdefault(text, run)
        value = measured.get(name)
        values.setdefault(label, {}).update({} if value is None else {seed: value})
        runs[label] += 1
    return [Entry({RUN: label}, those, runs[label]) for label, those in values.items()]
