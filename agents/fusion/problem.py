"""What is estimated: the model of a state and its measurements, for agents and for the central estimator."""

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
"""Sensor → its value at one sample; None where it saw nothing, missing where the agent has no such sensor."""


class Problem(Protocol):
    """Model of a state and its measurements, linearised about the given means where it is not linear."""

    @property
    def rate(self) -> float:
        """Samples per second."""

    @property
    def prior(self) -> Gaussian:
        """Distribution of the state at the first sample, before any measurement."""

    def step(self, readings: Sequence[Readings], mean: NDArray[np.float64]) -> Step:
        """Step of the model from the previous sample to this one, with the readings of this sample.

        Args:
            readings: of all agents whose readings are known, at least one.
            mean: of the state at the previous sample.
        """

    def measurement(self, agent: str, readings: Readings, mean: NDArray[np.float64]) -> Measurement | None:
        """Measurement of an agent; None if it measured nothing.

        Args:
            agent: whose readings these are.
            readings: of this sample.
            mean: of the state, predicted to this sample.
        """


@dataclass(frozen=True)
class Briefing:
    """What an agent knows before the start: the model and its weights.

    `local`: the weights follow from degrees alone, and so may change with the graph.
    """

    problem: Problem
    average: AverageConsensus
    local: bool


def parts(plan: PublicPlan, averaging: str) -> dict[str, AverageConsensus]:
    """Agent → its weights and law, for a way to average over the graph of a plan."""
    graph = nx.Graph()
    graph.add_nodes_from(agent.name for agent in plan.agents)
    graph.add_edges_from((agent.name, other) for agent in plan.agents for other in agent.neighbours)
    return average_consensus(averaging, graph, plan.seed)


def predicted_mean(belief: Gaussian, steps: Sequence[Step]) -> NDArray[np.float64]:
    """Mean after the newest step, before any measurement; that of the belief where there was no step."""
    return moved(belief.mean, steps[-1:])
