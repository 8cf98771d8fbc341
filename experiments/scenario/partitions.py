"""Partitions by name: which agents can still hear which, and the links that this cuts.

The kinds are those of Jepsen's nemesis (bisect, split-one, bridge, majorities-ring), for any graph: a link is cut if
its target may not hear its source.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from ...errors import BadInput
from ...names import did_you_mean
from ...randomness import stream
from ...transport.faults import LinkName
from .fault_places import Places, Words, check_agent, parse_agents, read_words
from .settings_reading import Reader, alternatives

REST = "rest"
_ALONE = ("halves", "random", "majority-ring")
_OF_AGENTS = ("isolate", "bridge")
_HOW = f"write {', '.join(_ALONE)}, isolate 5, bridge 5, or groups of agents: [[1, 2], [3, 4]]"

Receiver = Mapping[str, frozenset[str]]
"""Agent → the agents that it can hear, including itself."""


@dataclass(frozen=True)
class Partition:
    """A partition as it is given: its kind, and the groups of agents that it names."""

    kind: str
    groups: tuple[tuple[str, ...], ...] = ()

    def dump(self) -> Any:
        """Plain data from which an equal partition is read."""
        if self.kind == "groups":
            return [list(group) for group in self.groups]
        return {self.kind: list(self.groups[0])} if self.groups else self.kind


def read_partition(value: Any) -> Partition:
    """A partition from a name, `{isolate: 5}`, `isolate 5`, or a list of groups of agents.

    As a text, `1,2 3,4` is two groups.

    Raises:
        BadInput: not a partition.
    """
    if isinstance(value, str):
        name, *rest = value.split() or [""]
        if name in _OF_AGENTS:
            value = {name: ",".join(rest)}
        elif name not in _ALONE or rest:
            value = [name, *rest]
        else:
            return Partition(name)
    if isinstance(value, list):
        return Partition("groups", _groups(value))
    if not isinstance(value, dict) or len(value) != 1:
        raise BadInput(f"{value!r} is no partition: {_HOW}")
    ((name, members),) = value.items()
    if name not in _OF_AGENTS:
        raise BadInput(f"{name!r} is no partition{did_you_mean(name, _OF_AGENTS)}: {_HOW}")
    return Partition(name, (read_words(members),))


def _groups(value: list[Any]) -> tuple[tuple[str, ...], ...]:
    if len(value) < 2:
        known = did_you_mean(str(value[0]), (*_ALONE, *_OF_AGENTS)) if value else ""
        raise BadInput(f"one group is no partition{known}: {_HOW}; `{REST}` is a group of all others")
    return tuple(read_words(group) for group in value)


@dataclass(frozen=True)
class _Named:
    """A partition that names agents.

    isolate: agents that are each cut off from all others.
    bridge: the one agent that both halves can hear.
    """

    isolate: Words | None = None
    bridge: Words | None = None


PartitionWord = Annotated[
    Partition,
    Reader(
        read_partition,
        lambda: alternatives(
            _Named, Literal["halves", "random", "majority-ring"], str, list[str | int | list[str | int]]
        ),
        dump=Partition.dump,
    ),
]


def crossing(partition: Partition, places: Places) -> tuple[LinkName, ...]:
    """The links that a partition cuts, in natural order.

    Raises:
        BadInput: an unknown agent, one on two sides or on none, or a partition that cuts no link.
    """
    hears = _HEARS[partition.kind](partition, places)
    cut = tuple((source, target) for source, target in places.links if source not in hears[target])
    if not cut:
        raise BadInput("this partition cuts no link: it keeps no agent from a neighbour")
    return cut


def _sides(sides: Iterable[Iterable[str]]) -> dict[str, frozenset[str]]:
    return {agent: frozenset(side) for side in map(tuple, sides) for agent in side}


def _bisected(agents: Sequence[str]) -> tuple[Sequence[str], Sequence[str]]:
    """Two halves; the second has one more of an odd number."""
    middle = len(agents) // 2
    return agents[:middle], agents[middle:]


def _shuffled(places: Places) -> list[str]:
    """The agents in a random order from the seed and the fault's id, one draw an agent."""
    draws = {name: stream(places.seed, "partition", places.fault_id, name).uniform(0) for name in places.agents}
    return sorted(places.agents, key=lambda name: draws[name])


def _halves(_partition: Partition, places: Places) -> Receiver:
    return _sides(_bisected(places.agents))


def _random(_partition: Partition, places: Places) -> Receiver:
    return _sides(_bisected(_shuffled(places)))


def _isolated(partition: Partition, places: Places) -> Receiver:
    alone = parse_agents(partition.groups[0], places)
    return _sides([*((agent,) for agent in alone), [agent for agent in places.agents if agent not in alone]])


def _bridged(partition: Partition, places: Places) -> Receiver:
    """Two halves, and one agent that can hear both and that both can hear."""
    words = partition.groups[0]
    if len(words) != 1:
        raise BadInput(f"a bridge is one agent, not {len(words)}: write bridge 5")
    bridge = check_agent(words[0], places)
    halves = _bisected([agent for agent in places.agents if agent != bridge])
    hears = _sides([*half, bridge] for half in halves)
    return {**hears, bridge: frozenset(places.agents)}


def _majority_ring(_partition: Partition, places: Places) -> Receiver:
    """On a random ring each agent can hear the ⌊n/2⌋ + 1 agents about it: a majority, and no two the same one."""
    ring = _shuffled(places)
    count = len(ring)
    majority = count // 2 + 1
    return {
        agent: frozenset(ring[(place - majority // 2 + step) % count] for step in range(majority))
        for place, agent in enumerate(ring)
    }


def _grouped(partition: Partition, places: Places) -> Receiver:
    sides = [() if group == (REST,) else parse_agents(group, places) for group in partition.groups]
    sides_of: dict[str, int] = {}
    for number, side in enumerate(sides):
        for agent in side:
            if agent in sides_of:
                raise BadInput(f"agent {agent} is on two sides of the partition: name it once")
            sides_of[agent] = number
    left = [agent for agent in places.agents if agent not in sides_of]
    if left and (REST,) not in partition.groups:
        raise BadInput(f"agent {', '.join(left)} is on no side of the partition: add `{REST}`, a side of all others")
    return _sides([*sides, left])


_HEARS: dict[str, Callable[[Partition, Places], Receiver]] = {
    "halves": _halves,
    "random": _random,
    "isolate": _isolated,
    "bridge": _bridged,
    "majority-ring": _majority_ring,
    "groups": _grouped,
}
