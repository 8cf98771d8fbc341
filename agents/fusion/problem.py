"""What is estimated: the model of a state and of the measurements, for each agent and for a central computer alike."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from ...estimators.averages.average_consensus import AverageConsensus, average_consensus
from ...estimators.distributed.gaussian import (
    Gaussian,
    Measurement,
    Step,
    corrected,
    measured_information,
    moved,
    predict,
)
from ..plan import Plan
from ..plan_identity import PlanIdentity

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

    def truth(self, sample: int) -> NDArray[np.float64]:
        """The true state at a sample."""


@dataclass(frozen=True)
class Briefing:
    """What an agent is told before the start: the model, its part in the averages, and whether its weights are its own.

    `local`: the weights follow from degrees alone, and so may change with the graph.
    """

    problem: Problem
    average: AverageConsensus
    local: bool


def parts(plan: Plan, averaging: str) -> dict[str, AverageConsensus]:
    """Agent → its part in a way to average over the graph of a plan."""
    graph = nx.Graph()
    graph.add_nodes_from(agent.name for agent in plan.agents)
    graph.add_edges_from((agent.name, other) for agent in plan.agents for other in agent.neighbours)
    return average_consensus(averaging, graph, plan.seed)


class Whole:
    """A run as a central computer sees it: the problem, and the Kalman filter on the measurements of all agents.

    Kalman 1960, linearised where the problem is not linear. Each belief is made from the one before, when it is first
    asked for.
    """

    def __init__(self, plan: Plan, problem: Problem) -> None:
        self.problem = problem
        self._beliefs: list[Gaussian] = []
        self._coming = _beliefs(plan, problem)

    def belief(self, sample: int) -> Gaussian:
        """What the central computer believes at a sample."""
        while len(self._beliefs) <= sample:
            self._beliefs.append(next(self._coming))
        return self._beliefs[sample]


def whole(plan: Plan, problem: Callable[[Plan], Problem]) -> Whole:
    """The run of a plan; the last few are kept, as they are asked for sample by sample."""
    return _whole(PlanIdentity(plan), problem)


@lru_cache(maxsize=4)
def _whole(same: PlanIdentity, problem: Callable[[Plan], Problem]) -> Whole:
    return Whole(same.plan, problem(same.plan))


def _beliefs(plan: Plan, problem: Problem) -> Iterator[Gaussian]:
    assert plan.world is not None
    sensors = {agent.name: tuple(plan.world.sensors(agent.name)) for agent in plan.agents}
    belief, sample = problem.prior, 0
    while True:
        seen = {name: {sensor: plan.measure(name, sensor, sample) for sensor in own} for name, own in sensors.items()}
        if sample:
            belief = predict(belief, problem.step(list(seen.values()), belief.mean))
        told = [problem.measurement(name, readings, belief.mean) for name, readings in seen.items()]
        belief = corrected(belief, [measured_information(one, len(belief.mean)) for one in told if one is not None])
        yield belief
        sample += 1


def predicted_mean(belief: Gaussian, steps: Sequence[Step]) -> NDArray[np.float64]:
    """The mean after the newest step, before any measurement; that of the belief itself where there was no step."""
    return moved(belief.mean, steps[-1:])
