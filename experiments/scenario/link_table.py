"""The links of a plan as they are resolved: what every direction does with a frame, links that are alike together."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from typing import TYPE_CHECKING, Any

from ...agents import registry
from ...agents.plan import Plan
from ...topologies import Span, natural_key
from ...transport.faults import LinkFault, LinkName
from ...transport.latencies import LATENCIES
from ...transport.links import LinkSettings
from ...transport.losses import LOSSES, Loss
from ...transport.media import ACCESSES, FullDuplex, HalfDuplex, Tdma, on_air
from ...units import quantity
from .consistency import slots_of
from .dumping import settings as plain_settings
from .fault_labels import fault_label

if TYPE_CHECKING:
    from rich.table import Table

_NAMED = 6
_COLUMNS = 3
_OCTET = 8
_LISTED = 4
_OTHERWISE = {"there": "always", "corruption": "none", "order": "may overtake"}
"""What stands in a row for a group in which nothing is set, but for a dash."""


@dataclass(frozen=True)
class LinkGroup:
    """Directed links that are alike: settings, largest payload, faults, and how much of the run they are there.

    `largest_payload` is None where the agent's kind does not tell it. `slots`: how many share a cycle, `slot` the own
    one, from 0; None where there are none, or the links of the group have different ones. `there`: least and largest
    fraction of the run in which one of the links is there.
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
    """The links of a plan in groups that are alike, in natural order of the first; `every`: one each."""
    payloads = {agent.name: registry.find(agent.kind).offers(plan, agent.name).largest_payload for agent in plan.agents}
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
    """The slot that all of these have, from 0; None where they have several, or none."""
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


# -- as data ------------------------------------------------------------------------------------------------------


