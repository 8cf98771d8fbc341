"""Errors of a validation in words: the place, the value, and the nearest known name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from ...errors import BadInput
from ...names import did_you_mean, nearest
from .settings_reading import validated
from .strict_reading import UnknownField
from .yaml_document import Problem, describe

_MISSING = {"missing", "missing_argument", "missing_keyword_only_argument"}
_MAPPING = {"model_type", "dataclass_type", "dict_type", "model_attributes_type"}
_LIST = {"list_type", "tuple_type"}
_LONGEST = 60


def read(hint: Any, value: Any, place: str = "") -> Any:
    """The value of an annotated type, as `validated` reads it.

    Raises:
        BadInput: all errors, each as `place.field: message`.
    """
    try:
        return validated(hint, value)
    except ValidationError as error:
        lines = [describe({place: value} if place else value, _below(place, each)) for each in explain(error)]
        raise BadInput("; ".join(lines)) from error


def _below(place: str, problem: Problem) -> Problem:
    return problem._replace(loc=(place, *problem.loc)) if place else problem


def explain(error: ValidationError) -> list[Problem]:
    """All errors of a validation."""
    return [_problem(detail) for detail in error.errors(include_url=False)]


def _problem(detail: Mapping[str, Any]) -> Problem:
    loc, kind = detail["loc"], detail["type"]
    if kind in _MISSING:
        return Problem(loc, "is missing", "missing field")
    if kind == "value_error" and isinstance(cause := detail["ctx"]["error"], BadInput):
        return Problem((*loc, *cause.place), str(cause), "key" if isinstance(cause, UnknownField) else "value")
    return Problem(loc, _message(kind, detail))


def _message(kind: str, detail: Mapping[str, Any]) -> str:
    written = repr(detail["input"])
    written = written if len(written) <= _LONGEST else f"{written[:_LONGEST]}…"
    if kind == "value_error":
        return str(detail["ctx"]["error"])
    if kind == "literal_error":
        names = re.findall(r"'([^']*)'", detail["ctx"]["expected"])
        return f"{written} is none of {', '.join(names)}{_nearest(str(detail['input']), names)}"
    if kind in _MAPPING:
        return f"should be a mapping of fields, not {written}"
    if kind in _LIST:
        return f"should be a list, not {written}"
    if kind == "too_long":
        return f"should have at most {detail['ctx']['max_length']} items, not {written}"
    message = detail["msg"].removeprefix("Input ").removesuffix(" or instance")
    return f"{message}, not {written}" if message.startswith("should") else f"{message}: {written}"


def _nearest(name: str, names: list[str]) -> str:
    return did_you_mean(name, names) if nearest(name, names) else ""
