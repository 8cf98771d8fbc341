"""Flow updating: preserves the average under lost, late and repeated messages.

Jesus, Baquero and Almeida 2009, "Fault-tolerant aggregation by flow updating". An agent never changes its input. It
keeps the total flow to each neighbour; its estimate is the input minus all flows. A message contains the sender's flow,
and the receiver sets its own flow to the opposite: whatever was lost, one message each way makes the two ends of an
edge consistent again, and with consistent flows the sum of all estimates is the sum of all inputs. Flows stay bounded,
so that an encoding error of the messages (2⁻²⁵ of a flow with float32) bounds the error of the average and does not
grow.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...topologies import natural_key
from ..checks import as_array, check_neighbour


@dataclass(frozen=True, eq=False)
class FlowUpdating:
    """State of one agent; all vectors have shape (n,).

    `source` is the own input, `average` the estimate after the last round, `flows` the total flow to each neighbour,
    `estimates` the last known estimate of each neighbour.
    """

    source: NDArray[np.float64]
    average: NDArray[np.float64]
    flows: Mapping[str, NDArray[np.float64]]
    estimates: Mapping[str, NDArray[np.float64]]


def flow_updating_start(value: ArrayLike, neighbours: Collection[str]) -> FlowUpdating:
    """Start with the own value, shape (n,), zero flows, and the own value as the estimate of all neighbours.

    Raises:
        BadInput: wrong shape or not finite.
    """
    source = as_array(value, (None,), "value")
    names = sorted(neighbours, key=natural_key)
    return FlowUpdating(source, source, dict.fromkeys(names, np.zeros_like(source)), dict.fromkeys(names, source))


def flow_updating_message(state: FlowUpdating, to: str) -> NDArray[np.float64]:
    """Message to a neighbour: the flow to it, then the own estimate, shape (2 n,).

    Raises:
        BadInput: `to` is not a neighbour.
    """
    check_neighbour(to, state.flows)
    return np.concatenate([state.flows[to], state.average])


def flow_updating_receive(state: FlowUpdating, sender: str, vector: ArrayLike) -> FlowUpdating:
    """Set the own flow to the opposite of a neighbour's, and store its estimate; shape (2 n,).

    Raises:
        BadInput: `sender` is not a neighbour; wrong shape or not finite.
    """
    check_neighbour(sender, state.flows)
    size = len(state.source)
    message = as_array(vector, (2 * size,), f"message from {sender}")
    return replace(
        state,
        flows={**state.flows, sender: -message[:size]},
        estimates={**state.estimates, sender: message[size:]},
    )


def flow_updating_round(state: FlowUpdating) -> FlowUpdating:
    """Average the own estimate with those of the neighbours, and change the flows so that all reach this average."""
    own = state.source - np.sum(list(state.flows.values()), axis=0)
    average = (own + np.sum(list(state.estimates.values()), axis=0)) / (len(state.flows) + 1)
    flows = {name: flow + (average - state.estimates[name]) for name, flow in state.flows.items()}
    return FlowUpdating(state.source, average, flows, dict.fromkeys(state.flows, average))


def flow_updating_value(state: FlowUpdating) -> NDArray[np.float64]:
    """Estimate of the average after the last round, shape (n,)."""
    return state.average


def flow_updating_update(state: FlowUpdating, value: ArrayLike) -> FlowUpdating:
    """Replace the own input, shape (n,), from the next round on; flows stay, so that the average follows.

    Raises:
        BadInput: wrong shape or not finite.
    """
    return replace(state, source=as_array(value, state.source.shape, "value"))
