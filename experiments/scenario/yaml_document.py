"""YAML with positions, overrides from the command line, and errors that name the place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, SequenceNode

from ...errors import BadInput
from ...topologies.over_time import GRAPHS

Loc = tuple[str | int, ...]
"""Where a value stands: keys and indices from the top."""
NOTHING: Mapping[str, Any] = MappingProxyType({})

_CHOICES = {"loss", "corruption", "latency", "access", "topology", "altitude", "roll", "pitch", "sensor"}
"""Fields in which one key chooses a model: setting another key there replaces the model."""

_BY_KIND = {"agents", "world"}
"""Fields in which a text alone is the kind."""


class Problem(NamedTuple):
    """An error at a place: of a value, of a key, or of a missing field.

    Parts of `loc` that the file does not have are skipped, except the name of a missing field.
    """

    loc: Loc
    message: str
    about: Literal["value", "key", "missing field"] = "value"


@dataclass(frozen=True)
class Document:
    """A mapping read from a file or given from Python, with overrides applied.

    label: name of the file, in messages.
    tree: the root node of the file, with positions; None if there is none.
    data: the values in force, as plain data.
    overrides: path below which an override set everything → its key on the command line.
    given: fields from Python in the place of the file's.
    """

    label: str
    tree: Any
    data: dict[str, Any]
    overrides: dict[tuple[str, ...], str]
    given: frozenset[str] = frozenset()

    def error(self, problems: Iterable[Problem]) -> BadInput:
        """One error with all problems, a line each: place, field, message."""
        return BadInput("\n".join(self._line(problem) for problem in problems))

    def _line(self, problem: Problem) -> str:
        place = self._place(existing(self.data, problem.loc), of_key=problem.about == "key")
        what = describe(self.data, problem)
        return f"{place}: {what.removeprefix(place.removeprefix('--set ') + ': ')}" if place else what

    def is_overridden(self, path: Loc) -> bool:
        """Whether a value stands in the place of the file's."""
        return path[0] in self.given or bool(self._covering(path))

    def _covering(self, path: Loc) -> list[tuple[str, ...]]:
        words = _words(path)
        return [override for override in self.overrides if override == words[: len(override)]]

    def _place(self, path: Loc, of_key: bool) -> str:
        """The position of a value or its key, or the override that it came from; empty where it came from Python."""
        if covering := self._covering(path):
            return f"--set {self.overrides[max(covering, key=len)]}"
        if self.tree is None or (path and path[0] in self.given):
            return ""
        node, mark = self.tree, self.tree.start_mark
        for depth, part in enumerate(path, start=1):
            if (entry := _entry(node, part)) is None:
                break
            key, node = entry
            mark = (key if of_key and depth == len(path) else node).start_mark
        return f"{self.label}:{mark.line + 1}:{mark.column + 1}"


def _words(path: Loc) -> tuple[str, ...]:
    return tuple(str(part) for part in path)


def existing(data: Any, loc: Loc) -> Loc:
    """The parts of a place that the data has, with indices as numbers."""
    path: Loc = ()
    for part in loc:
        index = int(part) if isinstance(data, list) and str(part).isdecimal() else part
        keys: Any = data if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
        if index in keys:
            data = data[index]
            path = (*path, index)
    return path


def describe(data: Any, problem: Problem) -> str:
    """A field and its problem, such as `links.rate: is missing`."""
    path = existing(data, problem.loc) + (problem.loc[-1:] if problem.about == "missing field" else ())
    return ": ".join(filter(None, (".".join(_words(path)), problem.message)))


def _entry(node: Any, part: str | int) -> tuple[Any, Any] | None:
    """The nodes of a key and its value in a mapping, or an item of a list twice; None where there is none."""
    if isinstance(node, MappingNode):
        return next(((key, value) for key, value in reversed(node.value) if key.value == str(part)), None)
    if isinstance(node, SequenceNode) and isinstance(part, int) and part < len(node.value):
        return node.value[part], node.value[part]
    return None


class _Refused(MarkedYAMLError):
    """YAML that a scenario may not contain."""


class _Constructor(SafeConstructor):
    """Constructs dicts with text keys, lists, text, decimal integers, floats, truth values and None.

    Integers such as 01 and 0x1F would silently name the agents 1 and 31.
    """

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """The mapping of a node, with text keys."""
        found = super().construct_mapping(node, deep=deep)
        texts = {str(key): value for key, value in found.items()}
        if len(texts) < len(found):
            keys = ", ".join(texts)
            raise _Refused(
                problem=f"one of the keys {keys} occurs twice, as number and as text", problem_mark=node.start_mark
            )
        return texts

    def construct_yaml_int(self, node: Any) -> Any:
        """The integer of a scalar."""
        value = super().construct_yaml_int(node)
        if node.value.lstrip("+-") != str(abs(value)):
            text = f"{node.value} is the number {value} to YAML: write {value}, or '{node.value}' in quotes for a name"
            raise _Refused(problem=text, problem_mark=node.start_mark)
        return value

    def construct_undefined(self, node: Any) -> None:
        """Refuse a value with a tag."""
        text = f"{node.tag} has no place here: write plain text, numbers, lists and mappings"
        raise _Refused(problem=text, problem_mark=node.start_mark)


