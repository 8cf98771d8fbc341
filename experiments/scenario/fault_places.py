"""Places of faults, given as words: links, agents and sensors, groups of agents, all, or a random fraction."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Annotated, Any, TypeVar

from ...agents.plan import Coupled, Plan, World
from ...errors import BadInput
from ...randomness import stream
from ...topologies import check_name, natural_key, ordered
from ...transport.faults import LinkName
from ...units import Probability
from .settings_reading import Reader, alternatives, typed

ALL, RANDOM = "all", "random"
_LISTED = 8
_HOW = "write 3-7, 3>7, the name of an agent or a group, random 0.3, or all"

SensorName = tuple[str, str]
Name = TypeVar("Name", bound=tuple[str, ...])


@dataclass(frozen=True)
class Places:
    """Everything that words may name.

    edges: links, at least one direction of each.
    groups: name → agents.
    seed: seed of random fractions, together with the id of the fault.
    world: the world, which knows the sensors.
    fault_id: id of the fault.
    """

    edges: Collection[LinkName]
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    seed: int = 0
    world: World | Coupled | None = None
    fault_id: str = ""

    @cached_property
    def links(self) -> tuple[LinkName, ...]:
        """Both directions of every edge, in natural order."""
        return _both_directions(tuple(self.edges))

    @cached_property
    def neighbours(self) -> Mapping[str, Sequence[str]]:
        """Agents and their neighbours, in natural order."""
        return _neighbours(tuple(self.edges))

    @property
    def agents(self) -> tuple[str, ...]:
        """The ends of all links, in natural order."""
        return tuple(self.neighbours)


@lru_cache(maxsize=8)
def _both_directions(edges: tuple[LinkName, ...]) -> tuple[LinkName, ...]:
    return _in_order({link for first, second in edges for link in ((first, second), (second, first))})


@lru_cache(maxsize=8)
def _neighbours(edges: tuple[LinkName, ...]) -> Mapping[str, Sequence[str]]:
    found: dict[str, list[str]] = {}
    for source, target in _both_directions(edges):
        found.setdefault(source, []).append(target)
    return found


def places_of(plan: Plan) -> Places:
    """What faults of a plan may name."""
    return Places(tuple(plan.links), plan.groups, plan.seed, plan.coupled or plan.world)


def _in_order(links: Iterable[LinkName]) -> tuple[LinkName, ...]:
    return tuple(sorted(links, key=lambda link: (natural_key(link[0]), natural_key(link[1]))))


# -- words --------------------------------------------------------------------------------------------------------


def read_words(value: Any) -> tuple[str, ...]:
    """Names of places: one or a list, each a number or a text with names separated by commas.

    `random 0.3`, or {random: 0.3}, is one word.

    Raises:
        BadInput: no word, a value that is neither text nor number, or an invalid fraction.
    """
    words: list[str] = []
    for item in value if isinstance(value, list) else [value]:
        if isinstance(item, Mapping) and set(item) == {RANDOM}:
            words += [RANDOM, str(item[RANDOM])]
        elif isinstance(item, bool) or not isinstance(item, str | int):
            raise BadInput(f"{item!r} names nothing: {_HOW}")
        else:
            words += str(item).replace(",", " ").split()
    if not words:
        raise BadInput(f"nothing is named: {_HOW}")
    return tuple(_joined(words))


def _joined(words: Sequence[str]) -> Iterable[str]:
    following = iter(words)
    for word in following:
        if word != RANDOM:
            yield word
            continue
        share = next(following, "")
        yield f"{RANDOM} {share}"
        if not 0 < _number(share) <= 1:
            raise BadInput(f"random is {share or 'not given'}, a fraction lies above 0 and is at most 1: random 0.3")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


@dataclass(frozen=True)
class Share:
    """A random fraction of all, drawn from the seed.

    random: the fraction.
    """

    random: Probability


Words = Annotated[
    tuple[str, ...], Reader(read_words, lambda: alternatives(str, int, Share, list[str | int | Share]), dump=list)
]
"""Names of links, agents or sensors."""


def read_groups(value: Any) -> dict[str, tuple[str, ...]]:
    """The scenario's `groups:`, name → agents.

    Raises:
        BadInput: not a mapping to lists of names, an empty list, an agent twice, or an invalid name.
    """
    if not isinstance(value, Mapping):
        raise BadInput(f"should be a mapping of names to lists of agents, not {value!r}")
    groups: dict[str, tuple[str, ...]] = {}
    for name, members in value.items():
        check_name(name)
        if name in (ALL, RANDOM):
            raise BadInput(f"a group cannot be called {name}, which means something else where places are named")
        listed = read_words(members)
        if twice := _twice(listed):
            raise BadInput(f"group {name} has agent {twice} twice")
        groups[name] = listed
    return groups


Groups = Annotated[
    Mapping[str, tuple[str, ...]],
    Reader(read_groups, lambda: typed(dict[str, str | int | list[str | int]]), dump=lambda groups: {**groups}),
]


def _twice(words: Sequence[str]) -> str | None:
    return next((word for index, word in enumerate(words) if word in words[:index]), None)


def group_problems(groups: Mapping[str, tuple[str, ...]], agents: Collection[str]) -> Iterable[tuple[str, str]]:
    """What is wrong with groups: (group, sentence)."""
    for name, members in groups.items():
        if name in agents:
            yield name, f"{name} is the name of an agent: call the group something else"
        if strangers := [member for member in members if member not in agents]:
            yield name, f"there is no agent {', '.join(strangers)}; agents: {_listing(agents)}"


# -- links --------------------------------------------------------------------------------------------------------


def parse_links(words: str | Sequence[str], places: Places) -> tuple[LinkName, ...]:
    """The directed links that the words name, in natural order.

    `3-7`: both directions; `3>7`: one. An end may be a group, which stands for each of its members. An agent's or a
    group's name alone: all links that touch it; `all`: all links; `random 0.3`: that fraction of the edges, in both
    directions. Several words may be given, in a sequence or separated by commas.

    Raises:
        BadInput: no words, or an unknown link or agent.
    """
    listed = read_words(words if isinstance(words, str) else list(words))
    return _in_order({link for word in listed for link in _links_of(word, places)})


def changed_links(words: Sequence[str], changes: Mapping[str, Any], places: Places) -> tuple[LinkName, ...]:
    """The links that the words name, checked for these changes.

    Raises:
        BadInput: an unknown link or agent, or a change of the medium in only one direction of an edge.
    """
    changed = parse_links(words, places)
    for source, target in changed if "medium" in changes else ():
        if (target, source) not in changed:
            raise BadInput(f"an edge has one medium, {source}>{target} is half of one: write {source}-{target}")
    return changed


def _links_of(word: str, places: Places) -> Iterable[LinkName]:
    if word == ALL:
        return places.links
    if word.startswith(f"{RANDOM} "):
        edges = [link for link in places.links if ordered(*link) == link]
        return [link for edge in _drawn(word, edges, places, "edges") for link in (edge, edge[::-1])]
    for sign in "->":
        first, found, second = word.partition(sign)
        if found:
            forth = _between(first, second, word, places)
            return [*forth, *(link[::-1] for link in forth)] if sign == "-" else forth
    members = _members(word, places)
    return [link for link in places.links if members & set(link)]


def _between(first: str, second: str, word: str, places: Places) -> list[LinkName]:
    sources, targets = _members(first, places, word), _members(second, places, word)
    found = [(source, target) for source in sources for target in places.neighbours[source] if target in targets]
    if not found:
        near = dict.fromkeys(
            each for source in sorted(sources) for each in places.neighbours[source] if each not in sources
        )
        raise BadInput(f"{word}: {first} and {second} have no link; neighbours of {first}: {', '.join(near) or 'none'}")
    return found


def _members(word: str, places: Places, within: str = "") -> set[str]:
    return set(places.groups.get(word) or [check_agent(word, places, within)])


def _drawn(word: str, names: Sequence[Name], places: Places, what: str) -> Sequence[Name]:
    """The fraction with the smallest draws, one draw a name, so that a further name shifts no other draw."""
    share = float(word.removeprefix(RANDOM))
    count = math.floor(share * len(names) + 0.5)
    if count == 0:
        raise BadInput(f"{word} of {len(names)} {what} is none of them: take a larger fraction")
    draws = {name: stream(places.seed, "fault-place", places.fault_id, *name).uniform(0) for name in names}
    return sorted(names, key=lambda name: draws[name])[:count]


# -- agents and sensors -------------------------------------------------------------------------------------------


def check_agent(name: str, places: Places, within: str = "") -> str:
    """The name of an agent, checked; `within`: the word that it is part of.

    Raises:
        BadInput: no such agent.
    """
    if name in places.neighbours:
        return name
    place = f"{within}: " if within and within != name else ""
    groups = f"; groups: {', '.join(places.groups)}" if places.groups else ""
    raise BadInput(f"{place}there is no agent {name!r}; agents: {_listing(places.agents)}{groups}")


def _listing(agents: Collection[str]) -> str:
    names = sorted(agents, key=natural_key)
    return ", ".join(names) if len(names) <= _LISTED else f"{names[0]} … {names[-1]}"


def parse_agents(words: Sequence[str], places: Places) -> tuple[str, ...]:
    """The agents that the words name, in natural order: names, groups, `all`, `random 0.3`.

    Raises:
        BadInput: an unknown agent.
    """
    found = {name for word in words for name in _agents_of(word, places)}
    return tuple(sorted(found, key=natural_key))


def _agents_of(word: str, places: Places) -> Iterable[str]:
    if word == ALL:
        return places.agents
    if word.startswith(f"{RANDOM} "):
        return [name for (name,) in _drawn(word, [(name,) for name in places.agents], places, "agents")]
    return _members(word, places)


def parse_sensors(words: Sequence[str], places: Places) -> tuple[SensorName, ...]:
    """The sensors that the words name, in natural order: `2.distance`, `left.distance`, `all.distance`.

    Raises:
        BadInput: an unknown agent or sensor, or a scenario without a world.
    """
    found = {name for word in words for name in _sensors_of(word, places)}
    return tuple(sorted(found, key=lambda name: (natural_key(name[0]), name[1])))


def _sensors_of(word: str, places: Places) -> Iterable[SensorName]:
    agents, dot, sensor = word.rpartition(".")
    if not dot:
        raise BadInput(f"{word!r} names no sensor: write an agent and its sensor, as in 2.distance")
    if places.world is None:
        raise BadInput(f"{word}: there is no world, so no agent has a sensor")
    for agent in _agents_of(agents, places):
        known = places.world.sensors(agent)
        if sensor not in known:
            raise BadInput(f"{word}: agent {agent} has no sensor {sensor!r}; it has {', '.join(known) or 'none'}")
        yield agent, sensor
