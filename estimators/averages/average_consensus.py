"""The ways to average in a network, by name: which law, and with which weights of the neighbours.

Weights and rates that hang on the whole graph are worked out beforehand, as a slot plan is.
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
    """The fastest step that leaves no agent's own state a negative weight: averages of information stay information."""
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
"""All ways to average. Those that are not in LOCAL are worked out from the whole graph."""
LOCAL = ("metropolis", "gossip", "push-sum", "running-sum", "flow-updating")
"""Those for which an agent need know no more than its neighbours' degrees, so that the graph may change."""


@dataclass(frozen=True)
class AverageConsensus:
    """A way to average, for one agent: `weights` of its neighbours, and the law from a given round on.

    `law` maps the number of the round with which a consensus begins, the same for all agents, to the law.
    """

    weights: Mapping[str, float]
    law: Callable[[int], ConsensusLaw[Any]]


def average_consensus(name: str, graph: nx.Graph, seed: int = 0) -> dict[str, AverageConsensus]:
    """Agent → its part in this way to average.

    Args:
        name: one of AVERAGINGS.
        graph: who is a neighbour of whom.
        seed: of the draws of gossip.
    Raises:
        BadInput: no such way.
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
    """Factor by which a round of plain weights shrinks the disagreement in the end; see `topologies.contraction`."""
    matrix = topologies.weight_matrix(graph, {who: dict(part.weights) for who, part in parts.items()})
    return topologies.contraction(matrix + np.diag(1.0 - matrix.sum(axis=1)))


def _chebyshev(graph: nx.Graph, weights: Weights) -> ConsensusLaw[Any]:
    """On a complete graph one round is the average already, and ρ is 0 to rounding."""
    return chebyshev_law(max(topologies.contraction(topologies.weight_matrix(graph, weights)), _SAFETY))
