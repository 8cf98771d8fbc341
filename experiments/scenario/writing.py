"""Values written as a scenario has them: quantities with units, models by name. What is written reads back equal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, get_args, get_type_hints

from ...transport.csma import Csma
from ...transport.latencies import LATENCIES
from ...transport.losses import LOSSES
from ...transport.media import Aloha, FullDuplex, HalfDuplex, SlottedAloha, Tdma
from ...units import quantity, unit_of

ACCESS_NAMES: dict[type, str] = {Aloha: "aloha", SlottedAloha: "slotted-aloha", Tdma: "tdma", Csma: "csma"}
_NAMES: dict[type, str] = {
    **{model: name for models in (LOSSES, LATENCIES) for name, model in models.items()},
    **ACCESS_NAMES,
}
_KINDS: dict[type, str] = {FullDuplex: "full-duplex", HalfDuplex: "half-duplex"}


def spelled(value: Any, hint: Any = Any) -> Any:
    """A value as plain data, as a scenario has it; `hint` is its declared type, which knows the unit."""
    unit = unit_of(hint)
    if unit is not None and isinstance(value, int | float):
        return quantity(value, unit)
    if is_dataclass(value) and not isinstance(value, type):
        return _model(value)
    if isinstance(value, Mapping):
        hints = _hints(hint)
        of_values = (get_args(hint) or (Any, Any))[-1]
        return {str(key): spelled(item, hints.get(key, of_values)) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [spelled(item, of_item) for item, of_item in zip(value, _item_hints(hint, len(value)), strict=True)]
    return value


def _model(value: Any) -> Any:
    hints = _hints(type(value))
    body = {
        field.name: spelled(getattr(value, field.name), hints[field.name])
        for field in fields(value)
        if getattr(value, field.name) is not None or field.default is MISSING
    }
    if type(value) in _KINDS:
        return {"kind": _KINDS[type(value)], **body}
    if type(value) in _NAMES:
        return {_NAMES[type(value)]: body}
    return body


def _hints(hint: Any) -> dict[str, Any]:
    return get_type_hints(hint, include_extras=True) if isinstance(hint, type) else {}


def _item_hints(hint: Any, count: int) -> Sequence[Any]:
    parts = [part for part in get_args(hint) if part is not Ellipsis]
    return parts if len(parts) == count else [parts[0] if parts else Any] * count
