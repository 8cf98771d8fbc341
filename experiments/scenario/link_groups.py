"""The resolved links of a plan, with identical links in groups."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...agents import registry
from ...agents.plan import Plan
from ...topologies import Span, natural_key
from ...transport.faults import LinkFault, LinkName
from ...transport.links import LinkSettings
from ...transport.media_settings import HalfDuplex, Tdma, on_air
from ...units import quantity
from .consistency import slots_of
from .dumping import settings as plain_settings
from .fault_labels import fault_label


@dataclass(frozen=True)
class LinkGroup:
    """Directed links with the same settings, largest payload, slots and faults.

    links: names of the links.
    settings: of each link.
    largest_payload: in bytes; None if the agent's kind does not declare it.
    slots: number of slots in a cycle; None without slots.
    slot: index of the own slot; None without slots, or if the links have different ones.
    faults: ids of the faults that touch the links.
    there: smallest and largest fraction of the run in which one of the links exists.
    """

    links: tuple[LinkName, ...]
    settings: LinkSettings
    largest_payload: int | None
    slots: int | None
    slot: int | None
    faults: tuple[str, ...]
    there: tuple[float, float]

    @property
    def airtime_ns(self) -> int | None:
        """Time on the air of the largest payload."""
        return None if self.largest_payload is None else self.settings.airtime_ns(self.largest_payload)


def link_groups(plan: Plan, *, every: bool = False) -> list[LinkGroup]:
    """The links of a plan in groups, in natural order of the first; `every`: one group a link."""
    payloads = {agent.name: registry.offer_of(plan, agent.name).largest_payload for agent in plan.agents}
    alike: dict[Any, list[LinkName]] = {}
    for link in sorted(plan.links, key=lambda link: (natural_key(link[0]), natural_key(link[1]))):
        faults = tuple(fault.id for fault in plan.faults if isinstance(fault, LinkFault) and link in fault.links)
        key = plan.links[link], payloads[link[0]], _slots(plan, link), faults, link in plan.presence
        alike.setdefault((key, link if every else None), []).append(link)
    return [
        LinkGroup(tuple(links), settings, payload, slots, _same_slot(plan, links), faults, _there(plan, links))
        for ((settings, payload, slots, faults, _), _), links in alike.items()
    ]


def _slots(plan: Plan, link: LinkName) -> int | None:
    medium = plan.links[link].medium
    return slots_of(plan, link) if isinstance(medium, HalfDuplex) and isinstance(medium.access, Tdma) else None


def _same_slot(plan: Plan, links: Sequence[LinkName]) -> int | None:
    """The common slot of these links, from 0; None if they differ or have none."""
    if _slots(plan, links[0]) is None:
        return None
    own = {
        plan.slots[source][0]
        if on_air(plan.links[source, target].medium)
        else int(natural_key(source) > natural_key(target))
        for source, target in links
    }
    return own.pop() if len(own) == 1 else None


def _there(plan: Plan, links: Iterable[LinkName]) -> tuple[float, float]:
    always: tuple[Span, ...] = ((0, plan.duration_ns),)
    parts = [sum(end - start for start, end in plan.presence.get(link, always)) / plan.duration_ns for link in links]
    return min(parts), max(parts)


def to_mapping(group: LinkGroup, faults: Mapping[str, str]) -> dict[str, Any]:
    """A group as plain data: settings as in a scenario, and quantities derived from them.

    Args:
        group: group of links.
        faults: id → description.
    """
    settings = group.settings
    return {
        "links": [">".join(link) for link in group.links],
        "settings": plain_settings(settings),
        "largest_payload": group.largest_payload,
        "airtime_ns": group.airtime_ns,
        "mean_loss": [_number(model.mean) for model in settings.loss],
        "mean_corruption": [_number(model.mean) for model in settings.corruption],
        "shortest_latency_ns": settings.latency.minimum_ns,
        "mean_latency_ns": _number(settings.latency.mean_ns),
        "slots": group.slots,
        "slot": group.slot,
        "there": list(group.there),
        "faults": {name: faults[name] for name in group.faults},
    }


def _number(value: float) -> float | None:
    """A number for JSON, which has no NaN."""
    return None if math.isnan(value) else value


def fault_words(plan: Plan) -> dict[str, str]:
    """Id → description of a link fault: what, where and when."""
    words = {}
    for fault in plan.faults:
        if isinstance(fault, LinkFault):
            until = "on" if fault.until_ns is None else f"to {quantity(fault.until_ns, 'ns')}"
            words[fault.id] = f"{fault_label(fault, len(plan.links))}, {quantity(fault.at_ns, 'ns')} {until}"
    return words
