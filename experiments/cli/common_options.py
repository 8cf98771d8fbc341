"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

RUNS = Path("runs")
"""Default folder of runs."""

ScenarioSource = Annotated[str, Parameter(help="Name of a built-in scenario, or path of a YAML file.")]
Overrides = Annotated[
    tuple[str, ...],
    Parameter("--set", help="Set a field: links.loss.bernoulli=0.3, 'duration=5 s'; repeatable, the last one counts."),
]
RunName = Annotated[str, Parameter(help="A run: its folder, its name in --runs, or last.")]
SwarmName = Annotated[
    str | None, Parameter(help="A run: its folder, its name in --runs, or last; by default the newest running one.")
]
RunsFolder = Annotated[Path, Parameter("--runs", help="Folder with the runs.")]
