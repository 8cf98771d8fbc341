"""Plans as plain, versioned JSON and back, exactly: what a run's folder keeps and what processes are handed.

Numbers and texts stand as they are, floats by their shortest exact text. What JSON lacks is an object with a key that
begins with "$":

    {"$float": "nan"}                    nan, inf, -inf, or the 16 hexadecimal digits of another NaN
    {"$tuple": […]}  {"$set": […]}       {"$frozenset": […]}
    {"$dict": [[key, value], …]}         a mapping whose keys are no texts, or texts that begin with "$"
    {"$array": "<f8", "shape": […], "data": "base64"}   "file" instead of "data" for large ones, "order": "F" if so
    {"$number": "<f8", "data": "base64"} a NumPy scalar; {"$bytes": "base64"}
    {"$is": "module:Class", "field": …}  a frozen dataclass or a named tuple by its fields; {"$enum": "module:Class", …}
    {"$same": 3}                         the object that has "$id": 3

Code is named; beside the plan stands, by value, what is named in modules that no other process can import, see
`code_by_value`. Whoever only reads a plan imports and loads nothing of the users': see `Opaque`.
"""

from __future__ import annotations

import json
import math
import re
import struct
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from importlib import import_module
from typing import Any, NoReturn

import numpy as np

from ..errors import BadInput
from .code_by_value import goes_by_value, module_of, names_here, packed, unpacked
from .plan import Plan

FORMAT, VERSION = "volery plan", 1
LARGE_BYTES = 65_536
"""Arrays of more bytes are kept in files of their own, where there is a place for them."""
_PLAIN_KINDS = "biufcSU"
_OWN = __package__.partition(".")[0]
_CODE = re.compile(r"([A-Za-z_][\w.]*):([A-Za-z_][\w.]*)")
_CANONICAL_NAN = struct.pack(">d", math.nan)

Store = Callable[[bytes], str]
"""Keeps the bytes of a large array, and tells the name under which they are found again."""
Fetch = Callable[[str], bytes]


@dataclass(frozen=True)
class Opaque:
    """A value of a user's class, for readers that import no user's module: the class's name, and the fields."""

    name: str
    fields: Mapping[str, Any]

    def __hash__(self) -> int:
        """As equality, but for the fields, which may be anything."""
        return hash(self.name)


def encode_plan(plan: Plan, store: Store | None = None) -> str:
    """The JSON text of a plan.

    Args:
        plan: what to encode.
        store: for large arrays; without it they stand in the text.
    Raises:
        BadInput: a value that has no encoding; the message names the field. Code that cannot go by value.
    """
    encoder = _Encoder(store)
    encoded = encoder.value(plan, "plan")
    code = {module: packed(module, sorted(names)) for module, names in encoder.by_value.items()}
    document = {"format": FORMAT, "version": VERSION, **({"code": code} if code else {}), "plan": encoded}
    return json.dumps(document, allow_nan=False)


def named_by_value(value: Any) -> list[str]:
    """What a plan, or a value in it, names as module:Name that no other process can import."""
    encoder = _Encoder(None)
    encoder.value(value, "value")
    return [f"{module}:{name}" for module, names in encoder.by_value.items() for name in sorted(names)]


def decode_plan(text: str, fetch: Fetch | None = None, *, only_read: bool = False) -> Plan:
    """The plan of a JSON text, equal to the one that was encoded.

    Args:
        text: from `encode_plan`.
        fetch: gives the bytes of large arrays by their names.
        only_read: import and load nothing outside volery; values of users' classes are `Opaque`.
    Raises:
        BadInput: no such text, another version, or a class that is not there.
        OtherPython: it has code by value from another version of Python.
    """
    try:
        document = json.loads(text)
    except ValueError as error:
        raise BadInput(f"not a plan: {error}") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise BadInput(f'not a plan: it does not say "format": "{FORMAT}"')
    if document["version"] != VERSION:
        raise BadInput(f"a plan of version {document['version']}, and this volery reads version {VERSION}")
    code = {} if only_read else document.get("code", {})
    modules = {module: unpacked(module, carried) for module, carried in code.items()}
    plan = _Decoder(fetch, modules, only_read=only_read).value(document["plan"])
    if not isinstance(plan, Plan):
        raise BadInput(f"not a plan but {type(plan).__name__}")
    return plan


def encode_value(value: Any, store: Store | None = None) -> Any:
    """A value as it stands in a plan, such as a live fault: plain values for JSON and MessagePack.

    Raises:
        BadInput: it has no encoding.
    """
    return _Encoder(store).value(value, "value")


