"""Values as plain data of a scenario: quantities with units, kinds by name. Reading the data gives equal values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from typing_extensions import is_protocol

from ...kinds import Kinds, OwnKind
from ...units import OWNERS, Unit, quantity
from ...worlds.signals import Steps
from .annotations import is_union, mark, owned, written_name


def dumped(value: Any, hint: Any = Any, owner: Unit | None = None) -> Any:
    """A value as plain data; `hint`: its annotated type; `owner`: the unit of numbers that take that of the field."""
    hint = owned(hint, owner)
    base = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    unit = mark(hint, Unit)
    dumps = (getattr(each, "dump", None) for each in getattr(hint, "__metadata__", ()))
    if (dump := next(filter(None, dumps), None)) is not None and value is not None:
        return dump(value)
    if (kinds := mark(hint, Kinds)) is not None and value is not None:
        return _of_kind(value, kinds, unit)
    if is_union(base):
        return _alternative(value, get_args(base), owner)
    if unit not in (None, OWNERS):
        return quantity(value, unit.name) if isinstance(value, int | float) else value
    return _structure(value, base, owner)


def _structure(value: Any, base: Any, owner: Unit | None) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return settings(value, owner)
    if isinstance(value, Mapping):
        of_values = (get_args(base) or (Any,))[-1]
        return {str(key): dumped(item, of_values, owner) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [dumped(item, of, owner) for item, of in zip(value, _item_hints(base, len(value)), strict=True)]
    return value


def settings(value: Any, owner: Unit | None = None) -> dict[str, Any]:
    """Settings as a mapping of their fields, without optional fields that are None."""
    if isinstance(value, Steps):
        levels = [dumped(level, Annotated[float, owner]) for level in value.levels]
        return dict(zip([quantity(time, "ns") for time in value.times_ns], levels, strict=True))
    hints = get_type_hints(type(value), include_extras=True)
    plain: dict[str, Any] = {}
    for field in fields(value):
        content = getattr(value, field.name)
        if field.init and (content is not None or field.default is MISSING):
            shown = dumped(content, hints[field.name], owner)
            plain |= shown if field.metadata.get("inline") else {written_name(field): shown}
    return plain


def _of_kind(value: Any, kinds: Kinds, owner: Unit | None) -> Any:
    if isinstance(value, OwnKind):
        return {"kind": value.kind, **settings(value.parameters, owner)}
    name = kinds.name_of(type(value))
    body = settings(value, owner)
    if kinds.tag == "kind" or (kinds.tag == "beside" and ":" in name):
        return {"kind": name, **body}
    if name == kinds.scalar and len(body) == 1:
        return next(iter(body.values()))
    return {name: body[name] if list(body) == [name] else body}


def _alternative(value: Any, parts: Sequence[Any], owner: Unit | None) -> Any:
    return next((dumped(value, part, owner) for part in parts if _fits(value, part)), value)


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value may be of this type of a union."""
    base = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    origin = get_origin(base) or base
    if origin is Literal:
        return value in get_args(base)
    if origin is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    return not isinstance(origin, type) or is_protocol(origin) or isinstance(value, origin)


def _item_hints(hint: Any, count: int) -> Sequence[Any]:
    parts = [part for part in get_args(hint) if part is not Ellipsis]
    return parts if len(parts) == count else [parts[0] if parts else Any] * count
