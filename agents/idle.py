"""Values that a scenario says and nothing reads."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import MISSING, Field, fields
from typing import Any, get_type_hints

from ..errors import BadInput
from ..units import quantity, unit_of


def refuse_idle(parameters: Any, names: Collection[str], because: str, within: str = "") -> None:
    """Refuse fields that nothing reads, where they differ from their defaults.

    A default that is written out claims nothing, and a scenario as resolved writes out all of them.

    Args:
        parameters: a dataclass.
        names: fields that nothing reads.
        because: why not, as a clause that ends with the remedy.
        within: what stands before a name, such as `noise.`.
    Raises:
        BadInput: one of them has another value than its default.
    """
    for field in fields(parameters):
        value = getattr(parameters, field.name)
        if field.name in names and value != _default(field):
            raise BadInput(f"{within}{field.name} is {_written(parameters, field.name, value)}, and {because}")


def _default(field: Field[Any]) -> Any:
    return field.default if field.default_factory is MISSING else field.default_factory()


def _written(parameters: Any, name: str, value: Any) -> str:
    unit = unit_of(get_type_hints(type(parameters), include_extras=True)[name])
    if unit is None:
        return f"{value:g}" if isinstance(value, float) else str(value)
    if isinstance(value, tuple):
        return f"[{', '.join(quantity(one, unit) for one in value)}]"
    return quantity(value, unit)
