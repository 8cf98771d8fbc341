"""Checks of a class that overrides methods of a base class of volery: each error names class, method and remedy."""

from __future__ import annotations

import inspect
from collections import deque
from collections.abc import Iterator
from dataclasses import is_dataclass
from types import FunctionType
from typing import Any, ClassVar, get_origin

import numpy as np

from .errors import BadInput
from .names import did_you_mean

_MUTABLE = (list, dict, set, bytearray, deque, np.ndarray)


def check_overrides(kind: type[Any], base: type[Any], what: str) -> None:
    """Check that a subclass overrides methods as they are called.

    Args:
        kind: the subclass.
        base: of volery.
        what: start of error messages, such as "agent kind 'mine:Thermometer'".
    Raises:
        BadInput: a method that is async or a generator, takes other arguments, is a class method or not where it must
            be the other; a method `on_…` that is never called.
    """
    for name, original in vars(base).items():
        own = inspect.getattr_static(kind, name)
        if own is not original and isinstance(original, FunctionType | classmethod) and _is_called(base, name):
            _check_method(kind, name, original, own, what)
    for name in dir(kind):
        if name.startswith("on_") and not hasattr(base, name):
            known = [each for each in dir(base) if each.startswith("on_")]
            raise BadInput(f"{what} has {name}, which is never called{did_you_mean(name, known)}: helpers begin with _")


def check_nothing_is_shared(kind: type[Any], base: type[Any], what: str) -> None:
    """Check that a subclass shares no state between its objects, which may be in one process or in several.

    Raises:
        BadInput: a mutable default or class attribute, unless that is a constant or a ClassVar.
    """
    for problem in _shared(kind, base):
        raise BadInput(f"{what}: {problem}")


def _is_called(base: type[Any], name: str) -> bool:
    """Whether volery calls a method with the arguments of the base class; a dataclass has an `__init__` of its own."""
    return not name.startswith("_") or (name == "__init__" and not is_dataclass(base))


def _check_method(kind: type[Any], name: str, original: Any, own: Any, what: str) -> None:
    if isinstance(original, classmethod) and isinstance(own, FunctionType):
        raise BadInput(f"{what}: {name} is called on the class: write @classmethod above it")
    if isinstance(original, FunctionType) and isinstance(own, classmethod | staticmethod | property):
        raise BadInput(f"{what}: {name} is called on the object: write it as a plain method, without a decorator")
    method = getattr(kind, name)
    if not callable(method):
        raise BadInput(f"{what}: {name} is {method!r}, and must be a method")
    if inspect.iscoroutinefunction(method) or inspect.isasyncgenfunction(method) or inspect.isgeneratorfunction(method):
        raise BadInput(f"{what}: {name} is async or a generator, so it would never run: write a plain method")
    expected = list(inspect.signature(getattr(original, "__func__", original)).parameters)
    given = expected[1:] if isinstance(own, classmethod | staticmethod) else expected
    try:
        inspect.signature(method).bind(*given)
    except TypeError:
        raise BadInput(f"{what}: {name} takes other arguments than ({', '.join(expected)})") from None


def _shared(kind: type[Any], base: type[Any]) -> Iterator[str]:
    for cls in kind.__mro__[: kind.__mro__.index(base)]:
        hints = inspect.get_annotations(cls)
        for name, value in vars(cls).items():
            defaults = getattr(value, "__defaults__", None) or ()
            if isinstance(value, FunctionType) and any(isinstance(default, _MUTABLE) for default in defaults):
                yield f"{name} has a mutable default, which all calls share: take None, and make it in the method"
            constant = name.startswith("__") or name.isupper() or _is_class_variable(hints.get(name))
            if isinstance(value, _MUTABLE) and not constant:
                kind_of = type(value).__name__
                yield f"{name} is a {kind_of} of the class, which all agents of a process share: make it in __init__"


def _is_class_variable(hint: Any) -> bool:
    return hint is ClassVar or get_origin(hint) is ClassVar or (isinstance(hint, str) and "ClassVar" in hint)
