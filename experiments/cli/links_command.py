"""`volery links`: the resolved links of a scenario, and the presets."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated

from cyclopts import Parameter

from ...errors import BadInput
from ..scenario.link_groups import fault_words, link_groups, to_mapping
from ..scenario.presets import presets as all_presets
from .common_options import Overrides, ScenarioSource
from .output import output, print_plain
from .reading import read_scenario
from .scenario_tables import link_tables, preset_table

AsJson = Annotated[bool, Parameter("--json", help="Print JSON: groups of links, or presets, with all settings.")]
Every = Annotated[bool, Parameter("--all", help="List each link separately, instead of groups with the same settings.")]
Presets = Annotated[bool, Parameter(help="Show presets of well-known hardware instead, with the sources of numbers.")]


def links(
    scenario: ScenarioSource | None = None,
    /,
    *,
    all_: Every = False,
    json_: AsJson = False,
    presets: Presets = False,
    set_: Overrides = (),
) -> None:
    """Show the links of a scenario: medium, airtime, queue, loss, latency, and their faults."""
    if presets:
        _show_presets(json_)
        return
    if scenario is None:
        raise BadInput("which scenario? `volery list` shows the built-in ones, a file's name ends in .yaml")
    plan = read_scenario(scenario, set_).plan
    groups = link_groups(plan, every=all_)
    if json_:
        words = fault_words(plan)
        print_plain(json.dumps([to_mapping(group, words) for group in groups], indent=1, ensure_ascii=False))
        return
    for table in link_tables(plan, groups):
        output().print(table)


def _show_presets(as_json: bool) -> None:
    if as_json:
        print_plain(
            json.dumps({name: asdict(preset) for name, preset in all_presets().items()}, indent=1, ensure_ascii=False)
        )
        return
    for name, preset in all_presets().items():
        output().print(preset_table(name, preset))
