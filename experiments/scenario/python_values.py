"""Values from Python in a scenario: classes, functions and NumPy's numbers as the plain data of a file."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from inspect import isclass, isfunction
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import BadInput


def plain(value: Any, place: str = "") -> Any:
    """A value as a scenario file has it; `place` is the name of its field, for messages.

    A class or function stands for its name, `module:Name`.

    Raises:
        BadInput: a value that no file could have, or code without a name; the message names the field.
    """
    if value is None or isinstance(value, bool | int | float | str | Path):
        return str(value) if isinstance(value, Path) else value
    if isinstance(value, Mapping):
        return _mapping(value, place)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(item, f"{place}.{index}") for index, item in enumerate(value)]
    if isclass(value) or isfunction(value):
        return name_of(value, place)
    raise BadInput(f"{place}: {value!r} has no place in a scenario: write text, numbers, lists, mappings or classes")


def _mapping(value: Mapping[Any, Any], place: str) -> dict[str, Any]:
    keys = [name_of(key, place) if isclass(key) else str(key) for key in value]
    if len(set(keys)) < len(keys):
        raise BadInput(f"{place}: one of the keys {', '.join(keys)} occurs twice, as number and as text")
    return {
        key: plain(item, f"{place}.{key}" if place else key) for key, item in zip(keys, value.values(), strict=True)
    }


def name_of(code: Any, place: str) -> str:
    """The name of a class or function, `module:Name`.

    Raises:
        BadInput: nobody finds it by its name; the message says why.
    """
    name = f"{code.__module__}:{code.__qualname__}"
    if "<" in code.__qualname__:
        raise BadInput(f"{place}: {name} is made in a function: define it at the top of the module, script or notebook")
    if getattr(sys.modules.get(code.__module__), code.__qualname__, None) is not code:
        raise BadInput(f"{place}: {name} is another object now: hand over the one that was defined last")
    return name
