"""Commands for scenarios: show, new, validate."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.syntax import Syntax

from ...errors import BadInput
from ..scenario.library import find_source
from ..scenario.load import (
    json_schema,
    load_scenario,
    new_scenario_text,
    resolved_yaml,
)
from ..scenario.validate import validate_plan
from .common_options import Overrides, ScenarioSource
from .output import output, print_plain
from .reading import read_scenario
from .scenario_tables import validation_table

Resolved = Annotated[bool, Parameter(help="With all defaults and overrides.")]
NewName = Annotated[str, Parameter(help="Name of the scenario; writes NAME.yaml, and overwrites no file.")]
AsSchema = Annotated[bool, Parameter(help="Print the JSON Schema of scenario files instead, for editors.")]


def show(scenario: ScenarioSource, /, *, resolved: Resolved = False, set_: Overrides = ()) -> None:
    """Print the YAML of a scenario."""
    if set_ and not resolved:
        raise BadInput("--set changes what is run, not what the file says: add --resolved to see the outcome")
    text = resolved_yaml(read_scenario(scenario, set_).scenario) if resolved else find_source(scenario).text
    console = output()
    if console.is_terminal:
        console.print(Syntax(text, "yaml", background_color="default", word_wrap=True))
    else:
        print_plain(text.rstrip("\n"))


def new(name: NewName, /) -> None:
    """Write a commented scenario to start from."""
    path = Path(name).with_name(f"{Path(name).name.removesuffix('.yaml')}.yaml")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(new_scenario_text(path.stem))
    except FileExistsError:
        raise BadInput(f"{path} exists already: choose another name, no file is overwritten") from None
    except OSError as error:
        raise BadInput(f"{path}: cannot be written: {error.strerror}") from error
    try:
        load_scenario(path)
    except BadInput:
        path.unlink()
        raise
    print_plain(f"{path} is written; `volery validate {path}` checks it, `volery run {path}` runs it")


def validate(scenario: ScenarioSource | None = None, /, *, set_: Overrides = (), schema: AsSchema = False) -> None:
    """Check a scenario and show the load of its media: airtime utilisation, frames per second."""
    if schema:
        print_plain(json.dumps(json_schema(), indent=2, ensure_ascii=False))
        return
    if scenario is None:
        raise BadInput("which scenario? `volery list` shows the built-in ones, a file's name ends in .yaml")
    read = read_scenario(scenario, set_)
    output().print(validation_table(validate_plan(read.plan, read.scenario.overload)))