def decode_value(encoded: Any, fetch: Fetch | None = None, *, only_read: bool = False) -> Any:
    """The value that `encode_value` was given; `fetch` and `only_read` as in `decode_plan`.

    Raises:
        BadInput: a class that is not there.
    """
    return _Decoder(fetch, {} if only_read else names_here(), only_read=only_read).value(encoded)


class _Encoder:
    """One encoding. Objects that stand in several places are written once.

    `by_value`: module → names in it, of code that other processes cannot import.
    """

    def __init__(self, store: Store | None) -> None:
        self._store = store
        self.by_value: dict[str, set[str]] = {}
        self._seen: dict[int, tuple[dict[str, Any], object]] = {}
        self._writers: dict[type, Callable[[Any, str], Any]] = {
            str: self._text,
            float: lambda value, _path: value if math.isfinite(value) else {"$float": _special(value)},
            bytes: lambda value, _path: {"$bytes": b64encode(value).decode()},
            list: self._items,
            tuple: lambda value, path: {"$tuple": self._items(value, path)},
            set: lambda value, path: {"$set": sorted(self._items(value, path), key=json.dumps)},
            frozenset: lambda value, path: {"$frozenset": sorted(self._items(value, path), key=json.dumps)},
            dict: self._mapping,
            np.ndarray: self._array,
        }

    def value(self, value: Any, path: str) -> Any:
        if value is None or type(value) in (bool, int):
            return value
        return self._writers.get(type(value), self._other)(value, path)

    def _other(self, value: Any, path: str) -> Any:
        if isinstance(value, np.generic):
            return {"$number": _number_kind(value.dtype, path), "data": b64encode(value.tobytes()).decode()}
        if isinstance(value, Enum):
            return {"$enum": self._name(type(value), path), "name": value.name}
        return self._object(value, path)

    def _text(self, text: str, _path: str) -> str:
        if match := _CODE.fullmatch(text):
            self._note(match[1], match[2])
        return text

    def _note(self, module: str, name: str) -> None:
        outer = name.partition(".")[0]
        if goes_by_value(module, outer):
            self.by_value.setdefault(module, set()).add(outer)

    def _items(self, values: Any, path: str) -> list[Any]:
        return [self.value(item, f"{path}.{index}") for index, item in enumerate(values)]

    def _mapping(self, mapping: dict[Any, Any], path: str) -> dict[str, Any]:
        if all(type(key) is str and not key.startswith("$") for key in mapping):
            return {key: self.value(item, f"{path}.{key}") for key, item in mapping.items()}
        pairs = mapping.items()
        return {"$dict": [[self.value(key, f"{path}.{key}"), self.value(item, f"{path}.{key}")] for key, item in pairs]}

    def _array(self, value: Any, path: str) -> dict[str, Any]:
        by_columns = value.flags.f_contiguous and not value.flags.c_contiguous
        data = value.tobytes("F" if by_columns else "C")
        large = self._store is not None and len(data) > LARGE_BYTES
        return {
            "$array": _number_kind(value.dtype, path),
            "shape": list(value.shape),
            **({"order": "F"} if by_columns else {}),
            **({"file": self._store(data)} if self._store and large else {"data": b64encode(data).decode()}),
        }

    def _object(self, value: Any, path: str) -> dict[str, Any]:
        """A frozen dataclass or a named tuple, or where it was met before."""
        if id(value) in self._seen:
            first, _ = self._seen[id(value)]
            return {"$same": first.setdefault("$id", len(self._seen))}
        names = _fields(value, path)
        encoded: dict[str, Any] = {"$is": self._name(type(value), path)}
        encoded.update({name: self.value(getattr(value, name), f"{path}.{name}") for name in names})
        encoded["$id"] = len(self._seen)
        self._seen[id(value)] = encoded, value
        return encoded

    def _name(self, kind: type, path: str) -> str:
        if "<locals>" in kind.__qualname__:
            _refuse(path, f"{kind.__qualname__} is defined in a function, where no other process finds it")
        module = module_of(kind)
        self._note(module, kind.__qualname__)
        return f"{module}:{kind.__qualname__}"


def _number_kind(kind: np.dtype[Any], path: str) -> str:
    if kind.kind not in _PLAIN_KINDS:
        _refuse(path, f"an array of {kind} has no encoding: use numbers")
    return kind.str


