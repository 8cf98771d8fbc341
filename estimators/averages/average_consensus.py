"""The averaging methods by name: a consensus law and the weights of the neighbours.

Weights and rates that depend on the whole graph are computed before the run, as a slot plan is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import networkx as nx
import numpy as np

from ... import topologies
from ...errors import BadInput
from ...topologies import Weights
from .chebyshev import chebyshev_law
from .gossip import gossip_law
from .laws import LAWS, ConsensusLaw

_SAFETY = 1e-9


def _constant_edge(graph: nx.Graph) -> Weights:
    """Constant-edge weights with the step 2 / (λ₂ + λ_n), at most 1 / (largest degree): no own weight is negative.

    Averages of positive semidefinite information matrices then stay positive semidefinite.
    """
    spectrum = topologies.laplacian_spectrum(graph)
    most = max(degree for _, degree in graph.degree)
    return topologies.constant_edge(graph, float(min(2.0 / (spectrum[1] + spectrum[-1]), 1.0 / most)))


_WEIGHTS: Mapping[str, Callable[[nx.Graph], Weights]] = {
    "metropolis": topologies.metropolis,
    "constant-edge": _constant_edge,
    "maximum-degree": topologies.maximum_degree,
    "fastest-mixing": topologies.fastest_mixing,
}
AVERAGINGS = (*_WEIGHTS, "chebyshev", "gossip", "push-sum", "running-sum", "flow-updating")
"""All averaging methods. Those not in LOCAL are computed from the whole graph."""
LOCAL = ("metropolis", "gossip", "push-sum", "running-sum", "flow-updating")
"""Methods for which an agent needs to know only its neighbours' degrees, so that the graph may change."""


@dataclass(frozen=True)
class AverageConsensus:
    """One agent's part of an averaging method.

    weights: neighbour → weight.
    law: maps the number of the first round of a consensus, the same for all agents, to the consensus law.
    """

    weights: Mapping[str, float]
    law: Callable[[int], ConsensusLaw[Any]]


def average_consensus(name: str, graph: nx.Graph, seed: int = 0) -> dict[str, AverageConsensus]:
    """Agent → its part of an averaging method.

    Args:
        name: one of AVERAGINGS.
        graph: communication graph of the agents.
        seed: for the random pairs of gossip.
    Raises:
        BadInput: no such method.
    """
    if name not in AVERAGINGS:
        raise BadInput(f"averaging {name!r} is not known: use {', '.join(AVERAGINGS)}")
    weights = _WEIGHTS.get(name, topologies.metropolis)(graph)

    def law_of(agent: str) -> Callable[[int], ConsensusLaw[Any]]:
        if name == "gossip":
            return lambda first_round: gossip_law(agent, seed, first_round)
        law = _chebyshev(graph, weights) if name == "chebyshev" else LAWS.get(name, LAWS["metropolis"])
        return lambda _first_round: law

    return {
        agent: AverageConsensus({other: w for other, w in counted.items() if other != agent}, law_of(agent))
        for agent, counted in weights.items()
    }


def predicted_contraction(parts: Mapping[str, AverageConsensus], graph: nx.Graph) -> float:
    """Asymptotic factor by which a round of weighted averaging reduces disagreement; see `topologies.contraction`."""
    matrix = topologies.weight_matrix(graph, {who: dict(part.weights) for who, part in parts.items()})
    return topologies.contraction(matrix + np.diag(1.0 - matrix.sum(axis=1)))


def _chebyshev(graph: nx.Graph, weights: Weights) -> ConsensusLaw[Any]:
    """Chebyshev averaging with the ρ of these weights, but above 0, which it is on a complete graph."""
    return chebyshev_law(max(topologies.contraction(topologies.weight_matrix(graph, weights)), _SAFETY))
