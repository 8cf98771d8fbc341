"""Running-sum ratio consensus: keeps the average under lost, late and repeated messages, on one-way links too.

Hadjicostis, Vaidya and Domínguez-García 2016, "Robust distributed average consensus via exchange of running sums".
Every agent holds mass: its share of the sum of all values, and a weight that began as one. In each round it splits its
mass evenly among itself and its neighbours, and broadcasts the running total of all that it has ever given to each. A
receiver takes the difference to the last total that it heard, so that the next message makes up for a lost one. The
estimate is mass over weight.

Totals grow with the number of rounds. What a receiver has taken is always the last total as it was encoded, so that
encoding errors do not add up, but one error is half a unit in the last place of the total: after k rounds about
k · 2⁻²⁵ of a value with float32 messages, k · 2⁻⁵⁴ with float64. Begin anew with each sample, or send float64.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...topologies import natural_key
from ..checks import as_array, check_neighbour


@dataclass(frozen=True, eq=False)
class RunningSum:
    """State of one agent; all vectors but `source` hold n values and the weight, shape (n + 1,).

    `source` is the own input, `mass` what the agent holds, `given` the running total that each neighbour was given,
    `heard` the latest total of each neighbour, `taken` how much of it is in the mass already.
    """

    source: NDArray[np.float64]
    mass: NDArray[np.float64]
    given: NDArray[np.float64]
    heard: Mapping[str, NDArray[np.float64]]
    taken: Mapping[str, NDArray[np.float64]]


def running_sum_start(value: ArrayLike, neighbours: Collection[str]) -> RunningSum:
    """Begin with the own value, shape (n,), and give every neighbour its first share.

    Raises:
        BadInput: wrong shape or not finite.
    """
    source = as_array(value, (None,), "value")
    mass = np.append(source, 1.0)
    nothing = {name: np.zeros_like(mass) for name in sorted(neighbours, key=natural_key)}
    return _split(RunningSum(source, mass, np.zeros_like(mass), nothing, nothing))


def running_sum_message(state: RunningSum, to: str) -> NDArray[np.float64]:
    """What to send to a neighbour: the running total, shape (n + 1,), the same for all.

    Raises:
        BadInput: `to` is not a neighbour.
    """
    check_neighbour(to, state.heard)
    return state.given


def running_sum_receive(state: RunningSum, sender: str, vector: ArrayLike) -> RunningSum:
    """Note a neighbour's running total, shape (n + 1,), for the next round.

    The total of the weight only grows, so that a message whose weight is not above the last one is a late or repeated
    one, and is passed over.

    Raises:
        BadInput: `sender` is not a neighbour; wrong shape or not finite.
    """
    check_neighbour(sender, state.heard)
    total = as_array(vector, state.mass.shape, f"message from {sender}")
    if total[-1] <= state.heard[sender][-1]:
        return state
    return replace(state, heard={**state.heard, sender: total})


def running_sum_round(state: RunningSum) -> RunningSum:
    """Take what the neighbours have given since the last round, and split the mass anew.

    An agent that was given nothing keeps its mass: one that is cut off would else give all of it away.
    """
    news = np.zeros_like(state.mass)
    for name, total in state.heard.items():
        news += total - state.taken[name]
    if news[-1] <= 0.0:
        return state
    return _split(replace(state, mass=state.mass + news, taken=state.heard))


def running_sum_value(state: RunningSum) -> NDArray[np.float64]:
    """The estimate of the average, shape (n,), as of the last round."""
    value: NDArray[np.float64] = state.mass[:-1] / state.mass[-1]
    return value


def running_sum_update(state: RunningSum, value: ArrayLike) -> RunningSum:
    """Replace the own input, shape (n,): the mass moves by the difference, so that the average of all follows.

    Raises:
        BadInput: wrong shape or not finite.
    """
    source = as_array(value, state.source.shape, "value")
    return replace(state, source=source, mass=state.mass + np.append(source - state.source, 0.0))


def _split(state: RunningSum) -> RunningSum:
    share = state.mass / (len(state.heard) + 1)
    return replace(state, mass=state.mass - len(state.heard) * share, given=state.given + share)
