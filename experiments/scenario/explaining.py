"""What the validator found, in words: each error with its place, the value, and the name that was probably meant."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from pydantic import ValidationError

from ...names import did_you_mean, nearest
from .yaml_document import Loc, Problem

_UNKNOWN = {"extra_forbidden", "unexpected_keyword_argument"}
_MISSING = {"missing", "missing_argument", "missing_keyword_only_argument"}
_MAPPING = {"model_type", "dataclass_type", "dict_type", "model_attributes_type"}
_LIST = {"list_type", "tuple_type"}
_LONGEST = 60


def explain(error: ValidationError, known: Callable[[Loc], Iterable[str]]) -> list[Problem]:
    """Every error of a validation; `known(loc)` gives the names of the fields of the mapping at a place."""
    return [_problem(detail, known) for detail in error.errors(include_url=False)]


def _problem(detail: Mapping[str, Any], known: Callable[[Loc], Iterable[str]]) -> Problem:
    loc, kind = detail["loc"], detail["type"]
    if kind in _UNKNOWN:
        return Problem(loc, f"unknown field{did_you_mean(str(loc[-1]), known(loc[:-1]))}", "key")
    if kind in _MISSING:
        return Problem(loc, "is missing", "missing field")
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
    message = detail["msg"].removeprefix("Input ").removesuffix(" or instance")
    return f"{message}, not {written}" if message.startswith("should") else f"{message}: {written}"


def _nearest(name: str, names: list[str]) -> str:
    return did_you_mean(name, names) if nearest(name, names) else ""


def schema_fields(schema: Mapping[str, Any], loc: Loc) -> set[str]:
    """Names of the fields that a JSON Schema allows in the mapping at a place; parts it does not know are skipped."""
    nodes = _alternatives(schema, schema)
    for part in loc:
        below = [child for node in nodes if (child := _below(node, part)) is not None]
        if below:
            nodes = [deeper for child in below for deeper in _alternatives(schema, child)]
    return {name for node in nodes for name in node.get("properties", ())}


def _below(node: Mapping[str, Any], part: str | int) -> Mapping[str, Any] | None:
    found = node.get("items") if isinstance(part, int) else node.get("properties", {}).get(part)
    return found if isinstance(found, Mapping) else None


def _alternatives(root: Mapping[str, Any], node: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The schema with references followed and unions taken apart."""
    if "$ref" in node:
        name = str(node["$ref"]).rsplit("/", 1)[-1]
        return _alternatives(root, root["$defs"][name])
    parts = [*node.get("anyOf", ()), *node.get("oneOf", ()), *node.get("allOf", ())]
    return [node, *(deeper for part in parts for deeper in _alternatives(root, part))]
