"""Code that no other process can import, as that of a script or a notebook itself: it goes with a plan, by value.

What the plan names in `__main__` is pickled with all that it uses there. Where a plan is decoded to be run it becomes a
module of its own, named by the hash of the pickle; whoever only reads a plan does not load it.
"""

from __future__ import annotations

import pickle
import sys
from base64 import b64decode, b64encode
from collections.abc import Iterable, Mapping
from hashlib import sha256
from inspect import isfunction
from types import ModuleType
from typing import Any

from ..errors import BadInput
from .loaded_sources import MAIN

Packed = Mapping[str, str]
"""`python`: the version of Python that it was pickled by, which alone can load it; `pickle`: in base64."""
PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"
_unpacked: dict[str, Packed] = {}
_names_here: dict[str, str] = {}


class OtherPython(BadInput):
    """Code that was pickled by another version of Python."""


def goes_by_value(module: str, name: str) -> bool:
    """Whether a module has a name and other processes cannot import it: the program itself, or what came by value."""
    return (module == MAIN or module in _unpacked) and hasattr(sys.modules[module], name)


def module_of(cls: type) -> str:
    """Name of the module in which a class is found in this process."""
    outer = cls.__qualname__.partition(".")[0]
    came_here = (name for name in _unpacked if getattr(sys.modules[name], outer, None) is cls)
    return next(came_here, cls.__module__)


def packed(module: str, names: Iterable[str]) -> Packed:
    """What these names stand for in a module that goes by value.

    Raises:
        BadInput: it cannot be pickled; the message names what it is that cannot.
    """
    if module in _unpacked:
        return _unpacked[module]
    code = {name: getattr(sys.modules[module], name) for name in names}
    return {"python": PYTHON, "pickle": b64encode(_pickled(module, code)).decode()}


def _pickled(module: str, code: Mapping[str, Any]) -> bytes:
    import cloudpickle

    try:
        return bytes(cloudpickle.dumps(dict(code)))
    except Exception as error:
        culprits = (
            f"{name} uses {used}, which"
            for name, value in code.items()
            for used, thing in _used(value).items()
            if not _can_be_pickled(thing)
        )
        what = next(culprits, ", ".join(code))
        raise BadInput(f"{module}: {what} cannot be handed to other processes: {error}") from error


def _used(code: Any) -> dict[str, Any]:
    """Names and values of the globals that a function, or the methods of a class, use."""
    functions = filter(isfunction, [code, *getattr(code, "__dict__", {}).values()])
    return {
        name: function.__globals__[name]
        for function in functions
        for name in function.__code__.co_names
        if name in function.__globals__
    }


def _can_be_pickled(value: Any) -> bool:
    import cloudpickle

    try:
        cloudpickle.dumps(value)
    except Exception:  # noqa: BLE001 - whatever it is that a value does not like
        return False
    return True


def names_here() -> Mapping[str, str]:
    """Module whose code came here by value, with the latest plan → its name here."""
    return _names_here


def unpacked(module: str, packed: Packed) -> str:
    """Load code of a module that came here by value; the name of that module here.

    Raises:
        OtherPython: it was pickled by another version of Python.
    """
    if packed["python"] != PYTHON:
        raise OtherPython(f"the plan has code by value from Python {packed['python']}, and this is Python {PYTHON}")
    data = b64decode(packed["pickle"])
    name = f"kept_{sha256(data).hexdigest()[:16]}"
    if name not in _unpacked:
        made = ModuleType(name)
        vars(made).update(pickle.loads(data))  # noqa: S301 - the user's own code, as in a module
        sys.modules[name] = made
        _unpacked[name] = packed
    _names_here[module] = name
    return name
