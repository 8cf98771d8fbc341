"""Weighted averaging with neighbours: one round on vectors, and the state machine of one agent.

The average of all agents is preserved only if, in each round, the two messages of every edge are both received or both
lost. `running_sum` and `flow_updating` do not need that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import BadInput
from ...topologies import natural_key
from ..checks import as_array, check_neighbour

_ROUNDING = 1e-12


def weighted_average(
    own: NDArray[np.float64], received: Mapping[str, NDArray[np.float64]], weights: Mapping[str, float]
) -> NDArray[np.float64]:
    """One round of weighted averaging with the neighbours from which a message was received.

    x⁺ = w_ii x + Σ_j w_ij x_j            Kriegleder 2012, (24)-(25); for state estimates, towards (19)
    The weight of a neighbour without a message is added to the own weight, so that the weights still sum to one.
    Neighbours are summed in natural order, so that the result does not depend on the order of arrival.

    Args:
        own: shape (n,).
        received: neighbour → its vector of this round, shape (n,).
        weights: neighbour → w_ij, dimensionless, ≥ 0, sum ≤ 1.
    Returns:
        The new vector, shape (n,); arguments are untouched.
    Raises:
        BadInput: a neighbour without a weight, a negative weight, or a sum of weights above one.
    """
    _check_weights(weights)
    return _averaged(own, received, weights)


def _averaged(
    own: NDArray[np.float64], received: Mapping[str, NDArray[np.float64]], weights: Mapping[str, float]
) -> NDArray[np.float64]:
    names = sorted(received, key=natural_key)
    try:
        counted = [weights[name] for name in names]
    except KeyError:
        for name in names:
            check_neighbour(name, weights)
        raise
    own_weight = 1.0
    for weight in counted:
        own_weight -= weight
    vectors = [received[name] for name in names]
    average: NDArray[np.float64] = np.array([own_weight, *counted]).dot(np.array([own, *vectors]))
    return average


def _check_weights(weights: Mapping[str, float]) -> None:
    """Refuse negative weights, and weights whose sum exceeds one."""
    if min(weights.values(), default=0.0) < 0.0 or sum(weights.values()) > 1.0 + _ROUNDING:
        raise BadInput(f"weights {dict(weights)} must each be at least 0 and sum to at most 1: use Metropolis weights")


@dataclass(frozen=True, eq=False)
class Averaging:
    """State of weighted averaging: own input, present value, weights, and messages received since the last round."""

    source: NDArray[np.float64]
    value: NDArray[np.float64]
    weights: Mapping[str, float]
    heard: Mapping[str, NDArray[np.float64]]


def averaging_start(value: ArrayLike, weights: Mapping[str, float]) -> Averaging:
    """Start with the own value, shape (n,), and the weight w_ij of each neighbour, Kriegleder 2012, (26)-(27).

    Raises:
        BadInput: a bad weight; wrong shape or not finite.
    """
    _check_weights(weights)
    vector = as_array(value, (None,), "value")
    return Averaging(vector, vector, dict(weights), {})


def averaging_message(state: Averaging, to: str) -> NDArray[np.float64]:
    """Message to a neighbour: the present value, shape (n,), the same for all.

    Raises:
        BadInput: `to` is not a neighbour.
    """
    check_neighbour(to, state.weights)
    return state.value


def averaging_receive(state: Averaging, sender: str, vector: ArrayLike) -> Averaging:
    """Store a neighbour's value, shape (n,), for the next round; a later one replaces it.

    Raises:
        BadInput: `sender` is not a neighbour; wrong shape or not finite.
    """
    check_neighbour(sender, state.weights)
    message = as_array(vector, state.value.shape, f"message from {sender}")
    return replace(state, heard={**state.heard, sender: message})


def averaging_round(state: Averaging) -> Averaging:
    """Average with the messages received since the last round; each is used once."""
    return Averaging(state.source, _averaged(state.value, state.heard, state.weights), state.weights, {})


def averaging_hear(state: Averaging, received: Mapping[str, NDArray[np.float64]]) -> Averaging:
    """Receive one message from each of some neighbours, then do the round: `averaging_receive` and `_round` in one.

    Raises:
        BadInput: as `averaging_receive`.
    """
    try:
        value = _averaged(state.value, received, state.weights)
        sound = not state.heard and math.isfinite(value.dot(value))
    except ValueError:  # of another length than the own value
        sound = False
    if sound:
        return Averaging(state.source, value, state.weights, {})
    for name, vector in received.items():
        state = averaging_receive(state, name, vector)
    return averaging_round(state)


def averaging_value(state: Averaging) -> NDArray[np.float64]:
    """Estimate of the average after the last round, shape (n,)."""
    return state.value


def averaging_update(state: Averaging, value: ArrayLike) -> Averaging:
    """Replace the own input: the value changes by the difference, so that the average of all agents follows.

    Raises:
        BadInput: wrong shape or not finite.
    """
    source = as_array(value, state.source.shape, "value")
    return replace(state, source=source, value=state.value + (source - state.source))
