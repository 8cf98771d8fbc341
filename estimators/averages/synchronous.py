"""Average consensus in synchronous rounds, all agents in one process and without a network."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...topologies import agents
from .average_consensus import AverageConsensus

Lost = Callable[[str, str, int], bool]
"""Whether the message (source, target, number of the round from 0) is lost."""


def nothing_lost(_source: str, _target: str, _number: int) -> bool:
    """No message is lost."""
    return False


def synchronous_rounds(
    parts: Mapping[str, AverageConsensus],
    graph: nx.Graph,
    values: Mapping[str, ArrayLike],
    lost: Lost = nothing_lost,
) -> Iterator[dict[str, NDArray[np.float64]]]:
    """Yield agent → estimate of the average, shape (n,), after each round, without end.

    Args:
        parts: agent → its part, from `average_consensus`.
        graph: communication graph of the agents.
        values: agent → initial value, shape (n,).
        lost: whether a message is lost, by source, target and number of the round.
    """
    names = agents(graph)
    laws = {who: parts[who].law(0) for who in names}
    states: dict[str, Any] = {who: laws[who].start(values[who], parts[who].weights) for who in names}
    number = 0
    while True:
        told = [(i, j, laws[i].message(states[i], j)) for i in names for j in graph[i]]
        for i, j, vector in told:
            if vector is not None and not lost(i, j, number):
                states[j] = laws[j].receive(states[j], i, vector)
        states = {who: laws[who].round(state) for who, state in states.items()}
        yield {who: laws[who].value(state) for who, state in states.items()}
        number += 1
