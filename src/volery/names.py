"""Names in user input: the nearest known name, and classes by `package.module:Class`."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from importlib import import_module
from typing import TypeVar

from .errors import BadInput

Base = TypeVar("Base")


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that is most similar, or None if none is similar enough."""
    return next(iter(difflib.get_close_matches(name, sorted(known), 1)), None)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint in parentheses: the nearest known name, or else all of them; empty if there are none."""
    names = sorted(known)
    if near := nearest(name, names):
        return f" (did you mean {near!r}?)"
    return f" (known: {', '.join(names)})" if names else ""


def imported_class(target: str, base: type[Base], what: str) -> type[Base]:
    """Import the class of an import string.

    Args:
        target: `package.module:Class`.
        base: required base class.
        what: start of error messages, such as "filter 'mine:Best'".
    Raises:
        BadInput: no such module or class, or not a subclass.
    """
    module, _, attribute = target.partition(":")
    try:
        found = getattr(import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise BadInput(f"{what} cannot be loaded: {error}") from error
    if not (isinstance(found, type) and issubclass(found, base)):
        raise BadInput(f"{what} is {found!r}, not a subclass of {base.__module__}.{base.__qualname__}")
    return found
