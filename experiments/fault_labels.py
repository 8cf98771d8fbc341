"""Short names of faults for figures and tables: "cut 3–7", "loss 0.5 all", "kill 5"."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from ..topologies import natural_key
from ..transport.faults import Fault, Kill, LinkFault, LinkName

_NAMED = 2


def fault_label(fault: Fault, link_count: int) -> str:
    """What a fault does and where; `link_count` is the number of directed links in all."""
    if isinstance(fault, LinkFault):
        return f"{', '.join(_change(*change) for change in fault.changes.items())} {_place(fault.links, link_count)}"
    return f"{'kill' if isinstance(fault, Kill) else 'pause'} {fault.agent}"


def in_words(faults: Mapping[str, Fault], link_count: int) -> dict[str, str]:
    """Faults by id, each as its short name."""
    return {name: fault_label(fault, link_count) for name, fault in faults.items()}


def _change(name: str, value: Any) -> str:
    if name == "cut":
        return "cut" if value else "not cut"
    if name == "rate":
        return "rate unlimited" if value is None else f"rate {value / 1e3:g} kbit/s"
    models = value if isinstance(value, tuple) else (value,)
    return f"{name} {' + '.join(_model(name, model) for model in models) or 'none'}"


def _model(name: str, model: Any) -> str:
    """The first numbers of a model, defaults left out, those of a latency in milliseconds; another value as it is."""
    if not is_dataclass(model):
        return str(model)
    told = [field for field in fields(model)[:_NAMED] if getattr(model, field.name) != field.default]
    numbers = [getattr(model, field.name) for field in told]
    return ", ".join(f"{number / 1e6:g} ms" if name == "latency" else f"{number:g}" for number in numbers)


def _place(links: tuple[LinkName, ...], link_count: int) -> str:
    if len(links) == link_count:
        return "all"
    both = {frozenset(link) for link in links if link[::-1] in links}
    names = ["–".join(sorted(edge, key=natural_key)) for edge in both]
    names += [f"{source}→{target}" for source, target in links if frozenset((source, target)) not in both]
    names.sort(key=natural_key)
    return ", ".join(names) if len(names) <= _NAMED else f"{len(names)} links"