_YAML = "tag:yaml.org,2002:"
_Constructor.add_constructor(f"{_YAML}int", _Constructor.construct_yaml_int)
_Constructor.add_constructor(f"{_YAML}timestamp", SafeConstructor.construct_yaml_str)
for _name in ("binary", "set", "omap", "pairs"):
    _Constructor.add_constructor(f"{_YAML}{_name}", _Constructor.construct_undefined)
_Constructor.add_constructor(None, _Constructor.construct_undefined)


def parse(text: str, label: str) -> Any:
    """The YAML 1.2 value of a text, as plain data.

    Raises:
        BadInput: not YAML, a key twice, a tag, or an integer that is not decimal; the message has label, line and
            column.
    """
    return _parsed(text, label)[1]


def _parsed(text: str, label: str) -> tuple[Any, Any]:
    """The root node, which has positions, and its value."""
    yaml = YAML(typ="safe", pure=True)
    yaml.Constructor = _Constructor
    try:
        node = yaml.compose(text)
        return node, None if node is None else yaml.constructor.construct_document(node)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{label}:{mark.line + 1}:{mark.column + 1}" if mark else label
        kind = "" if isinstance(error, _Refused) else "not YAML: "
        raise BadInput(f"{place}: {kind}{error.problem or error.context}") from error
    except (YAMLError, ValueError, RecursionError, NotImplementedError, AttributeError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(f"{label}: not YAML: {reason}") from error


def read_fields(fields: dict[str, Any], overrides: Sequence[str]) -> Document:
    """A mapping of plain data, with overrides.

    Raises:
        BadInput: an override that is none.
    """
    data, keys = assign(fields, overrides, "--set ")
    return Document("", None, data, keys)


def read_document(text: str, label: str, overrides: Sequence[str] = (), given: Mapping[str, Any] = NOTHING) -> Document:
    """A mapping from YAML text, with fields from Python instead of its own, and overrides such as `seed=3`.

    Raises:
        BadInput: not YAML, empty, not a mapping, or an invalid override.
    """
    tree, data = _parsed(text, label)
    if tree is None:
        raise BadInput(f"{label}: the file is empty: `volery new NAME` writes one to start from")
    if not isinstance(data, dict):
        raise BadInput(f"{label}:1:1: a scenario is a mapping of fields, and this is {type(data).__name__}")
    data, keys = assign({**data, **given}, overrides, "--set ")
    return Document(label, tree, data, keys, frozenset(given))


def assign(
    data: dict[str, Any], assignments: Sequence[str], label: str = ""
) -> tuple[dict[str, Any], dict[tuple[str, ...], str]]:
    """`data` with each assignment `KEY=VALUE` made, and the path below which each assignment set everything.

    KEY is a dotted path, with indices into lists; VALUE is YAML. A path through a model of another name replaces it.

    Raises:
        BadInput: no `=`, a value that is not YAML, an index beyond a list; the message starts with `label`.
    """
    keys: dict[tuple[str, ...], str] = {}
    for text in assignments:
        key, equals, value = text.partition("=")
        path = _path(key.strip())
        if not equals or not all(path):
            raise BadInput(f"{label}{text}: write KEY=VALUE, for example links.loss.bernoulli=0.3")
        place = f"{label}{key.strip()}"
        try:
            new = _new_from(data, path)
            data = _put(data, path, parse(value, place), "")
        except BadInput as error:
            raise BadInput(str(error) if str(error).startswith(place) else f"{place}: {error}") from error
        keys = {old: name for old, name in keys.items() if old[: len(new)] != new} | {new: key.strip()}
    return data, keys


def _path(key: str) -> tuple[str, ...]:
    """The parts of a dotted path; an import string such as pkg.module:Class is one of them."""
    path: list[str] = []
    for part in key.split("."):
        path.append(part)
        if ":" in part:
            choices = (place for place, name in enumerate(path) if name in _CHOICES or name.isdecimal())
            first = max(choices, default=len(path) - 2) + 1
            path[first:] = [".".join(path[first:])]
    return tuple(path)


def _chooses(name: str, key: str) -> bool:
    return name in _CHOICES and (name != "topology" or key in (*GRAPHS.names(), "kind"))


def _new_from(node: Any, path: tuple[str, ...]) -> tuple[str, ...]:
    """The start of a path, up to the first part that is absent, no container, or replaced by another model."""
    for depth, part in enumerate(path):
        below = existing(node, (part,))
        if not below:
            replaced = not isinstance(node, dict) or _chooses(path[depth - 1] if depth else "", part)
            return path[: depth if replaced else depth + 1]
        node = node[below[0]]
    return path


def _put(node: Any, path: tuple[str, ...], value: Any, name: str) -> Any:
    """The node with `value` at `path` below it; `name`: the field of the node."""
    if not path:
        return value
    head, rest = path[0], path[1:]
    chooses = _chooses(name, head)
    if isinstance(node, list) and (head.isdecimal() or not chooses):
        if not head.isdecimal() or int(head) >= len(node):
            raise BadInput(f"{name!r} is a list of {len(node)}, {head!r} is no index into it; the first is 0")
        index = int(head)
        return [*node[:index], _put(node[index], rest, value, head), *node[index + 1 :]]
    kept = {"kind": node} if name in _BY_KIND and isinstance(node, str) else node if isinstance(node, dict) else {}
    if chooses and head not in kept:
        kept = {}
    return {**kept, head: _put(kept.get(head), rest, value, head)}
