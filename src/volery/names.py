"""Names in user input: the nearest known name, and classes by `package.module:Class`."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import Any, TypeVar

from .errors import BadInput
from .user_code import described, user_frames

Base = TypeVar("Base")
LONGEST_RUN = 200
"""Bytes of the name of a scenario or of a run's folder; time and number are added to it."""
LONGEST_FILE = 255
"""Bytes of the name of a file."""
_SHOWN = 30


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that is most similar, or None if none is similar enough."""
    return next(iter(difflib.get_close_matches(name, sorted(known), 1)), None)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint in parentheses: the nearest known name, or else all of them; empty if there are none."""
    names = sorted(known)
    if near := nearest(name, names):
        return f" (did you mean {near!r}?)"
    return f" (known: {', '.join(names)})" if names else ""


def check_length(name: str, most: int, what: str) -> str:
    """Return the name if it has at most so many bytes in UTF-8, as folders and keys need.

    Raises:
        BadInput: it has more.
    """
    size = len(name.encode(errors="surrogateescape"))
    if size > most:
        raise BadInput(f"{what} {name[:_SHOWN]}… has {size} bytes: it may have at most {most}")
    return name


def first_of(words: Sequence[str], most: int) -> str:
    """The first words, separated by commas, and the number of further ones: "a, b and 3 more"."""
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return f"{', '.join(words[:most])}{more}"


def imported(target: str, what: str) -> Any:
    """Import what `package.module:Name` names.

    Args:
        target: the import string.
        what: start of error messages, such as "filter 'mine:Best'".
    Raises:
        BadInput: no such module or name, or the module fails.
    """
    module, _, attribute = target.partition(":")
    if "." in attribute:
        raise BadInput(f"{what} cannot be loaded: {attribute} is not at the top level of its module: move it there")
    try:
        loaded = import_module(module)
    except ImportError as error:
        raise BadInput(f"{what} cannot be loaded: {described(error) if user_frames(error) else error}") from error
    except (Exception, SystemExit) as error:
        raise BadInput(f"{what} cannot be loaded: {described(error)}") from error
    if hasattr(loaded, attribute):
        return getattr(loaded, attribute)
    if module.partition(".")[0] in sys.stdlib_module_names:
        raise BadInput(f"{what} cannot be loaded: module {module!r} is Python's own: give your file another name")
    own = [name for name, value in vars(loaded).items() if getattr(value, "__module__", None) == loaded.__name__]
    file = getattr(loaded, "__file__", None)
    near = did_you_mean(attribute, own)
    raise BadInput(f"{what} cannot be loaded: module {module!r} of {file} has no attribute {attribute!r}{near}")


def subclass(found: Any, base: type[Base], what: str) -> type[Base]:
    """Return the class if it is a subclass of the base.

    Raises:
        BadInput: it is not; the message starts with `what`.
    """
    if not (isinstance(found, type) and issubclass(found, base)):
        raise BadInput(f"{what} is {found!r}, not a subclass of {base.__module__}.{base.__qualname__}")
    return found


def imported_class(target: str, base: type[Base], what: str) -> type[Base]:
    """Import a class, as `imported` and `subclass` do."""
    return subclass(imported(target, what), base, what)
