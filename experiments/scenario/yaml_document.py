"""Reading YAML with positions: where each value stands, overrides from the command line, errors that name the place."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any, Literal, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.constructor import RoundTripConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.scalarbool import ScalarBoolean

from ...errors import BadInput

Loc = tuple[str | int, ...]
"""Where a value stands: keys and indices from the top."""

_CHOICES = {"loss", "corruption", "latency", "access", "topology", "altitude", "roll", "pitch", "sensor"}
"""Fields in which one key chooses a model: to set another key there is to choose another model."""
_BESIDE_A_CHOICE = {"spacing", "seed", "radius", "side", "probability", "neighbours", "rewiring"}
"""Fields that may stand beside such a key and choose nothing."""


class Problem(NamedTuple):
    """Something wrong at a place, with a value or a key there, or with a field that should be there.

    Parts of `loc` that the file does not have are skipped; a missing field is named all the same.
    """

    loc: Loc
    message: str
    about: Literal["value", "key", "missing field"] = "value"


@dataclass(frozen=True)
class Document:
    """A mapping read from a file, with overrides applied.

    `tree` is what the file says, with positions; `data` what holds, as plain values; `overrides` maps the path
    from which on an override made everything new to its key as it was written.
    """

    label: str
    tree: Any
    data: dict[str, Any]
    overrides: dict[tuple[str, ...], str]

    def error(self, problems: Iterable[Problem]) -> BadInput:
        """One error that lists all problems, a line each: place, field, message."""
        return BadInput("\n".join(self._line(problem) for problem in problems))

    def _line(self, problem: Problem) -> str:
        place = self._place(existing(self.data, problem.loc), of_key=problem.about == "key")
        what = describe(self.data, problem)
        return f"{place}: {what.removeprefix(place.removeprefix('--set ') + ': ')}"

    def is_overridden(self, path: Loc) -> bool:
        """Whether a value comes from the command line and not from the file."""
        return bool(self._covering(path))

    def _covering(self, path: Loc) -> list[tuple[str, ...]]:
        words = _words(path)
        return [override for override in self.overrides if override == words[: len(override)]]

    def _place(self, path: Loc, of_key: bool) -> str:
        """The position of a value or its key, or the override that it came from."""
        if covering := self._covering(path):
            return f"--set {self.overrides[max(covering, key=len)]}"
        tree, mark = self.tree, _mark(self.tree, None) or (0, 0)
        for depth, part in enumerate(path, start=1):
            mark = _mark(tree, part, of_key and depth == len(path)) or mark
            tree = _child(tree, part)
        return f"{self.label}:{mark[0] + 1}:{mark[1] + 1}"


def _words(path: Loc) -> tuple[str, ...]:
    return tuple(str(part) for part in path)


def existing(data: Any, loc: Loc) -> Loc:
    """The parts of a place that stand in the data, indices as numbers, without what only the validator knows."""
    path: Loc = ()
    for part in loc:
        index = int(part) if isinstance(data, list) and str(part).isdecimal() else part
        keys: Any = data if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
        if index in keys:
            data = data[index]
            path = (*path, index)
    return path


def describe(data: Any, problem: Problem) -> str:
    """The field and what is wrong with it, as `links.rate: is missing`."""
    path = existing(data, problem.loc) + (problem.loc[-1:] if problem.about == "missing field" else ())
    return ": ".join(filter(None, (".".join(_words(path)), problem.message)))


def _key(tree: Any, part: str | int) -> Any:
    """The key as the file has it: `1` and not `"1"`."""
    return next((key for key in tree if str(key) == part), part) if isinstance(tree, CommentedMap) else part


def _child(tree: Any, part: str | int) -> Any:
    try:
        return tree[_key(tree, part)]
    except (KeyError, IndexError, TypeError):
        return None


def _mark(tree: Any, part: str | int | None, of_key: bool = False) -> tuple[int, int] | None:
    """Line and column, from 0, of a container (`part` None) or of what is in it; None where the file has none."""
    if not isinstance(tree, CommentedMap | CommentedSeq):
        return None
    if part is None:
        return tree.lc.line, tree.lc.col
    try:
        if isinstance(tree, CommentedMap):
            mark = (tree.lc.key if of_key else tree.lc.value)(_key(tree, part))
        else:
            mark = tree.lc.item(part)
    except (KeyError, TypeError, IndexError):
        return None
    return (mark[0], mark[1])


class _NotDecimal(MarkedYAMLError):
    """An integer of which the text is lost where a name is meant, such as 01."""


class _Constructor(RoundTripConstructor):
    """Constructs decimal integers only: 01 and 0x1F would silently name the agents 1 and 31."""

    def construct_yaml_int(self, node: Any) -> Any:
        """The integer of a scalar."""
        value = super().construct_yaml_int(node)
        if node.value.lstrip("+-") != str(abs(value)):
            text = f"{node.value} is the number {value} to YAML: write {value}, or '{node.value}' in quotes for a name"
            raise _NotDecimal(problem=text, problem_mark=node.start_mark)
        return value


_Constructor.add_constructor("tag:yaml.org,2002:int", _Constructor.construct_yaml_int)


def parse(text: str, label: str) -> Any:
    """The YAML 1.2 value of a text, with positions.

    Raises:
        BadInput: not YAML, a key twice, or an integer that is not decimal; the message has label, line and column.
    """
    yaml = YAML(typ="rt", pure=True)
    yaml.Constructor = _Constructor
    try:
        return yaml.load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{label}:{mark.line + 1}:{mark.column + 1}" if mark else label
        kind = "" if isinstance(error, _NotDecimal) else "not YAML: "
        raise BadInput(f"{place}: {kind}{error.problem or error.context}") from error
    except (YAMLError, ValueError, RecursionError, NotImplementedError, AttributeError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(f"{label}: not YAML: {reason}") from error


def plain(value: Any) -> Any:
    """A YAML value as dict with text keys, list, text, number, truth value or None.

    Raises:
        BadInput: a tag, or a key that occurs twice, as number and as text.
    """
    if isinstance(value, dict):
        result = {str(key): plain(item) for key, item in value.items()}
        if len(result) < len(value):
            raise BadInput(f"one of the keys {', '.join(result)} occurs twice, as number and as text")
        return result
    if isinstance(value, list):
        return [plain(item) for item in value]
    if isinstance(value, ScalarBoolean):
        return bool(value)
    for kind in (bool, str, int, float):
        if isinstance(value, kind):
            return kind(value)
    if value is None or isinstance(value, date):
        return value and str(value)
    raise BadInput(f"{getattr(value, 'tag', value)} has no place here: write plain text, numbers, lists and mappings")


def read_document(text: str, label: str, overrides: Sequence[str] = ()) -> Document:
    """A mapping from YAML text, with overrides such as `links.loss.bernoulli=0.3`.

    Raises:
        BadInput: not YAML, empty, not a mapping, or an override that is none.
    """
    tree = parse(text, label)
    if tree is None:
        raise BadInput(f"{label}: the file is empty: `volery new NAME` writes one to start from")
    if not isinstance(tree, dict):
        raise BadInput(f"{label}:1:1: a scenario is a mapping of fields, and this is {type(tree).__name__}")
    try:
        data = plain(tree)
    except BadInput as error:
        raise BadInput(f"{label}: {error}") from error
    data, keys = assign(data, overrides, "--set ")
    return Document(label, tree, data, keys)


def assign(
    data: dict[str, Any], assignments: Sequence[str], label: str = ""
) -> tuple[dict[str, Any], dict[tuple[str, ...], str]]:
    """`data` with each `KEY=VALUE` put in its place, and for each the path from which on it made everything new.

    KEY is a dotted path, with indices into lists; VALUE is YAML. A path through a model of another name replaces it.

    Raises:
        BadInput: no `=`, a value that is not YAML, an index beyond a list; the message starts with `label`.
    """
    keys: dict[tuple[str, ...], str] = {}
    for text in assignments:
        key, equals, written = text.partition("=")
        path = tuple(key.strip().split("."))
        if not equals or not all(path):
            raise BadInput(f"{label}{text}: write KEY=VALUE, for example links.loss.bernoulli=0.3")
        place = f"{label}{key.strip()}"
        try:
            new = _new_from(data, path)
            data = _put(data, path, plain(parse(written, place)), "")
        except BadInput as error:
            raise BadInput(str(error) if str(error).startswith(place) else f"{place}: {error}") from error
        keys = {old: name for old, name in keys.items() if old[: len(new)] != new} | {new: key.strip()}
    return data, keys


def _chooses(name: str, key: str) -> bool:
    return name in _CHOICES and key not in _BESIDE_A_CHOICE


def _new_from(node: Any, path: tuple[str, ...]) -> tuple[str, ...]:
    """The first part of a path: up to what is not there, is no container, or gives way to another model."""
    for depth, part in enumerate(path):
        below = existing(node, (part,))
        if not below:
            replaced = not isinstance(node, dict) or _chooses(path[depth - 1] if depth else "", part)
            return path[: depth if replaced else depth + 1]
        node = node[below[0]]
    return path


def _put(node: Any, path: tuple[str, ...], value: Any, name: str) -> Any:
    """The node with `value` at `path` below it; `name` is the field that the node stands in."""
    if not path:
        return value
    head, rest = path[0], path[1:]
    chooses = _chooses(name, head)
    if isinstance(node, list) and (head.isdecimal() or not chooses):
        if not head.isdecimal() or int(head) >= len(node):
            raise BadInput(f"{name!r} is a list of {len(node)}, {head!r} is no index into it; the first is 0")
        index = int(head)
        return [*node[:index], _put(node[index], rest, value, head), *node[index + 1 :]]
    kept = node if isinstance(node, dict) else {}
    if chooses and head not in kept:
        kept = {}
    return {**kept, head: _put(kept.get(head), rest, value, head)}
