"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

RUNS = Path("runs")
"""Where runs are, unless --runs says otherwise."""

ScenarioSource = Annotated[str, Parameter(help="Name of a built-in scenario, or path of a YAML file.")]
Overrides = Annotated[
    tuple[str, ...],
    Parameter("--set", help="Set a field, e.g. links.loss.bernoulli=0.3; may be given several times, the later wins."),
]
RunName = Annotated[str, Parameter(help="A folder, its name in --runs, or last.")]
SwarmName = Annotated[
    str | None, Parameter(help="A folder, its name in --runs, or last; by default the newest that runs.")
]
RunsFolder = Annotated[Path, Parameter("--runs", help="Folder of runs.")]
