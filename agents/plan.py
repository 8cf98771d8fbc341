"""A plan: a scenario resolved to plain data, all that an engine needs. It can be pickled and needs no parser."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..transport.faults import Fault, Kill, LinkName
from ..transport.links import LinkSettings

MILLISECOND_NS = 1_000_000


class World(Protocol):
    """The truth and the sensors that look at it: pure functions of seed and time."""

    def sensors(self, agent: str) -> Mapping[str, float]:
        """Sensor name → rate in Hz, for one agent."""

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """The sensor's index-th sample, taken at floor(index·10⁹ / rate); None where it sees nothing."""

    def truth(self, time_ns: int) -> NDArray[np.float64]:
        """The true state at an instant."""


@dataclass(frozen=True)
class AgentPlan:
    """One agent: its kind (a registered name or `package.module:Class`), parameters and place in the graph.

    `position` is in metres about the centroid, where the topology has positions.
    """

    name: str
    kind: str
    parameters: Any
    neighbours: tuple[str, ...]
    degrees: Mapping[str, int]
    position: tuple[float, ...] | None = None
    compute_ns: int = MILLISECOND_NS


@dataclass(frozen=True)
class Plan:
    """A scenario as the engines see it. `links` holds both directions of every edge."""

    name: str
    seed: int
    duration_ns: int
    agents: tuple[AgentPlan, ...]
    links: Mapping[LinkName, LinkSettings]
    world: World | None = None
    faults: tuple[Fault, ...] = field(default=())

    def agent(self, name: str) -> AgentPlan:
        """The agent of this name."""
        return next(agent for agent in self.agents if agent.name == name)

    def kills(self, agent: str) -> list[Kill]:
        """The kills of one agent, in the order of their times: its n-th restart is incarnation n."""
        kills = [fault for fault in self.faults if isinstance(fault, Kill) and fault.agent == agent]
        return sorted(kills, key=lambda kill: kill.at_ns)
