"""What a plan asks of its media and of the machine: airtime utilisation, puts per second, slack."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..agents import registry
from ..agents.plan import Plan
from ..errors import BadInput
from ..topologies import natural_key
from ..transport.faults import LinkName
from ..transport.links import LinkSettings
from ..transport.media import EDGE_SLOTS, HalfDuplex, Tdma

if TYPE_CHECKING:
    from rich.table import Table

_NAMED = 4


@dataclass(frozen=True)
class MediumUse:
    """What one medium carries, before faults.

    `medium` is a direction `3>7`, or an edge `3-7` whose directions share the air; `frames_per_second` and
    `utilisation`, a fraction of what the medium can carry, are None where the agent's kind does not tell.
    """

    medium: str
    access: str
    airtime_ns: int
    frames_per_second: float | None
    utilisation: float | None


@dataclass(frozen=True)
class Validation:
    """What a plan asks for. `slack_ns` is the time that the hardest pressed link leaves to the machine."""

    name: str
    agents: int
    rows: tuple[MediumUse, ...]
    puts_per_second: float | None
    largest_payload: int | None
    slack_ns: int

    @property
    def overloaded(self) -> tuple[MediumUse, ...]:
        """Media that are asked for more than they can carry."""
        return tuple(row for row in self.rows if row.utilisation is not None and row.utilisation > 1)


def validate_plan(plan: Plan, overload: bool = False) -> Validation:
    """What a plan asks for.

    Raises:
        BadInput: a medium would be used for more than all of its time, and `overload` is false.
    """
    payloads = {agent.name: registry.find(agent.kind).largest_payload(agent.parameters) for agent in plan.agents}
    rates = {agent.name: registry.find(agent.kind).sends_per_second(agent.parameters) for agent in plan.agents}
    told = [payload for payload in payloads.values() if payload is not None]
    compute = {agent.name: agent.compute_ns for agent in plan.agents}
    validation = Validation(
        plan.name,
        len(plan.agents),
        tuple(_rows(plan, payloads, rates)),
        _total([rates[source] for source, _ in plan.links]),
        max(told, default=None),
        min(compute[source] + settings.lookahead_ns() for (source, _), settings in plan.links.items()),
    )
    if validation.overloaded and not overload:
        raise BadInput(_overload_message(validation.overloaded))
    return validation


def _rows(plan: Plan, payloads: dict[str, int | None], rates: dict[str, float | None]) -> Iterator[MediumUse]:
    def use(link: LinkName, settings: LinkSettings) -> tuple[int, float | None]:
        return settings.airtime_ns(payloads[link[0]] or 0), rates[link[0]] if payloads[link[0]] is not None else None

    for link, settings in plan.links.items():
        airtime, rate = use(link, settings)
        medium, name = settings.medium, ">".join(link)
        if not isinstance(medium, HalfDuplex):
            yield MediumUse(name, "full-duplex", airtime, rate, _times(rate, airtime / 1e9))
        elif isinstance(medium.access, Tdma):
            fits = medium.access.usable_ns(EDGE_SLOTS) // airtime if airtime else None
            share = 0.0 if fits is None else 1 / (fits * medium.access.cycle)
            yield MediumUse(name, "tdma", airtime, rate, _times(rate, share))
        elif natural_key(link[0]) < natural_key(link[1]):
            back, back_rate = use(link[::-1], plan.links[link[::-1]])
            shares = [_times(rate, airtime / 1e9), _times(back_rate, back / 1e9)]
            yield MediumUse("-".join(link), "aloha", max(airtime, back), _total([rate, back_rate]), _total(shares))


def _times(rate: float | None, seconds: float) -> float | None:
    return None if rate is None else rate * seconds


def _total(parts: list[float | None]) -> float | None:
    told = [part for part in parts if part is not None]
    return sum(told) if len(told) == len(parts) else None


def _overload_message(rows: tuple[MediumUse, ...]) -> str:
    worst = sorted(rows, key=lambda row: -(row.utilisation or 0))[:_NAMED]
    named = ", ".join(f"{row.medium} {row.utilisation:.0%}" for row in worst)
    more = f" and {len(rows) - len(worst)} more" if len(rows) > len(worst) else ""
    return (
        f"airtime utilisation is above 100 % on {named}{more}: "
        "send less or less often, raise links.rate, or write overload: true"
    )


def validation_table(validation: Validation) -> Table:
    """The validation as a table: a row per medium, the totals below."""
    from rich.table import Table

    table = Table(title=f"{validation.name}: what it asks for", show_footer=True)
    puts = "unknown" if validation.puts_per_second is None else f"{validation.puts_per_second:.4g}"
    largest = "unknown" if validation.largest_payload is None else f"{validation.largest_payload} B"
    table.add_column("medium", f"{validation.agents} agents")
    table.add_column("access", f"largest payload {largest}")
    table.add_column("airtime", f"slack {validation.slack_ns / 1e6:.3f} ms", justify="right")
    table.add_column("frames/s", f"{puts} puts/s", justify="right")
    table.add_column("utilisation", "", justify="right")
    for row in validation.rows:
        rate = "unknown" if row.frames_per_second is None else f"{row.frames_per_second:.4g}"
        used = "unknown" if row.utilisation is None else f"{row.utilisation:.1%}"
        style = "bold red" if row in validation.overloaded else None
        table.add_row(row.medium, row.access, f"{row.airtime_ns / 1e6:.3f} ms", rate, used, style=style)
    return table
