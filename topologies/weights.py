"""Weights of average consensus.

All rules give symmetric weights whose rows sum to one, so that x⁺ = W x preserves the average.
"""

from __future__ import annotations

from collections.abc import Mapping

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from .graphs import agents, neighbours
from .spectra import laplacian_spectrum

Weights = dict[str, dict[str, float]]


def metropolis_weight(degree: int, other_degree: int) -> float:
    """Metropolis weight of one edge, from the degrees of its two ends.

    w_ij = 1 / (1 + max(d_i, d_j))            Kriegleder 2012, (27)
    """
    return 1.0 / (1 + max(degree, other_degree))


def metropolis(graph: nx.Graph) -> Weights:
    """Metropolis weights: agent → {neighbour: w_ij}, and the own weight 1 − Σ_j w_ij under the agent's own name.

    Kriegleder 2012, (27). All weights are nonnegative.
    """
    return _with_own(
        {
            agent: {
                other: metropolis_weight(graph.degree[agent], graph.degree[other]) for other in neighbours(graph, agent)
            }
            for agent in agents(graph)
        }
    )


def maximum_degree(graph: nx.Graph) -> Weights:
    """The same weight 1 / (1 + Δ) on all edges, Δ being the largest degree; format as in `metropolis`.

    Xiao and Boyd 2004, with 1 + Δ instead of Δ, so that regular bipartite graphs converge too.
    All weights are nonnegative.
    """
    return _equal(graph, 1.0 / (1 + max(degree for _, degree in graph.degree)))


def constant_edge(graph: nx.Graph, step: float | None = None) -> Weights:
    """The same weight on all edges, W = I − step·L, L being the Laplacian; format as in `metropolis`.

    The default step 2 / (λ_2 + λ_N) has the smallest contraction factor (Xiao and Boyd 2004). The own weight of an
    agent of high degree may then be negative.

    Raises:
        BadInput: a step outside (0, 2/λ_N), which does not converge; or no step for a graph that is not connected.
    """
    spectrum = laplacian_spectrum(graph)
    if step is None:
        if not nx.is_connected(graph):
            raise BadInput("no step is optimal on a graph that is not connected: give the step")
        step = float(2 / (spectrum[1] + spectrum[-1]))
    if not 0 < step * spectrum[-1] < 2:
        bound = 2 / spectrum[-1]
        raise BadInput(f"step is {step:g}, it must be above 0 and below 2/λ_max = {bound:.6g} for this topology")
    return _equal(graph, step)


def weight_matrix(graph: nx.Graph, weights: Mapping[str, Mapping[str, float]]) -> NDArray[np.float64]:
    """The weights as a matrix W (N, N), rows and columns in natural order of the agents; zero without an edge.

    Raises:
        BadInput: a weight for an unknown agent, or for two agents that are not neighbours.
    """
    names = agents(graph)
    row = {name: index for index, name in enumerate(names)}
    matrix = np.zeros((len(names), len(names)))
    for agent, counted in weights.items():
        for other, weight in counted.items():
            if agent not in row or (other != agent and not graph.has_edge(agent, other)):
                raise BadInput(f"there is a weight of {other} at {agent}, but no edge {agent}-{other} in this topology")
            matrix[row[agent], row[other]] = weight
    return matrix


def _equal(graph: nx.Graph, weight: float) -> Weights:
    return _with_own({agent: dict.fromkeys(neighbours(graph, agent), weight) for agent in agents(graph)})


def _with_own(weights: Weights) -> Weights:
    return {agent: {**counted, agent: 1.0 - sum(counted.values())} for agent, counted in weights.items()}
