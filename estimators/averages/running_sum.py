"""Running-sum ratio consensus: preserves the average under lost, late and repeated messages, also on one-way links.

Hadjicostis, Vaidya and Domínguez-García 2016, "Robust distributed average consensus via exchange of running sums".
Every agent holds mass: its share of the sum of all values, and a weight, initially one. In each round it splits its
mass evenly among itself and its neighbours, and broadcasts the running total of the mass sent to each so far. A
receiver adds the difference to the last total received, so that the next message makes up for a lost one. The estimate
is mass divided by weight.

Totals grow with the number of rounds. A receiver keeps the last total as it was encoded, so that encoding errors do not
add up, but one error is half a unit in the last place of the total: after k rounds about k · 2⁻²⁵ of a value with
float32 messages, k · 2⁻⁵⁴ with float64. Restart with each sample, or send float64.
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
    """State of one agent; vectors except `source` contain n values and the weight, shape (n + 1,).

    `source` is the own input, `mass` the agent's mass, `given` the running total sent to each neighbour, `heard` the
    latest total received from each neighbour, `taken` the part of it that the mass already contains.
    """

    source: NDArray[np.float64]
    mass: NDArray[np.float64]
    given: NDArray[np.float64]
    heard: Mapping[str, NDArray[np.float64]]
    taken: Mapping[str, NDArray[np.float64]]


def running_sum_start(value: ArrayLike, neighbours: Collection[str]) -> RunningSum:
    """Start with the own value, shape (n,), and split off the first share of every neighbour.

    Raises:
        BadInput: wrong shape or not finite.
    """
    source = as_array(value, (None,), "value")
    mass = np.append(source, 1.0)
    nothing = {name: np.zeros_like(mass) for name in sorted(neighbours, key=natural_key)}
    return _split(RunningSum(source, mass, np.zeros_like(mass), nothing, nothing))


def running_sum_message(state: RunningSum, to: str) -> NDArray[np.float64]:
    """Message to a neighbour: the running total, shape (n + 1,), the same for all.

    Raises:
        BadInput: `to` is not a neighbour.
    """
    check_neighbour(to, state.heard)
    return state.given


def running_sum_receive(state: RunningSum, sender: str, vector: ArrayLike) -> RunningSum:
    """Store a neighbour's running total, shape (n + 1,), for the next round.

    The total of the weight only grows: a message whose weight is not above the last one is late or repeated, and is
    ignored.

    Raises:
        BadInput: `sender` is not a neighbour; wrong shape or not finite.
    """
    check_neighbour(sender, state.heard)
    total = as_array(vector, state.mass.shape, f"message from {sender}")
    if total[-1] <= state.heard[sender][-1]:
        return state
    return replace(state, heard={**state.heard, sender: total})


def running_sum_round(state: RunningSum) -> RunningSum:
    """Add the mass received since the last round, and split the sum.

    If nothing was received the agent keeps its mass: when cut off, it would otherwise lose all of it.
    """
    news = np.zeros_like(state.mass)
    for name, total in state.heard.items():
        news += total - state.taken[name]
    if news[-1] <= 0.0:
        return state
    return _split(replace(state, mass=state.mass + news, taken=state.heard))


def running_sum_value(state: RunningSum) -> NDArray[np.float64]:
    """Estimate of the average after the last round, shape (n,)."""
    value: NDArray[np.float64] = state.mass[:-1] / state.mass[-1]
    return value


def running_sum_update(state: RunningSum, value: ArrayLike) -> RunningSum:
    """Replace the own input, shape (n,): the mass changes by the difference, so that the average follows.

    Raises:
        BadInput: wrong shape or not finite.
    """
    source = as_array(value, state.source.shape, "value")
    return replace(state, source=source, mass=state.mass + np.append(source - state.source, 0.0))


def _split(state: RunningSum) -> RunningSum:
    share = state.mass / (len(state.heard) + 1)
    return replace(state, mass=state.mass - len(state.heard) * share, given=state.given + share)
