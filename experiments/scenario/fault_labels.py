"""Short names of faults for figures and tables: "cut 3–7", "loss 0.5 all", "kill 5", "clock 5 +20 ms"."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from ...agents.plan_codec import Opaque
from ...topologies import natural_key
from ...transport.faults import ClockFault, Fault, Hog, Kill, LinkFault, LinkName, Pause, SensorFault
from ...transport.link_models import OwnModel

_NAMED = 2
_PPM = 1_000


def fault_label(fault: Fault, link_count: int) -> str:
    """What a fault does and where; `link_count`: number of all directed links."""
    match fault:
        case LinkFault():
            changes = ", ".join(_change(*change) for change in fault.changes.items())
            return f"{changes} {_place(fault.links, link_count)}"
        case Kill():
            return f"kill {fault.agent}{', state kept' if fault.keep_state else ''}"
        case Pause():
            return f"pause {fault.agent}"
        case Hog():
            return f"hog {fault.agent} {fault.share:.0%}"
        case ClockFault():
            return f"clock {fault.agent} {_clock(fault)}"
        case SensorFault():
            return f"{fault.agent}.{fault.sensor} {_trouble(fault)}"


def in_words(faults: Mapping[str, Fault], link_count: int) -> dict[str, str]:
    """Id → short name of a fault."""
    return {name: fault_label(fault, link_count) for name, fault in faults.items()}


def _change(name: str, value: Any) -> str:
    if name in ("cut", "hold"):
        return name if value else f"no {name}"
    if name == "rate":
        return "rate unlimited" if value is None else f"rate {value / 1e3:g} kbit/s"
    models = value if isinstance(value, tuple) else (value,)
    return f"{name} {' + '.join(_model(name, model) for model in models) or 'none'}"


def _model(name: str, model: Any) -> str:
    """The first numbers of a model that are not defaults, in milliseconds for latencies; other values as text.

    Of a user's own model its class, as the units of its fields are not known.
    """
    if isinstance(model, OwnModel | Opaque):
        return (model.name if isinstance(model, Opaque) else model.import_string).rpartition(":")[2]
    if not is_dataclass(model):
        return str(model)
    shown = [field for field in fields(model)[:_NAMED] if getattr(model, field.name) != field.default]
    numbers = [getattr(model, field.name) for field in shown]
    return ", ".join(f"{number / 1e6:g} ms" if name == "latency" else f"{number:g}" for number in numbers)


def _clock(fault: ClockFault) -> str:
    offset = f"{fault.offset_ns / 1e6:+g} ms" if fault.offset_ns else ""
    drift = f"{fault.drift_ppb / _PPM:+g} ppm" if fault.drift_ppb else ""
    return ", ".join(filter(None, (offset, drift)))


def _trouble(fault: SensorFault) -> str:
    sizes = ", ".join(f"{size:g}" for size in fault.size)
    often = f", {fault.probability:.3g} of samples" if fault.trouble == "spikes" else ""
    return f"{fault.trouble}{f' {sizes}' if sizes else ''}{often}"


def _place(links: tuple[LinkName, ...], link_count: int) -> str:
    if len(links) == link_count:
        return "all"
    both = {frozenset(link) for link in links if link[::-1] in links}
    names = ["–".join(sorted(edge, key=natural_key)) for edge in both]
    names += [f"{source}→{target}" for source, target in links if frozenset((source, target)) not in both]
    names.sort(key=natural_key)
    return ", ".join(names) if len(names) <= _NAMED else f"{len(names)} links"
