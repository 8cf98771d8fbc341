"""Plain data read strictly, without text for a number, and unknown fields by the name that was probably meant."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from ...errors import BadInput
from ...names import did_you_mean

STRICT = ConfigDict(extra="forbid", strict=True, frozen=True, protected_namespaces=())


def strictly(adapter: TypeAdapter[Any], value: Any) -> Any:
    """A value, read by a type."""
    return adapter.validate_json(json.dumps(value), strict=True)


class UnknownField(BadInput):
    """A field that a mapping of settings does not have."""


def read_model(model: type[BaseModel], value: Any) -> Any:
    """A mapping as a model, read strictly.

    Raises:
        ValidationError: all errors, each with its place; those of unknown fields name the nearest known one.
    """
    try:
        return model.model_validate_json(json.dumps(value), strict=True)
    except ValidationError as error:
        known = [field.alias or name for name, field in model.model_fields.items()]
        details = [_with_known(detail, known) for detail in error.errors(include_url=False)]
        raise ValidationError.from_exception_data(error.title, details) from error


def _with_known(detail: Any, known: Sequence[str]) -> Any:
    if detail["type"] != "extra_forbidden":
        return detail
    unknown = UnknownField(f"unknown field{did_you_mean(str(detail['loc'][-1]), known)}")
    return {**detail, "type": "value_error", "ctx": {"error": unknown}}
