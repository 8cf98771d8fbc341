"""What the validator found, in words: each error with its place, the value, and the name that was probably meant."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import is_dataclass
from functools import partial
from typing import Annotated, Any, get_args, get_origin

from pydantic import ValidationError

from ...errors import BadInput
from ...kinds import Kinds
from ...names import did_you_mean, nearest
from ...units import OneOrMany
from .annotations import is_union, mark
from .settings_reading import TAG, Reader, inline_field, read_fields, validated
from .trace_files import STAND_INS
from .yaml_document import Loc, Problem, describe

_UNKNOWN = {"extra_forbidden", "unexpected_keyword_argument"}
_MISSING = {"missing", "missing_argument", "missing_keyword_only_argument"}
_MAPPING = {"model_type", "dataclass_type", "dict_type", "model_attributes_type"}
_LIST = {"list_type", "tuple_type"}
_LONGEST = 60


def read(hint: Any, value: Any, place: str = "") -> Any:
    """The value of an annotated type, as `validated` reads it.

    Raises:
        BadInput: all that is wrong, each as `place.field: message`.
    """
    try:
        return validated(hint, value)
    except ValidationError as error:
        problems = explain(error, partial(known_fields, hint, value))
        lines = [describe({place: value} if place else value, _below(place, problem)) for problem in problems]
        raise BadInput("; ".join(lines)) from error


def _below(place: str, problem: Problem) -> Problem:
    return problem._replace(loc=(place, *problem.loc)) if place else problem


def explain(error: ValidationError, known: Callable[[Loc], Iterable[str]]) -> list[Problem]:
    """Every error of a validation; `known(loc)` gives the names of the fields of the mapping at a place."""
    return [_problem(detail, known) for detail in error.errors(include_url=False)]


def _problem(detail: Mapping[str, Any], known: Callable[[Loc], Iterable[str]]) -> Problem:
    loc, kind = detail["loc"], detail["type"]
    if kind in _UNKNOWN:
        return Problem(loc, f"unknown field{did_you_mean(str(loc[-1]), known(loc[:-1]))}", "key")
    if kind in _MISSING:
        return Problem(loc, "is missing", "missing field")
    if kind == "value_error" and isinstance(cause := detail["ctx"]["error"], BadInput):
        return Problem((*loc, *cause.place), str(cause))
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


# -- names of fields ---------------------------------------------------------------------------------------------------


def known_fields(hint: Any, value: Any, loc: Loc) -> set[str]:
    """Names that may stand in the mapping at a place of a value of an annotated type; none where that is not known."""
    base = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    if (kinds := mark(hint, Kinds)) is not None:
        return _known_of_kind(kinds, value, loc)
    if (reader := mark(hint, Reader)) is not None and reader.known is not None:
        return reader.known(value, loc)
    if mark(hint, OneOrMany) is not None and not isinstance(value, list):
        return known_fields(get_args(base)[0], value, loc[1:] if loc[:1] == (0,) else loc)
    if is_union(base):
        return set().union(*(known_fields(part, value, loc) for part in get_args(base)))
    if isinstance(base, type) and is_dataclass(base):
        return _known_of_settings(base, value, loc)
    return _known_of_items(base, value, loc) if loc and get_args(base) else set()


def _known_of_items(base: Any, value: Any, loc: Loc) -> set[str]:
    parts = [part for part in get_args(base) if part is not Ellipsis]
    part = parts[loc[0]] if isinstance(loc[0], int) and len(parts) > 1 and loc[0] < len(parts) else parts[-1]
    return known_fields(part, _at(value, loc[0]), loc[1:])


def _known_of_settings(cls: Any, value: Any, loc: Loc) -> set[str]:
    known = read_fields(STAND_INS.get(cls, cls))
    if (inline := inline_field(cls)) is not None and not (loc and str(loc[0]) in known):
        return (set() if loc else set(known) - {inline}) | known_fields(known[inline][0], value, loc)
    below = known.get(str(loc[0])) if loc else None
    return set(known) if not loc else set() if below is None else known_fields(below[0], _at(value, loc[0]), loc[1:])


def _at(value: Any, key: str | int) -> Any:
    try:
        return value[key]
    except (KeyError, IndexError, TypeError):
        return None


def _known_of_kind(kinds: Kinds, value: Any, loc: Loc) -> set[str]:
    names = kinds.names()
    if kinds.tag == "kind":
        name = value.get(TAG, value) if isinstance(value, dict) else value
        return (set() if loc else {TAG}) | known_fields(kinds.find(str(name)), value, loc)
    name = next((str(key) for key in (value if isinstance(value, dict) else loc) if key in names), "")
    if not name:
        return set(names)
    fields_of_it = kinds.find(name)
    if loc[:1] == (name,):
        return known_fields(fields_of_it, _at(value, name), loc[1:])
    return {name} | known_fields(fields_of_it, value, loc) if kinds.tag == "beside" else set(names)
