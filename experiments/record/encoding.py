"""JSON that keeps every number: whole numbers and floats of any size come back bit for bit, NaN and infinities too.

JSON has no NaN and no infinity. In a vector they are written as the texts "nan", "inf" and "-inf"; elsewhere, where a
text could be meant, as {"float": "nan"}. The sign and payload bits of a NaN are not kept.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from typing import Any

_TAG = "float"


def dump(value: Any) -> bytes:
    """Compact JSON of plain values; floats are written so that they read back exactly."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()


def vector_to_json(vector: Iterable[float]) -> list[float | str]:
    """The components, those that are not finite as text."""
    return [float(value) if math.isfinite(value) else repr(float(value)) for value in vector]


def vector_from_json(vector: Iterable[float | str]) -> list[float]:
    """The vector that `vector_to_json` was given."""
    return [float(value) for value in vector]


def row_to_json(row: Any) -> Any:
    """A named tuple whose field `value`, if it has one, is a vector or None."""
    value = getattr(row, "value", None)
    return row if value is None else row._replace(value=vector_to_json(value))


def row_from_json(kind: Any, fields: Iterable[Any]) -> Any:
    """The named tuple that `row_to_json` was given."""
    row = kind(*fields)
    value = getattr(row, "value", None)
    return row if value is None else row._replace(value=vector_from_json(value))


def defined(value: Any) -> Any:
    """Plain values of any depth for people: None for NaN, "inf" and "-inf" for infinities."""
    if isinstance(value, dict):
        return {key: defined(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [defined(item) for item in value]
    if not isinstance(value, float) or math.isfinite(value):
        return value
    return None if math.isnan(value) else repr(value)


def tag(value: Any) -> Any:
    """Plain values of any depth, with floats that are not finite as {"float": text}."""
    if isinstance(value, dict):
        return {key: tag(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [tag(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return {_TAG: repr(float(value))}
    return value


def untag(value: Any) -> Any:
    """The values that `tag` was given, tuples as lists."""
    if isinstance(value, dict):
        if value.keys() == {_TAG} and isinstance(value[_TAG], str):
            return float(value[_TAG])
        return {key: untag(item) for key, item in value.items()}
    return [untag(item) for item in value] if isinstance(value, list) else value
