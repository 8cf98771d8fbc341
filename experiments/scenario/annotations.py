"""Annotated types: their marks, unions, and the names of fields in a scenario."""

from __future__ import annotations

from dataclasses import Field
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from ...units import OWNERS, Unit

Mark = TypeVar("Mark")


def mark(hint: Any, kind: type[Mark]) -> Mark | None:
    """The mark of a kind in `Annotated[base, marks]`."""
    return next((each for each in getattr(hint, "__metadata__", ()) if isinstance(each, kind)), None)


def owned(hint: Any, owner: Unit | None) -> Any:
    """The type, with the unit of the enclosing field if it has none of its own."""
    return Annotated[get_args(hint)[0], owner] if mark(hint, Unit) == OWNERS and owner is not None else hint


def is_union(base: Any) -> bool:
    """Whether a type is a union."""
    return get_origin(base) in (Union, UnionType)


def written_name(field: Field[Any]) -> str:
    """The name of a dataclass's field in a scenario: without the suffix `_ns`, or as its metadata say."""
    return str(field.metadata.get("name", field.name.removesuffix("_ns").rstrip("_")))
