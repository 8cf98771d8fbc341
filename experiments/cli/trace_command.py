"""`volery trace`: the fates of frames of a run, line by line."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from ...errors import BadInput
from ..analysis.frame_trace import SELECTABLE, Selection, agents_of, trace
from ..record.record import Record, load
from ..scenario.fault_places import parse_links, places_of
from .common_options import RUNS, RunName, RunsFolder
from .folders import finished_run
from .output import print_lines, print_note
from .window import WHOLE, SpanOptions, known

_LINK = "Only these links, separated by commas: 3-7 (both directions), '3>7' (one)."
_AGENT = "Only frames, faults and deaths of these agents, separated by commas."
_FATE = f"Only frames with these fates, separated by commas: {', '.join(SELECTABLE)} (any loss)."
Links = Annotated[tuple[str, ...], Parameter("--link", help=_LINK)]
Agents = Annotated[tuple[str, ...], Parameter("--agent", help=_AGENT)]
Fates = Annotated[tuple[str, ...], Parameter("--fate", help=_FATE)]
Limit = Annotated[int | None, Parameter("--limit", help="Largest number of lines, from the beginning.")]
AsJson = Annotated[bool, Parameter("--json", help="Print one JSON object a line, with times in nanoseconds.")]


@Parameter(name="*")
@dataclass(frozen=True)
class Filters:
    """The lines to print."""

    link: Links = ()
    agent: Agents = ()
    fate: Fates = ()

    def select(self, record: Record, span: SpanOptions) -> Selection:
        """The selection of frames of a run.

        Raises:
            BadInput: a link, agent or fate that does not exist, or a span that does not fit.
        """
        from_ns, until_ns = span.bounds(record)
        return Selection(
            frozenset(parse_links(self.link, places_of(record.plan))) if self.link else None,
            frozenset(known("--agent", self.agent, agents_of(record))) if self.agent else None,
            frozenset(known("--fate", self.fate, SELECTABLE)) if self.fate else None,
            from_ns or 0,
            until_ns,
        )


ALL = Filters()


def trace_run(
    run: RunName,
    /,
    *,
    filters: Filters = ALL,
    span: SpanOptions = WHOLE,
    limit: Limit = None,
    json_: AsJson = False,
    runs: RunsFolder = RUNS,
) -> None:
    """Print the fates of the frames of a run in the order of time, with faults and deaths in between."""
    if limit is not None and limit < 1:
        raise BadInput(f"--limit {limit}: at least one line must be wanted")
    record = load(finished_run(run, runs))
    entries = trace(record, filters.select(record, span))
    shown = entries[:limit]
    print_lines(json.dumps(entry.values) if json_ else str(entry) for entry in shown)
    if not entries:
        print_note("nothing of this run is so: leave out a filter, or ask for a longer span")
    elif len(shown) < len(entries):
        print_note(f"… and {len(entries) - len(shown):,} more lines")
