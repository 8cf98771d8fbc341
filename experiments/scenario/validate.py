"""The load of a plan on its media and on the machine: airtime utilisation, puts per second, slack."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ...agents import registry
from ...agents.plan import Plan
from ...errors import BadInput
from ...names import first_of
from ...topologies import natural_key
from ...transport.faults import LinkName
from ...transport.links import LinkSettings
from ...transport.media_settings import ACCESSES, HalfDuplex, Tdma, on_air
from .consistency import slots_of
from .fault_conflicts import ineffective_faults
from .graph_changes import GraphChanges, graph_changes

_NAMED = 4


@dataclass(frozen=True)
class MediumUse:
    """The load of one medium, before faults.

    medium: a direction `3>7`, an edge `3-7` whose directions share the medium, or the air at an agent, `air 3`, which
        its own radio and those of its neighbours share.
    access: kind of medium access.
    airtime_ns: airtime of the largest frame.
    frames_per_second: frames in a second; None if the agent's kind does not declare it.
    utilisation: used fraction of what the medium can carry; None if the agent's kind does not declare it.
    """

    medium: str
    access: str
    airtime_ns: int
    frames_per_second: float | None
    utilisation: float | None


@dataclass(frozen=True)
class Validation:
    """The load of a plan.

    name: name of the scenario.
    agents: number of agents.
    rows: load of each medium.
    puts_per_second: frames of all links in a second; None if unknown.
    largest_payload: in bytes; None if unknown.
    slack_ns: shortest time of all links that the machine has from an event to the arrival of the frame that it causes.
    graph: changes of the graph; None if it does not change.
    notes: sentences about faults without effect.
    """

    name: str
    agents: int
    rows: tuple[MediumUse, ...]
    puts_per_second: float | None
    largest_payload: int | None
    slack_ns: int
    graph: GraphChanges | None = None
    notes: tuple[str, ...] = ()

    @property
    def overloaded(self) -> tuple[MediumUse, ...]:
        """Media that are offered more than they can carry."""
        return tuple(row for row in self.rows if row.utilisation is not None and row.utilisation > 1)


def validate_plan(plan: Plan, overload: bool = False) -> Validation:
    """The load of a plan.

    Raises:
        BadInput: a medium is offered more than it can carry, and `overload` is false.
    """
    offers = {agent.name: registry.offer_of(plan, agent.name) for agent in plan.agents}
    payloads = {name: offer.largest_payload for name, offer in offers.items()}
    rates = {name: offer.per_second for name, offer in offers.items()}
    declared = [payload for payload in payloads.values() if payload is not None]
    compute = {agent.name: agent.compute_ns for agent in plan.agents}
    validation = Validation(
        plan.name,
        len(plan.agents),
        tuple(_rows(plan, payloads, rates)),
        _total([rates[source] for source, _ in plan.links]),
        max(declared, default=None),
        min(compute[source] + settings.lookahead_ns() for (source, _), settings in plan.links.items()),
        graph_changes(plan),
        tuple(ineffective_faults(plan)),
    )
    if validation.overloaded and not overload:
        raise BadInput(_overload_message(validation.overloaded))
    return validation


def _rows(plan: Plan, payloads: dict[str, int | None], rates: dict[str, float | None]) -> Iterator[MediumUse]:
    def use(link: LinkName, settings: LinkSettings) -> tuple[int, float | None]:
        payload, rate = payloads[link[0]], rates[link[0]]
        return settings.airtime_ns(payload or 0), rate if payload is not None or rate == 0 else None

    for link, settings in plan.links.items():
        airtime, rate = use(link, settings)
        medium, name = settings.medium, ">".join(link)
        if on_air(medium):
            continue
        if not isinstance(medium, HalfDuplex):
            yield MediumUse(name, "full-duplex", airtime, rate, _times(rate, airtime / 1e9))
        elif isinstance(medium.access, Tdma):
            yield MediumUse(name, "tdma", airtime, rate, _times(rate, _slot_share(plan, link, medium.access, airtime)))
        elif natural_key(link[0]) < natural_key(link[1]):
            back, back_rate = use(link[::-1], plan.links[link[::-1]])
            shares = [_times(rate, airtime / 1e9), _times(back_rate, back / 1e9)]
            name = ACCESSES.name_of(type(medium.access))
            yield MediumUse("-".join(link), name, max(airtime, back), _total([rate, back_rate]), _total(shares))
    yield from _air_rows(plan, use)


def _slot_share(plan: Plan, link: LinkName, access: Tdma, airtime_ns: int) -> float:
    """The share of its own slots that one frame a second takes."""
    fits = access.usable_ns(slots_of(plan, link)) // airtime_ns if airtime_ns else None
    return 0.0 if fits is None else 1 / (fits * access.cycle)


def _air_rows(plan: Plan, use: Callable[[LinkName, LinkSettings], tuple[int, float | None]]) -> Iterator[MediumUse]:
    """The load of the air at each agent with a radio; with TDMA that of its own slots."""
    radios: dict[str, tuple[int, float | None]] = {}
    near: dict[str, list[LinkName]] = {}
    for link, settings in plan.links.items():
        if on_air(settings.medium):
            near.setdefault(link[0], []).append(link)
    for source, links in near.items():
        agent = plan.agent(source)
        airtime, rate = use(links[0], plan.links[links[0]])
        once = registry.find(agent.kind).broadcasts(agent.parameters)
        radios[source] = airtime, _times(rate, 1 if once else len(links))
    for source, links in near.items():
        medium = plan.links[links[0]].medium
        assert isinstance(medium, HalfDuplex)
        airtime, rate = radios[source]
        audible = [radios[name] for name in (source, *(target for _, target in links))]
        if isinstance(medium.access, Tdma):
            used = _times(rate, _slot_share(plan, links[0], medium.access, airtime))
        else:
            used = _total([_times(each, long / 1e9) for long, each in audible])
        yield MediumUse(f"air {source}", ACCESSES.name_of(type(medium.access)), airtime, rate, used)


def _times(rate: float | None, seconds: float) -> float | None:
    return None if rate is None else rate * seconds


def _total(parts: list[float | None]) -> float | None:
    known = [part for part in parts if part is not None]
    return sum(known) if len(known) == len(parts) else None


def _overload_message(rows: tuple[MediumUse, ...]) -> str:
    worst = sorted(rows, key=lambda row: -(row.utilisation or 0))
    named = first_of([f"{row.medium} {row.utilisation:.0%}" for row in worst], _NAMED)
    return (
        f"airtime utilisation is above 100 % on {named}: "
        "send less or less often, raise links.rate, or write overload: true"
    )
