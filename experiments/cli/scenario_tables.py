"""Links, presets and the load of a scenario, as tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any

from rich.table import Table

from ...agents.plan import Plan
from ...names import first_of
from ...topologies import natural_key
from ...transport.latency_settings import LATENCIES
from ...transport.link_models import Loss
from ...transport.loss_settings import LOSSES
from ...transport.media_settings import ACCESSES, FullDuplex
from ...units import quantity
from ..scenario.dumping import settings as plain_settings
from ..scenario.link_groups import LinkGroup, fault_words
from ..scenario.presets import Preset
from ..scenario.validate import Validation

_NAMED = 6
_COLUMNS = 3
_OCTET = 8
_LISTED = 4
_OTHERWISE = {"there": "always", "corruption": "none", "order": "may overtake"}
"""Cells of a row for a group without this setting, where these are not a dash."""


def link_tables(plan: Plan, groups: Sequence[LinkGroup]) -> Iterator[Table]:
    """The groups as tables, a column each; settings that no group has are left out."""
    words = fault_words(plan)
    rows = [*_ROWS, ("faults", lambda group: _first([words[name] for name in group.faults]))]
    for start in range(0, len(groups), _COLUMNS):
        shown = groups[start : start + _COLUMNS]
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
    """The first lines, and how many more."""
    more = [f"and {len(lines) - _NAMED} more"] if len(lines) > _NAMED else []
    return "\n".join([*lines[:_NAMED], *more])


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
    return first_of(names, _NAMED)


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


def _milliseconds(mean_ns: float) -> str:
    return "varies" if math.isnan(mean_ns) else f"{mean_ns / 1e6:.4g} ms"


def _percent(mean: float) -> str:
    return "varies" if math.isnan(mean) else f"{100 * mean:.3g} %"


def _latency(group: LinkGroup) -> str:
    latency = group.settings.latency
    least, mean = f"{latency.minimum_ns / 1e6:.4g} ms", _milliseconds(latency.mean_ns)
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
    states = (("cut", settings.cut), ("held back", settings.hold), ("absent", not settings.present))
    return ", ".join(word for word, holds in states if holds)


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
    """A model as one line: its name and the fields that are not defaults."""
    names = {cls: name for kinds in (LOSSES, LATENCIES, ACCESSES) for name, cls in kinds.built_in.items()}
    name, body = names.get(type(model)) or model.import_string, plain_settings(model)
    own = [field for field in fields(model) if field.default is MISSING or getattr(model, field.name) != field.default]
    words = [_value(body[field.name]) for field in own]
    if len(own) > 1 or any(field is not fields(model)[0] for field in own):
        words = [f"{field.name}={word}" for field, word in zip(own, words, strict=True)]
    return " ".join([name, *words])


def _value(value: Any) -> str:
    if isinstance(value, list):
        return f"[{','.join(map(_value, value))}]" if len(value) <= _LISTED else f"{len(value)} values"
    return f"{value:.6g}" if isinstance(value, float) else str(value).replace(" ", "")


# -- presets ------------------------------------------------------------------------------------------------------


def preset_table(name: str, preset: Preset) -> Table:
    """A preset as a table: its fields and the sources of their numbers."""
    table = Table(
        title=f"{name}: {preset.about}",
        title_justify="left",
        caption=f"Not in it: {preset.missing[0].lower()}{preset.missing[1:]}",
        caption_justify="left",
    )
    for column in ("field", "value", "source"):
        table.add_column(column)
    for field, value in preset.links.items():
        table.add_row(field, _flow(value), preset.sources[field])
    return table


def _flow(value: Any) -> str:
    """A value in YAML on one line."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {_flow(item)}' for key, item in value.items())}}}"
    return str(value)


# -- what a scenario asks for -------------------------------------------------------------------------------------


def validation_table(validation: Validation) -> Table:
    """The load of a plan as a table: a row per medium, totals, and notes on the graph and on faults."""
    table = Table(title=f"{validation.name}: load", show_footer=True)
    puts = "unknown" if validation.puts_per_second is None else f"{validation.puts_per_second:.4g}"
    largest = "unknown" if validation.largest_payload is None else f"{validation.largest_payload} B"
    notes = [*validation.notes] if validation.graph is None else [str(validation.graph), *validation.notes]
    if notes:
        table.caption, table.caption_justify = "\n".join(notes), "left"
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