def to_mapping(group: LinkGroup, faults: Mapping[str, str]) -> dict[str, Any]:
    """A group as plain data: settings as a scenario has them, and what follows from them.

    Args:
        group: of links.
        faults: id → what it does, in words.
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
    """JSON knows no NaN."""
    return None if math.isnan(value) else value


# -- as tables ----------------------------------------------------------------------------------------------------


def link_tables(plan: Plan, groups: Sequence[LinkGroup]) -> Iterator[Table]:
    """The groups as tables, a column each; what is nowhere set has no row."""
    from rich.table import Table

    words = fault_words(plan)
    rows = [*_ROWS, ("faults", lambda group: _first([words[name] for name in group.faults]))]
    for shown in _batched(groups, _COLUMNS):
        table = Table(title=f"{plan.name}: {len(plan.links)} directed links", title_justify="left")
        table.add_column("links")
        for group in shown:
            table.add_column(_links(group, len(plan.links)))
        for name, cell in rows:
            cells = [cell(group) for group in shown]
            if any(cells):
                table.add_row(name, *(text or _OTHERWISE.get(name, "–") for text in cells))
        yield table


def _first(lines: Sequence[str]) -> str:
    """Some lines, and how many more."""
    more = [f"and {len(lines) - _NAMED} more"] if len(lines) > _NAMED else []
    return "\n".join([*lines[:_NAMED], *more])


def _batched(groups: Sequence[LinkGroup], size: int) -> Iterator[Sequence[LinkGroup]]:
    for start in range(0, len(groups), size):
        yield groups[start : start + size]


def fault_words(plan: Plan) -> dict[str, str]:
    """Id → what a fault of links does, where and when."""
    words = {}
    for fault in plan.faults:
        if isinstance(fault, LinkFault):
            until = "on" if fault.until_ns is None else f"to {quantity(fault.until_ns, 'ns')}"
            words[fault.id] = f"{fault_label(fault, len(plan.links))}, {quantity(fault.at_ns, 'ns')} {until}"
    return words


def _links(group: LinkGroup, total: int) -> str:
    links = set(group.links)
    if len(links) == total > 1:
        return f"all {total} links"
    names = []
    for source, target in group.links:
        if (target, source) not in links:
            names.append(f"{source}>{target}")
        elif natural_key(source) < natural_key(target):
            names.append(f"{source}-{target}")
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"{', '.join(names[:_NAMED])}{more}"


def _medium(group: LinkGroup) -> str:
    medium = group.settings.medium
    if isinstance(medium, FullDuplex):
        return "full-duplex"
    return f"half-duplex per {medium.per}, {_model(medium.access)}"


def _slot(group: LinkGroup) -> str:
    if group.slots is None:
        return ""
    return f"{group.slots} in a cycle" if group.slot is None else f"{group.slot + 1} of {group.slots}"


def _payload(group: LinkGroup) -> str:
    if group.largest_payload is None:
        return "unknown"
    airtime = (
        "" if group.settings.rate is None else f", {group.settings.airtime_ns(group.largest_payload) / 1e6:.3f} ms"
    )
    return f"{group.largest_payload} B{airtime} on the air"


def _rate(group: LinkGroup) -> str:
    settings = group.settings
    if settings.rate is None:
        return "unlimited, no airtime"
    bits = "" if settings.bits_per_byte == _OCTET else f", {settings.bits_per_byte} bits a byte"
    return f"{quantity(settings.rate, 'bit/s')}{bits}"


def _models(models: Sequence[Loss]) -> str:
    return "\n".join(f"{_model(model)}, mean {_percent(model.mean)}" for model in models)


def _percent(mean: float) -> str:
    return "varies" if math.isnan(mean) else f"{100 * mean:.3g} %"


def _latency(group: LinkGroup) -> str:
    latency = group.settings.latency
    least, mean = f"{latency.minimum_ns / 1e6:.4g} ms", f"{latency.mean_ns / 1e6:.4g} ms"
    return _model(latency) if least == mean else f"{_model(latency)}; shortest {least}, mean {mean}"


def _presence(group: LinkGroup) -> str:
    least, most = (f"{100 * part:.3g} %" for part in group.there)
    if group.there == (1.0, 1.0):
        return ""
    return f"{least} of the run" if least == most else f"{least} to {most} of the run"


def _bucket(group: LinkGroup) -> str:
    bucket = group.settings.bucket
    return "" if bucket is None else f"{quantity(bucket.rate, 'bit/s')}, {bucket.burst} B at once"


def _flags(group: LinkGroup) -> str:
    settings = group.settings
    said = (("cut", settings.cut), ("held back", settings.hold), ("absent", not settings.present))
    return ", ".join(word for word, holds in said if holds)


_ROWS: tuple[tuple[str, Callable[[LinkGroup], str]], ...] = (
    ("medium", _medium),
    ("slot", _slot),
    ("rate", _rate),
    ("largest payload", _payload),
    ("overhead", lambda group: f"{group.settings.overhead} B" if group.settings.overhead else ""),
    ("MTU", lambda group: f"{group.settings.mtu} B"),
    ("queue", lambda group: f"{group.settings.queue.limit} frames, {group.settings.queue.policy}"),
    ("bucket", _bucket),
    ("loss", lambda group: _models(group.settings.loss) or "none"),
    ("corruption", lambda group: _models(group.settings.corruption)),
    ("duplication", lambda group: _percent(group.settings.duplication) if group.settings.duplication else ""),
    ("latency", _latency),
    ("order", lambda group: "" if group.settings.reordering else "kept"),
    (
        "paired",
        lambda group: "" if group.settings.paired is None else f"slots of {quantity(group.settings.paired, 'ns')}",
    ),
    ("there", _presence),
    ("state", _flags),
)


def _model(model: Any) -> str:
    """A model as one line: its name, and its fields that are not at their default."""
    kinds = next(kinds for kinds in (LOSSES, LATENCIES, ACCESSES) if type(model) in kinds.classes())
    name, body = kinds.name_of(type(model)), plain_settings(model)
    own = [field for field in fields(model) if field.default is MISSING or getattr(model, field.name) != field.default]
    words = [_value(body[field.name]) for field in own]
    if len(own) > 1 or any(field is not fields(model)[0] for field in own):
        words = [f"{field.name}={word}" for field, word in zip(own, words, strict=True)]
    return " ".join([name, *words])


def _value(value: Any) -> str:
    if isinstance(value, list):
        return f"[{','.join(map(_value, value))}]" if len(value) <= _LISTED else f"{len(value)} values"
    return f"{value:.6g}" if isinstance(value, float) else str(value).replace(" ", "")
