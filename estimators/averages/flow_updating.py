"""Flow updating: keeps the average under lost, late and repeated messages, because what it exchanges heals itself.

Jesus, Baquero and Almeida 2009, "Fault-tolerant aggregation by flow updating". No agent ever changes its input. It
keeps the flow that went to each neighbour; its estimate is the input less all flows. A message says the sender's flow,
and the receiver takes the opposite for its own: whatever was lost, one message each way makes the two ends of an edge
agree again, and with flows that agree the sum of all estimates is the sum of all inputs. Flows stay bounded, so that an
encoding error of the messages (2⁻²⁵ of a flow with float32) bounds the error of the average and does not grow.
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

    `source` is the own input, `average` the estimate as of the last round, `flows` what went to each neighbour,
    `estimates` what each neighbour is believed to hold.
    """

    source: NDArray[np.float64]
    average: NDArray[np.float64]
    flows: Mapping[str, NDArray[np.float64]]
    estimates: Mapping[str, NDArray[np.float64]]


def flow_updating_start(value: ArrayLike, neighbours: Collection[str]) -> FlowUpdating:
    """Begin with the own value, shape (n,), without flows, and believe that all neighbours hold the same.

    Raises:
        BadInput: wrong shape or not finite.
    """
    source = as_array(value, (None,), "value")
    names = sorted(neighbours, key=natural_key)
    return FlowUpdating(source, source, dict.fromkeys(names, np.zeros_like(source)), dict.fromkeys(names, source))


def flow_updating_message(state: FlowUpdating, to: str) -> NDArray[np.float64]:
    """What to send to a neighbour: the flow to it, then the own estimate, shape (2 n,).

    Raises:
        BadInput: `to` is not a neighbour.
    """
    check_neighbour(to, state.flows)
    return np.concatenate([state.flows[to], state.average])


def flow_updating_receive(state: FlowUpdating, sender: str, vector: ArrayLike) -> FlowUpdating:
    """Take the opposite of a neighbour's flow for the own one, and note its estimate; shape (2 n,).

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
    """Average the own estimate with those of the neighbours, and set the flows that bring all of them there."""
    own = state.source - np.sum(list(state.flows.values()), axis=0)
    average = (own + np.sum(list(state.estimates.values()), axis=0)) / (len(state.flows) + 1)
    flows = {name: flow + (average - state.estimates[name]) for name, flow in state.flows.items()}
    return FlowUpdating(state.source, average, flows, dict.fromkeys(state.flows, average))


def flow_updating_value(state: FlowUpdating) -> NDArray[np.float64]:
    """The estimate of the average, shape (n,), as of the last round."""
    return state.average


def flow_updating_update(state: FlowUpdating, value: ArrayLike) -> FlowUpdating:
    """Replace the own input, shape (n,), from the next round on: flows stay, so that the average of all follows.

    Raises:
        BadInput: wrong shape or not finite.
    """
    return replace(state, source=as_array(value, state.source.shape, "value"))
