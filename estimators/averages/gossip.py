"""Gossip: in each round an agent exchanges values with at most one neighbour, and both take the mean.

Boyd, Ghosh, Prabhakar and Shah 2006, "Randomized gossip algorithms", with several disjoint pairs in one round: every
edge has a random number in every round, which both of its ends know. An agent chooses the edge with the largest number
among its own and sends its value to that neighbour; if both choose the same edge, both take the mean. A message from
another neighbour is ignored. The average is preserved if the messages of an edge are lost in both directions or in
neither.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...randomness import stream
from ...topologies import natural_key
from ..checks import check_neighbour
from .averaging import Averaging, averaging_receive, averaging_round, averaging_start, averaging_update
from .laws import ConsensusLaw

_HALF = 0.5


@dataclass(frozen=True, eq=False)
class Gossip:
    """State of one agent: averaging with the neighbour chosen for this round, and the number of the round."""

    averaging: Averaging
    neighbours: tuple[str, ...]
    round: int
    partner: str | None


def gossip_law(name: str, seed: int, first_round: int = 0) -> ConsensusLaw[Gossip]:
    """The consensus law for the agent of this name; random numbers depend on seed, edge and number of the round.

    Agents that start together use the same `first_round`.
    """

    def chosen(neighbours: tuple[str, ...], number: int) -> str | None:
        def draw(other: str) -> float:
            ends = sorted((name, other), key=natural_key)
            return stream(seed, "gossip", *ends).uniform(number)

        return max(neighbours, key=draw, default=None)

    def start(value: ArrayLike, weights: Mapping[str, float]) -> Gossip:
        neighbours = tuple(sorted(weights, key=natural_key))
        partner = chosen(neighbours, first_round)
        return Gossip(averaging_start(value, _only(partner)), neighbours, first_round, partner)

    def end_round(state: Gossip) -> Gossip:
        number = state.round + 1
        partner = chosen(state.neighbours, number)
        averaging = replace(averaging_round(state.averaging), weights=_only(partner))
        return replace(state, averaging=averaging, round=number, partner=partner)

    return ConsensusLaw(
        start,
        _message,
        _receive,
        end_round,
        lambda state: state.averaging.value,
        lambda state, value: replace(state, averaging=averaging_update(state.averaging, value)),
        lambda size: size,
    )


def _only(partner: str | None) -> dict[str, float]:
    return {} if partner is None else {partner: _HALF}


def _message(state: Gossip, to: str) -> NDArray[np.float64] | None:
    check_neighbour(to, state.neighbours)
    return state.averaging.value if to == state.partner else None


def _receive(state: Gossip, sender: str, vector: ArrayLike) -> Gossip:
    check_neighbour(sender, state.neighbours)
    if sender != state.partner:
        return state
    return replace(state, averaging=averaging_receive(state.averaging, sender, vector))
