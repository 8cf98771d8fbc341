"""Kinds by name: built in, from entry points of installed packages, or `package.module:Name`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from typing import Any, Literal

from .errors import BadInput
from .names import did_you_mean, imported, subclass


@dataclass(frozen=True)
class NoParameters:
    """Parameters of a class that has none."""


@dataclass(frozen=True)
class OwnKind:
    """What a scenario says of a kind of a user's: its name, and the parameters that its class takes."""

    kind: str
    parameters: Any


@dataclass(frozen=True, eq=False)
class Kinds:
    """The kinds of one category, and how a scenario chooses one; `Annotated[Base, kinds]` marks such a field.

    what: name of the category in error messages, such as "agent kind".
    built_in: name → class, or its import string `package.module:Name`.
    tag: syntax in a scenario. `key`: {name: {fields}}, or the name alone, or {name: value of the first field};
        `kind`: {kind: name, fields}; `beside`: as `key`, but other fields may be given beside the name.
    scalar: the kind that a bare quantity stands for, as the value of its first field.
    entry_points: group of entry points that add names; if given, `package.module:Name` is also allowed.
    base: base class of all kinds from there.
    check: called with such a class and the start of error messages; raises BadInput where it does not fit.
    of_function: makes a class of a function that stands in the place of one.
    own: import string of the subclass of `OwnKind` that holds what a scenario says of such a kind, where the built-in
        classes hold that themselves; the fields are then those of the class's `Parameters`.
    """

    what: str
    built_in: Mapping[str, type[Any] | str]
    tag: Literal["key", "kind", "beside"] = "key"
    scalar: str | None = None
    entry_points: str = ""
    base: type[Any] = object
    check: Callable[[Any, str], None] | None = None
    of_function: Callable[[Any], type[Any]] | None = None
    own: str = ""

    def names(self) -> list[str]:
        """Names of all kinds."""
        return list(dict.fromkeys((*self.built_in, *sorted(_added(self.entry_points)))))

    def find(self, name: str) -> Any:
        """The class of a kind.

        Raises:
            BadInput: no such name, module or class, or not a subclass of the base.
        """
        what, target = f"{self.what} {name!r}", self.built_in.get(name)
        if target is not None:
            return target if isinstance(target, type) else imported(target, what)
        if self.entry_points:
            target = name if ":" in name else _added(self.entry_points).get(name)
        if target is None:
            own = ", or write package.module:Class" if self.entry_points else ""
            raise BadInput(f"unknown {what}{did_you_mean(name, self.names())}{own}")
        found = imported(target, what)
        if self.of_function is not None and callable(found) and not isinstance(found, type):
            return self.of_function(found)
        kind = subclass(found, self.base, what)
        if self.check is not None:
            self.check(kind, what)
        return kind

    def is_own(self, name: str) -> bool:
        """Whether a kind is a user's, and `own` holds what a scenario says of it."""
        return bool(self.own) and name not in self.built_in

    def settings(self, name: str) -> Any:
        """The dataclass whose fields a scenario may give to a kind.

        Raises:
            BadInput: as `find`.
        """
        return self.find(name).Parameters if self.is_own(name) else self.find(name)

    def made(self, name: str, settings: Any) -> Any:
        """What a scenario says of a kind, from an object of its `settings`."""
        return imported(self.own, self.what)(name, settings) if self.is_own(name) else settings

    def classes(self) -> list[Any]:
        """The built-in classes."""
        return [self.find(name) for name in self.built_in]

    def name_of(self, cls: type[Any]) -> str:
        """The built-in name of a class, or its import string."""
        target = f"{cls.__module__}:{cls.__qualname__}"
        return next((name for name, kind in self.built_in.items() if kind is cls or kind == target), target)


@cache
def _added(group: str) -> Mapping[str, str]:
    """Name → import string, of what installed packages add to a group of entry points."""
    return {point.name: point.value for point in entry_points(group=group)} if group else {}
