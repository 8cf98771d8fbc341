"""A plan: a scenario resolved to plain data, all that an engine needs. `plan_codec` encodes it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from ..topologies import Span
from ..transport.faults import Fault, Kill, LinkName, kills_of
from ..transport.links import LinkSettings
from ..units import SampleTimes

MILLISECOND_NS = 1_000_000
WORLD = "world"
"""Name of the agent that a coupled world runs as."""


class World(Protocol):
    """The sensors that look at the truth: pure functions of seed and time."""

    def sensors(self, agent: str) -> Mapping[str, SampleTimes]:
        """Sensor name → when it samples, for one agent."""

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """The sensor's index-th sample, (k,), or (n, k) whose first column says what each row measures.

        None where it sees nothing. Faults leave the first column alone.
        """


@runtime_checkable
class Moving(Protocol):
    """A world in which agents move, if `moves` says so."""

    @property
    def moves(self) -> bool:
        """Whether they do."""

    def position(self, agent: str, time_ns: int) -> NDArray[np.float64]:
        """Position of one agent at an instant, shape (2,) or (3,) [m]."""


def moving(world: object) -> Moving | None:
    """The world, if agents move in it; else None."""
    return world if isinstance(world, Moving) and world.moves else None


@runtime_checkable
class FrameMeasuring(Protocol):
    """A world in which agents measure something from the frames that they receive, if `measures_frames` says so."""

    @property
    def measures_frames(self) -> bool:
        """Whether they do."""

    def measure_frame(
        self, source: str, target: str, time_ns: int, incarnation: int, sequence: int, copy: int
    ) -> NDArray[np.float64] | None:
        """What `target` measures from a frame whose transmission started at an instant, (k,); None if nothing."""


def frame_measuring(world: object) -> FrameMeasuring | None:
    """The world, if agents measure something from frames; else None."""
    return world if isinstance(world, FrameMeasuring) and world.measures_frames else None


@runtime_checkable
class Modelled(Protocol):
    """A world of which agents know something before the start."""

    @property
    def model(self) -> Any:
        """Rates, noise and statistics, as data sheets have them; nothing that depends on what happens in the run."""


class Running(Protocol):
    """A coupled world as it runs: a state machine without a clock, at the instant to which it was advanced last."""

    def advance(self, time_ns: int) -> None:
        """Advance to an instant, which is not before the present one."""

    def act(self, agent: str, command: str, value: NDArray[np.float64]) -> None:
        """Let an agent's command take effect.

        Raises:
            BadInput: there is no such command, or it has another length.
        """

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """The sensor's index-th sample, taken now, (k,), or (n, k) whose first column says what each row measures.

        None where it sees nothing. Faults leave the first column alone.
        """

    def truth(self) -> Mapping[str, NDArray[np.float64]]:
        """Quantity → its true value now; "quantity@agent" where it is that of one agent."""

    def events(self) -> list[dict[str, Any]]:
        """Events since the last call, each {"event": …, "time_ns": …, …} of plain values."""


@runtime_checkable
class Coupled(Protocol):
    """A world that agents act upon, so that measurements depend on commands: it runs as an agent of its own.

    Both delays are at least 1.
    """

    @property
    def sense_delay_ns(self) -> int:
        """Delay from the taking of a sample to its arrival."""

    @property
    def act_delay_ns(self) -> int:
        """Delay from a command to its effect."""

    @property
    def truth_rate(self) -> float:
        """Rate at which the truth is reported [Hz]."""

    def sensors(self, agent: str) -> Mapping[str, SampleTimes]:
        """Sensor name → when it samples, for one agent."""

    def begin(self) -> Running:
        """The world at instant 0."""


@dataclass(frozen=True)
class AgentPlan:
    """One agent: its kind (a registered name or `package.module:Class`), parameters and place in the graph.

    `position` is in metres about the centroid, where the topology has positions. `wired`: to whom it is joined by wires
    that nothing impairs, such as a coupled world.
    """

    name: str
    kind: str
    parameters: Any
    neighbours: tuple[str, ...]
    degrees: Mapping[str, int]
    position: tuple[float, ...] | None = None
    compute_ns: int = MILLISECOND_NS
    wired: tuple[str, ...] = ()


@dataclass(frozen=True)
class PublicPlan:
    """What all agents may know of a plan before the start: neither its world nor its faults.

    `links` as in `Plan`. `model`: what is known of the world beforehand, see `Modelled`; None if nothing is.
    """

    seed: int
    agents: tuple[AgentPlan, ...]
    links: Mapping[LinkName, LinkSettings]
    model: Any = None

    def agent(self, name: str) -> AgentPlan:
        """The agent of this name."""
        return next(agent for agent in self.agents if agent.name == name)


@dataclass(frozen=True, repr=False)
class Plan:
    """A scenario as the engines see it.

    `links` has both directions of every edge that the graph has at some time of the run. `presence`: link → disjoint
    spans, ascending, in which it exists; a link that is missing there always exists. `slots`: agent → (its slot, number
    of slots), for TDMA on a shared radio. `groups`: name → agents, as live faults may name them. `world` is independent
    of the agents, a `coupled` one is acted upon; that runs as the one of `world_agents`, joined to the agents by
    `wires`. `keeps_payloads`: whether payloads of delivered frames are recorded.
    """

    name: str
    seed: int
    duration_ns: int
    agents: tuple[AgentPlan, ...]
    links: Mapping[LinkName, LinkSettings]
    world: World | None = None
    faults: tuple[Fault, ...] = field(default=())
    presence: Mapping[LinkName, tuple[Span, ...]] = field(default_factory=dict)
    slots: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    coupled: Coupled | None = None
    world_agents: tuple[AgentPlan, ...] = ()
    wires: Mapping[LinkName, LinkSettings] = field(default_factory=dict)
    keeps_payloads: bool = False

    def __repr__(self) -> str:
        counts = f"{len(self.agents)} agents, {len(self.links)} links, {len(self.faults)} faults"
        return f"Plan {self.name}: {self.duration_ns / 1e9:g} s, {counts}"

    @property
    def all_agents(self) -> tuple[AgentPlan, ...]:
        """The agents and the world agents: each has a process of its own."""
        return self.agents + self.world_agents

    @property
    def is_uniform(self) -> bool:
        """Whether all agents are of one kind, with the same parameters."""
        first = self.agents[0]
        return all((agent.kind, agent.parameters) == (first.kind, first.parameters) for agent in self.agents)

    @property
    def public(self) -> PublicPlan:
        """What agents may know of it."""
        model = self.world.model if isinstance(self.world, Modelled) else None
        return PublicPlan(self.seed, self.agents, self.links, model)

    def agent(self, name: str) -> AgentPlan:
        """The agent, or world agent, of this name."""
        return next(agent for agent in self.all_agents if agent.name == name)

    def settings(self, link: LinkName) -> LinkSettings:
        """Settings of a link or a wire in the scenario."""
        return self.wires[link] if link in self.wires else self.links[link]

    def kills(self, agent: str) -> list[Kill]:
        """The kills of one agent, in the order of their times: its n-th restart is incarnation n."""
        return kills_of(self.faults, agent)

    def present(self, name: str, time_ns: int) -> tuple[str, ...]:
        """The neighbours that an agent has at an instant, in natural order."""
        return tuple(other for other in self.agent(name).neighbours if self.is_present((name, other), time_ns))

    def is_present(self, link: LinkName, time_ns: int) -> bool:
        """Whether the graph has a link at an instant."""
        spans = self.presence.get(link)
        return spans is None or any(start <= time_ns < end for start, end in spans)

    def degrees(self, name: str, time_ns: int) -> Mapping[str, int]:
        """Number of neighbours of an agent and of each that is its neighbour at an instant."""
        if not self.presence:
            return self.agent(name).degrees
        return {other: len(self.present(other, time_ns)) for other in (name, *self.present(name, time_ns))}

    def graph_changes(self, name: str) -> list[int]:
        """When a neighbour of an agent, or a neighbour's number of neighbours, changes: instants in ascending order."""
        near = {name, *self.agent(name).neighbours}
        spans = (span for link, spans in self.presence.items() if link[0] in near for span in spans)
        return sorted({instant for span in spans for instant in span})

    def distance_m(self, first: str, second: str, time_ns: int) -> float:
        """Distance of two agents at an instant [m]: in the world where it moves, else between their fixed places.

        Raises:
            BadInput: the two have no places.
        """
        if (world := moving(self.world)) is not None:
            apart = world.position(first, time_ns) - world.position(second, time_ns)
            return float(np.linalg.norm(apart))
        here, there = self.agent(first).position, self.agent(second).position
        if here is None or there is None:
            raise BadInput(
                f"agents {first} and {second} have no positions, so there is no distance between them: "
                "use a topology that has positions, or a world in which agents move"
            )
        return math.dist(here, there)
