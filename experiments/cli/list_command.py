"""The command `volery list`."""

from __future__ import annotations

from rich.table import Table

from ..scenario.library import builtin_scenarios
from .output import output


def list_scenarios() -> None:
    """List the built-in scenarios."""
    table = Table(title="Scenarios", title_justify="left")
    for column in ("name", "paper", "what it shows"):
        table.add_column(column, no_wrap=column == "name")
    for scenario in builtin_scenarios():
        table.add_row(scenario.name, scenario.paper, scenario.description)
    output().print(table)
