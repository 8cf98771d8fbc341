"""Pydantic's types of numbers with units and bounds, for validation and JSON Schema."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, WithJsonSchema

from ...units import Bounds, Unit

_NUMBER = r"(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*"


def within(base: Any, bounds: Bounds) -> Any:
    """A type with the bounds of its numbers in JSON Schema."""
    limits: dict[str, Any] = {
        "minimum": bounds.least,
        "maximum": bounds.most,
        "exclusiveMinimum": bounds.above,
        "exclusiveMaximum": bounds.below,
    }
    extra = {name: end for name, end in limits.items() if end is not None}
    return Annotated[base, Field(json_schema_extra=extra)] if extra else base


def quantity_type(base: Any, unit: Unit, bounds: Bounds) -> Any:
    """A quantity, written as text with its unit; its pattern can refuse what is below 0, or 0, and no other bound."""
    names = "|".join(
        sorted((name.replace("(", r"\(").replace(")", r"\)") for name in unit.names), key=len, reverse=True)
    ).replace("µ", "[µμ]")
    sign = "[-+]?" if unit.signed and bounds.least != 0 and bounds.above != 0 else "[+]?"
    sign += r"(?=[\d.]*[1-9])" if bounds.above == 0 else ""
    units = ", ".join(unit.names)
    text = {
        "type": "string",
        "pattern": rf"^\s*{sign}{_NUMBER}({names})\s*$",
        "description": f"number and unit: {units}",
    }
    number = {"type": "number"} if unit.bare else {"const": 0}
    return Annotated[base, BeforeValidator(unit.read), WithJsonSchema({"anyOf": [text, number]})]
