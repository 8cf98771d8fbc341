"""Faults as they are written, in a scenario's timeline or on the command line."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cache, partial
from typing import Annotated, Any, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from ..errors import BadInput
from ..topologies import natural_key
from ..transport.faults import Fault, Kill, LinkFault, LinkName, Pause
from ..units import Nanoseconds
from .explaining import explain, schema_fields
from .link_schema import STRICT, LinkFields, LinkWords, Reader, read_words, validated
from .reading import describe
from .writing import quantity

ALL = "all"
_LISTED = 8
_ACTIONS = ("cut", "kill", "pause", "set")


def parse_links(words: str | Sequence[str], links: Collection[LinkName]) -> tuple[LinkName, ...]:
    """The directed links that the words name, in natural order.

    `3-7` is both directions, `3>7` one, an agent's name all of its links, `all` all there are; several may be given, in
    a sequence or separated by commas.

    Args:
        words: what is written.
        links: the links that exist; one direction of an edge is enough.
    Raises:
        BadInput: no words, or a link or an agent that does not exist.
    """
    both = {*links, *((target, source) for source, target in links)}
    listed = read_words([words] if isinstance(words, str) else list(words))
    found = {link for word in listed for link in _links_of(word, both)}
    return tuple(sorted(found, key=lambda link: (natural_key(link[0]), natural_key(link[1]))))


def changed_links(
    words: Sequence[str], changes: Mapping[str, Any], links: Collection[LinkName]
) -> tuple[LinkName, ...]:
    """The links that the words name, for these changes.

    Raises:
        BadInput: a link or an agent that does not exist, or another medium for one direction of an edge only.
    """
    changed = parse_links(words, links)
    for source, target in changed if "medium" in changes else ():
        if (target, source) not in changed:
            raise BadInput(f"an edge has one medium, {source}>{target} is half of one: write {source}-{target}")
    return changed


def _links_of(word: str, links: Collection[LinkName]) -> Iterable[LinkName]:
    if word == ALL:
        return links
    agents = {source for source, _ in links}
    for sign in "->":
        source, found, target = word.partition(sign)
        if found:
            for end in (source, target):
                check_agent(end, agents, word)
            if (source, target) not in links:
                near = ", ".join(sorted((other for end, other in links if end == source), key=natural_key))
                raise BadInput(f"{word}: {source} and {target} have no link; neighbours of {source}: {near}")
            return [(source, target), (target, source)] if sign == "-" else [(source, target)]
    check_agent(word, agents, word)
    return [link for link in links if word in link]


def check_agent(name: str, agents: Collection[str], word: str = "") -> str:
    """The name, if there is such an agent.

    Raises:
        BadInput: there is none.
    """
    if name in agents:
        return name
    place = f"{word}: " if word and word != name else ""
    names = sorted(agents, key=natural_key)
    known = ", ".join(names) if len(names) <= _LISTED else f"{names[0]} … {names[-1]}"
    raise BadInput(f"{place}there is no agent {name!r}; agents: {known}")


def _read_agent(value: Any) -> str:
    words = read_words(value)
    if isinstance(value, list) or len(words) != 1:
        raise BadInput(f"{value!r} should be the name of one agent")
    return words[0]


def _not_before_the_start(at_ns: int) -> int:
    if at_ns < 0:
        raise BadInput(f"at is {quantity(at_ns, 'ns')}: a fault starts at 0 or later")
    return at_ns


AgentWord = Annotated[str, Reader(_read_agent, str | int)]


class FaultEntry(BaseModel):
    """One entry of a scenario's `faults:`, as it is written."""

    model_config = STRICT

    at: Annotated[Nanoseconds, AfterValidator(_not_before_the_start)]
    until: Nanoseconds | None = None
    for_: Nanoseconds | None = Field(default=None, alias="for")
    cut: LinkWords | None = None
    kill: AgentWord | None = None
    pause: AgentWord | None = None
    where: LinkWords | None = None
    set_: LinkFields | None = Field(default=None, alias="set")

    @field_validator("until")
    @classmethod
    def _after_the_start(cls, until: int | None, info: ValidationInfo) -> int | None:
        if until is not None and until <= info.data.get("at", -1):
            at = quantity(info.data["at"], "ns")
            raise BadInput(f"until is {quantity(until, 'ns')} and at {at}: a fault ends after it starts")
        return until

    @field_validator("for_")
    @classmethod
    def _lasts(cls, duration: int | None) -> int | None:
        if duration is not None and duration <= 0:
            raise BadInput(f"for is {quantity(duration, 'ns')}: a fault lasts longer than 0")
        return duration

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        actions = [name for name in _ACTIONS if self.written(name) is not None]
        if len(actions) != 1:
            raise BadInput(f"a fault is exactly one of {', '.join(_ACTIONS)}, not {' and '.join(actions) or 'none'}")
        if self.until is not None and self.for_ is not None:
            raise BadInput("write until or for, not both")
        if (self.set_ is None) != (self.where is None):
            raise BadInput("set and where belong together: where: 3-7, set: {loss: 0.5}")
        if self.set_ is not None and not self.set_:
            raise BadInput("set is empty: write for example set: {loss: 0.5}")
        return self

    def written(self, name: str) -> Any:
        """The value of the field of this name in the file."""
        return self.set_ if name == "set" else getattr(self, name)

    @property
    def until_ns(self) -> int | None:
        """When the fault ends; None: never."""
        return self.until if self.for_ is None else self.at + self.for_

    @property
    def place(self) -> str:
        """The field that says where."""
        return next(name for name in ("where", *_ACTIONS) if self.written(name) is not None)


def expand(entry: FaultEntry, fault_id: str, links: Collection[LinkName]) -> Fault:
    """The fault that an entry asks for.

    Raises:
        BadInput: a link or an agent that does not exist.
    """
    agents = {end for link in links for end in link}
    times = (fault_id, entry.at, entry.until_ns)
    if entry.kill is not None:
        return Kill(*times, check_agent(entry.kill, agents))
    if entry.pause is not None:
        return Pause(*times, check_agent(entry.pause, agents))
    if entry.cut is not None:
        return LinkFault(*times, parse_links(entry.cut, links), {"cut": True})
    changes: dict[str, Any] = dict(entry.set_ or {})
    return LinkFault(*times, changed_links(entry.where or (), changes, links), changes)


_ENTRY: TypeAdapter[FaultEntry] = TypeAdapter(FaultEntry)


@cache
def _entry_schema() -> dict[str, Any]:
    return _ENTRY.json_schema()


def parse_fault(written: Mapping[str, Any], fault_id: str, at_ns: int, links: Collection[LinkName]) -> Fault:
    """A live fault, written as an entry of the timeline without `at`: {"cut": "3-7", "for": "2s"}.

    Raises:
        BadInput: what is wrong with it, all at once.
    """
    try:
        entry = validated(_ENTRY, {**written, "at": f"{at_ns} ns"})
    except ValidationError as error:
        problems = explain(error, partial(schema_fields, _entry_schema()))
        raise BadInput("; ".join(describe(written, problem) for problem in problems)) from error
    return expand(entry, fault_id, links)
