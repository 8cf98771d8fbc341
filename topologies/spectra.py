"""Spectra and distances of graphs: speed of consensus, and hops between agents."""

from __future__ import annotations

import math

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from ..errors import BadInput
from .graphs import agents, known
from .naming import natural_key

_ROUNDING = 1e-9


def laplacian(graph: nx.Graph) -> NDArray[np.float64]:
    """Laplacian L = D − A (N, N), rows in natural order; D is the degree matrix and A the adjacency matrix."""
    adjacency = nx.to_numpy_array(graph, nodelist=agents(graph), weight=None)
    return np.asarray(np.diag(adjacency.sum(axis=1)) - adjacency, dtype=np.float64)


def laplacian_spectrum(graph: nx.Graph) -> NDArray[np.float64]:
    """Eigenvalues of the Laplacian (N,), ascending: λ_1 = 0, the algebraic connectivity λ_2, …, the largest λ_N."""
    return np.asarray(np.linalg.eigvalsh(laplacian(graph)), dtype=np.float64)


def algebraic_connectivity(graph: nx.Graph) -> float:
    """λ_2 of the Laplacian; above zero exactly if the graph is connected (Fiedler 1973)."""
    return float(laplacian_spectrum(graph)[1])


def contraction(matrix: NDArray[np.float64]) -> float:
    """Asymptotic factor by which one round x⁺ = W x reduces the disagreement.

    The essential spectral radius ρ(W − 11ᵀ/N)            Xiao and Boyd 2004

    Args:
        matrix: weights W (N, N), every row and column summing to one.

    Raises:
        BadInput: not square, or a row or column that does not sum to one.
    """
    size = len(matrix)
    if matrix.shape != (size, size):
        raise BadInput(f"a weight matrix is square, this one has shape {matrix.shape}")
    for axis, what in ((1, "row"), (0, "column")):
        sums = matrix.sum(axis=axis)
        worst = int(np.argmax(np.abs(sums - 1)))
        if abs(sums[worst] - 1) > _ROUNDING * size:
            raise BadInput(
                f"{what} {worst + 1} of the weights sums to {sums[worst]:.9g}, it must be 1 to keep the average"
            )
    return float(np.abs(np.linalg.eigvals(matrix - 1 / size)).max())


def rounds_to(per_round: float, factor: float) -> int:
    """Fewest rounds k with per_round^k ≤ factor, per_round being a `contraction`.

    Raises:
        BadInput: a `per_round` outside [0, 1), for which there is no such k, or a factor outside (0, 1).
    """
    if not 0 <= per_round < 1:
        raise BadInput(f"contraction is {per_round:g}, it must be at least 0 and below 1: else no round ever suffices")
    if not 0 < factor < 1:
        raise BadInput(f"factor is {factor:g}, it must lie between 0 and 1")
    if per_round <= factor:
        return 1
    rounds = math.ceil(math.log(factor) / math.log(per_round))
    if per_round ** (rounds - 1) <= factor:
        return rounds - 1
    return rounds if per_round**rounds <= factor else rounds + 1


def diameter(graph: nx.Graph) -> int:
    """Largest number of hops between two agents.

    Raises:
        BadInput: the graph is not connected.
    """
    if not nx.is_connected(graph):
        raise BadInput("a graph that is not connected has no diameter")
    return int(nx.diameter(graph))


def ball(graph: nx.Graph, agent: str, hops: int) -> list[str]:
    """The agents at most `hops` edges away, including the agent itself, in natural order.

    Raises:
        BadInput: no such agent.
    """
    known(graph, agent)
    return sorted(nx.single_source_shortest_path_length(graph, agent, cutoff=hops), key=natural_key)
