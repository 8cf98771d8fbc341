"""Runs as contestants: those that differ in nothing but their seed are repetitions of one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ..record.record import load
from ..record.run_files import SCENARIO_FILE
from ..scenario.load import load_scenario, resolved_yaml
from .significance import Entry
from .sweep_runs import Values, measure

RUN = "run"


def measured_runs(folders: Sequence[Path]) -> dict[str, tuple[int, str, Values]]:
    """Name of a run's folder → its seed, its scenario without the seed, and what was measured."""
    found = {}
    for folder in folders:
        scenario = load_scenario(folder / SCENARIO_FILE).scenario
        text = resolved_yaml(replace(scenario, seed=0))
        found[folder.resolve().name] = scenario.seed, text, measure(load(folder))
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