def _fields(value: Any, path: str) -> tuple[str, ...]:
    """The names of the fields that are the state of an object."""
    kind = type(value)
    if isinstance(value, tuple) and hasattr(kind, "_fields"):
        names: tuple[str, ...] = kind._fields
        return names
    if not is_dataclass(kind):
        _refuse(path, f"{value!r} of class {kind.__qualname__} has no encoding: make it a frozen dataclass")
    if not getattr(kind, "__dataclass_params__").frozen:  # noqa: B009 - unknown to type checkers
        _refuse(path, f"{kind.__qualname__} is a dataclass that can change: write @dataclass(frozen=True)")
    return tuple(each.name for each in fields(kind) if each.init)


def _refuse(path: str, what: str) -> NoReturn:
    raise BadInput(f"{path}: {what}")


def _special(value: float) -> str:
    bits = struct.pack(">d", value)
    return repr(value) if math.isinf(value) or bits == _CANONICAL_NAN else bits.hex()


def _special_float(text: str) -> float:
    bits = bytes.fromhex(text) if len(text) == len(_CANONICAL_NAN.hex()) else None
    return float(text) if bits is None else struct.unpack(">d", bits)[0]


class _Decoder:
    """One decoding; `modules`: module → the name under which it is found here."""

    def __init__(self, fetch: Fetch | None, modules: Mapping[str, str], *, only_read: bool) -> None:
        self._fetch = fetch
        self._modules = modules
        self._only_read = only_read
        self._seen: dict[int, Any] = {}
        self._readers: dict[str, Callable[[dict[str, Any]], Any]] = {
            "$is": self._object,
            "$same": lambda encoded: self._seen[encoded["$same"]],
            "$enum": self._enum,
            "$float": lambda encoded: _special_float(encoded["$float"]),
            "$bytes": lambda encoded: b64decode(encoded["$bytes"]),
            "$tuple": lambda encoded: tuple(self.value(encoded["$tuple"])),
            "$set": lambda encoded: set(self.value(encoded["$set"])),
            "$frozenset": lambda encoded: frozenset(self.value(encoded["$frozenset"])),
            "$dict": lambda encoded: dict(map(self.value, encoded["$dict"])),
            "$number": lambda encoded: np.frombuffer(b64decode(encoded["data"]), np.dtype(encoded["$number"]))[0],
            "$array": self._array,
        }

    def value(self, encoded: Any) -> Any:
        if isinstance(encoded, list):
            return [self.value(item) for item in encoded]
        if isinstance(encoded, str) and (match := _CODE.fullmatch(encoded)) and match[1] in self._modules:
            return f"{self._modules[match[1]]}:{match[2]}"
        if not isinstance(encoded, dict):
            return encoded
        tag = next(iter(encoded), "")
        if tag.startswith("$"):
            return self._readers[tag](encoded)
        return {key: self.value(item) for key, item in encoded.items()}

    def _enum(self, encoded: dict[str, Any]) -> Any:
        found = self._class(encoded["$enum"])
        return Opaque(encoded["$enum"], {"name": encoded["name"]}) if found is None else found[encoded["name"]]

    def _array(self, encoded: dict[str, Any]) -> Any:
        if "file" in encoded:
            if self._fetch is None:
                raise BadInput(f"{encoded['file']}, which the plan names, is not at hand")
            data = self._fetch(encoded["file"])
        else:
            data = b64decode(encoded["data"])
        flat = np.frombuffer(data, np.dtype(encoded["$array"]))
        return flat.reshape(encoded["shape"], order=encoded.get("order", "C")).copy("K")

    def _object(self, encoded: dict[str, Any]) -> Any:
        name = encoded["$is"]
        values = {key: self.value(item) for key, item in encoded.items() if not key.startswith("$")}
        found = self._class(name)
        try:
            made = Opaque(name, values) if found is None else found(**values)
        except TypeError as error:
            raise BadInput(f"{name} is another class than that of the plan: {error}") from error
        self._seen[encoded["$id"]] = made
        return made

    def _class(self, name: str) -> Any:
        """The class of a name; None for a user's class where plans are only read."""
        module, _, path = name.partition(":")
        if self._only_read and module.partition(".")[0] != _OWN:
            return None
        try:
            found: Any = import_module(self._modules.get(module, module))
            for part in path.split("."):
                found = getattr(found, part)
        except (ImportError, AttributeError) as error:
            raise BadInput(f"{name}, which the plan names, cannot be loaded: {error}") from error
        if not (is_dataclass(found) or (isinstance(found, type) and issubclass(found, tuple | Enum))):
            raise BadInput(f"{name}, which the plan names, is no dataclass, named tuple or enumeration")
        return found
