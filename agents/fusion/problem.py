"""What is estimated: the model of a state and of the measurements, for each agent and for a central computer alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from ...estimators.averages.average_consensus import AverageConsensus, average_consensus
from ...estimators.distributed.gaussian import Gaussian, Measurement, Step, moved
from ..plan import PublicPlan

Readings = Mapping[str, NDArray[np.float64] | None]
"""Sensor → what it said at one sample; None where it saw nothing, absent where there is none."""


class Problem(Protocol):
    """A state that moves and is measured; linearised about the means given where it is not linear."""

    @property
    def rate(self) -> float:
        """Samples per second."""

    @property
    def prior(self) -> Gaussian:
        """The belief about the state at the first sample, before anything was measured."""

    def step(self, readings: Sequence[Readings], mean: NDArray[np.float64]) -> Step:
        """The step from the sample before to this one: what is known of it from this sample's readings of some agents.

        Args:
            readings: of the agents whose readings are at hand, at least one.
            mean: of the belief at the sample before.
        """

    def measurement(self, agent: str, readings: Readings, mean: NDArray[np.float64]) -> Measurement | None:
        """What an agent measured; None for nothing.

        Args:
            agent: whose readings these are.
            readings: of this sample.
            mean: predicted to this sample.
        """


@dataclass(frozen=True)
class Briefing:
    """What an agent is told before the start: the model, its part in the averages, and whether its weights are its own.

    `local`: the weights follow from degrees alone, and so may change with the graph.
    """

    problem: Problem
    average: AverageConsensus
    local: bool


def parts(plan: PublicPlan, averaging: str) -> dict[str, AverageConsensus]:
    """Agent → its part in a way to average over the graph of a plan."""
    graph = nx.Graph()
    graph.add_nodes_from(agent.name for agent in plan.agents)
    graph.add_edges_from((agent.name, other) for agent in plan.agents for other in agent.neighbours)
    return average_consensus(averaging, graph, plan.seed)


def predicted_mean(belief: Gaussian, steps: Sequence[Step]) -> NDArray[np.float64]:
    """The mean after the newest step, before any measurement; that of the belief itself where there was no step."""
    return moved(belief.mean, steps[-1:])
