"""Push-sum: averaging by mass that is handed on, on one-way links too; what a lost message carried is gone.

Kempe, Dobra and Gehrke 2003, "Gossip-based computation of aggregate information", protocol Push-Sum, with even shares
for the own agent and all neighbours in the place of one random receiver. The estimate is mass over weight. Sums of mass
and weight are kept only while every message arrives, once: a lost one takes its mass along, and `running_sum` mends
just that.
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
    """State of one agent; vectors but `source` hold n values and the weight, shape (n + 1,).

    `source` is the own input, `share` what the agent keeps and gives each neighbour in this round, `heard` what each
    neighbour has given since the last round.
    """

    source: NDArray[np.float64]
    share: NDArray[np.float64]
    heard: Mapping[str, NDArray[np.float64]]


def push_sum_start(value: ArrayLike, neighbours: Collection[str]) -> PushSum:
    """Begin with the own value, shape (n,), and weight one, split evenly.

    Raises:
        BadInput: wrong shape or not finite.
    """
    source = as_array(value, (None,), "value")
    nothing = np.zeros(len(source) + 1)
    heard = dict.fromkeys(sorted(neighbours, key=natural_key), nothing)
    return PushSum(source, np.append(source, 1.0) / (len(heard) + 1), heard)


def push_sum_message(state: PushSum, to: str) -> NDArray[np.float64]:
    """What to send to a neighbour: its share, shape (n + 1,), the same for all.

    Raises:
        BadInput: `to` is not a neighbour.
    """
    check_neighbour(to, state.heard)
    return state.share


def push_sum_receive(state: PushSum, sender: str, vector: ArrayLike) -> PushSum:
    """Take a neighbour's share, shape (n + 1,); whatever comes until the next round adds up.

    Raises:
        BadInput: `sender` is not a neighbour; wrong shape or not finite.
    """
    check_neighbour(sender, state.heard)
    given = as_array(vector, state.share.shape, f"message from {sender}")
    return replace(state, heard={**state.heard, sender: state.heard[sender] + given})


def push_sum_round(state: PushSum) -> PushSum:
    """Split what was kept and what was given anew.

    Of an agent that hears nothing mass and weight shrink alike, and the ratio stays, for some hundred rounds.
    """
    given = np.sum([state.share, *state.heard.values()], axis=0)
    share = given / (len(state.heard) + 1)
    return replace(state, share=share, heard=dict.fromkeys(state.heard, np.zeros_like(share)))


def push_sum_value(state: PushSum) -> NDArray[np.float64]:
    """The estimate of the average, shape (n,), as of the last round."""
    value: NDArray[np.float64] = state.share[:-1] / state.share[-1]
    return value


def push_sum_update(state: PushSum, value: ArrayLike) -> PushSum:
    """Replace the own input, shape (n,): the mass moves by the difference, so that the average of all follows.

    Raises:
        BadInput: wrong shape or not finite.
    """
    source = as_array(value, state.source.shape, "value")
    moved = np.append(source - state.source, 0.0) / (len(state.heard) + 1)
    return replace(state, source=source, share=state.share + moved)
