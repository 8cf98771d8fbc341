"""The command about the links of a scenario."""

from __future__ import annotations

import json
from typing import Annotated

from cyclopts import Parameter

from .cli_output import output, print_plain
from .cli_parameters import Overrides, ScenarioSource
from .link_table import fault_words, link_groups, link_tables, to_mapping
from .scenario import compile_plan, load_scenario

AsJson = Annotated[bool, Parameter("--json", help="Print a JSON list of the groups, with every setting.")]
Every = Annotated[bool, Parameter("--all", help="List each link on its own, instead of those that are alike together.")]


def links(scenario: ScenarioSource, /, *, all_: Every = False, json_: AsJson = False, set_: Overrides = ()) -> None:
    """Show the links of a scenario as they are resolved: medium, airtime, queue, loss, latency, and their faults."""
    plan = compile_plan(load_scenario(scenario, set_))
    groups = link_groups(plan, every=all_)
    if json_:
        words = fault_words(plan)
        print_plain(json.dumps([to_mapping(group, words) for group in groups], indent=1, ensure_ascii=False))
        return
    for table in link_tables(plan, groups):
        output().print(table)
