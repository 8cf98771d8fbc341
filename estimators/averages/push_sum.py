"""Push-sum: averaging by passing on mass, also on one-way links; the mass in a lost message is lost.

Kempe, Dobra and Gehrke 2003, "Gossip-based computation of aggregate information", protocol Push-Sum, with equal shares
for the own agent and all neighbours instead of one random receiver. The estimate is mass divided by weight. The sums of
mass and weight are preserved only if every message arrives exactly once; `running_sum` removes this restriction.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...topologies import natural_key
from ..checks import as_array, check_neighbour


@dataclass(frozen=True, eq=False)
class PushSum:
    """State of one agent; vectors except `source` contain n values and the weight, shape (n + 1,).

    `source` is the own input, `share` the mass that the agent keeps and sends to each neighbour in this round, `heard`
    the sum received from each neighbour since the last round.
    """

    source: NDArray[np.float64]
    share: NDArray[np.float64]
    heard: Mapping[str, NDArray[np.float64]]


def push_sum_start(value: ArrayLike, neighbours: Collection[str]) -> PushSum:
    """Start with the own value, shape (n,), and weight one, split evenly.

    Raises:
        BadInput: wrong shape or not finite.
    """
    source = as_array(value, (None,), "value")
    nothing = np.zeros(len(source) + 1)
    heard = dict.fromkeys(sorted(neighbours, key=natural_key), nothing)
    return PushSum(source, np.append(source, 1.0) / (len(heard) + 1), heard)


def push_sum_message(state: PushSum, to: str) -> NDArray[np.float64]:
    """Message to a neighbour: its share, shape (n + 1,), the same for all.

    Raises:
        BadInput: `to` is not a neighbour.
    """
    check_neighbour(to, state.heard)
    return state.share


def push_sum_receive(state: PushSum, sender: str, vector: ArrayLike) -> PushSum:
    """Add a neighbour's share, shape (n + 1,), to what was received from it since the last round.

    Raises:
        BadInput: `sender` is not a neighbour; wrong shape or not finite.
    """
    check_neighbour(sender, state.heard)
    given = as_array(vector, state.share.shape, f"message from {sender}")
    return replace(state, heard={**state.heard, sender: state.heard[sender] + given})


def push_sum_round(state: PushSum) -> PushSum:
    """Add the received mass to the own one, and split the sum.

    If an agent receives nothing, mass and weight shrink equally and their ratio stays, for some hundred rounds.
    """
    given = np.sum([state.share, *state.heard.values()], axis=0)
    share = given / (len(state.heard) + 1)
    return replace(state, share=share, heard=dict.fromkeys(state.heard, np.zeros_like(share)))


def push_sum_value(state: PushSum) -> NDArray[np.float64]:
    """Estimate of the average after the last round, shape (n,)."""
    value: NDArray[np.float64] = state.share[:-1] / state.share[-1]
    return value


def push_sum_update(state: PushSum, value: ArrayLike) -> PushSum:
    """Replace the own input, shape (n,): the mass changes by the difference, so that the average follows.

    Raises:
        BadInput: wrong shape or not finite.
    """
    source = as_array(value, state.source.shape, "value")
    moved = np.append(source - state.source, 0.0) / (len(state.heard) + 1)
    return replace(state, source=source, share=state.share + moved)
