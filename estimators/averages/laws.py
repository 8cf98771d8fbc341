"""Common interface of the laws of average consensus, so that an agent can run any of them.

An agent starts a law, then repeats: send each neighbour its message, pass on the received messages, do a round, read
the value. Rounds need not be synchronous, and messages may be missing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...topologies import natural_key
from .averaging import (
    averaging_hear,
    averaging_message,
    averaging_receive,
    averaging_round,
    averaging_start,
    averaging_update,
    averaging_value,
)
from .flow_updating import (
    flow_updating_message,
    flow_updating_receive,
    flow_updating_round,
    flow_updating_start,
    flow_updating_update,
    flow_updating_value,
)
from .push_sum import (
    push_sum_message,
    push_sum_receive,
    push_sum_round,
    push_sum_start,
    push_sum_update,
    push_sum_value,
)
from .running_sum import (
    running_sum_message,
    running_sum_receive,
    running_sum_round,
    running_sum_start,
    running_sum_update,
    running_sum_value,
)

State = TypeVar("State")


@dataclass(frozen=True)
class ConsensusLaw(Generic[State]):
    """The functions of one law; `start` takes the own value, shape (n,), and neighbour → w_ij.

    Laws that split evenly use only the names of the neighbours. `message` returns None if this round has no message for
    that neighbour. `message_size` maps n to the length of a message. `plain`: a message is a value to be averaged, not
    part of a sequence, so that a late one can be propagated to now and used. `at_once`: a faster function, if there is
    one, that receives messages and does a round.
    """

    start: Callable[[ArrayLike, Mapping[str, float]], State]
    message: Callable[[State, str], NDArray[np.float64] | None]
    receive: Callable[[State, str, ArrayLike], State]
    round: Callable[[State], State]
    value: Callable[[State], NDArray[np.float64]]
    update: Callable[[State, ArrayLike], State]
    message_size: Callable[[int], int]
    plain: bool = False
    at_once: Callable[[State, Mapping[str, NDArray[np.float64]]], State] | None = None

    def hear(self, state: State, received: Mapping[str, NDArray[np.float64]]) -> State:
        """Receive one message from each of some neighbours, and do a round."""
        if self.at_once is not None:
            return self.at_once(state, received)
        for name in sorted(received, key=natural_key):
            state = self.receive(state, name, received[name])
        return self.round(state)


LAWS: Mapping[str, ConsensusLaw[Any]] = MappingProxyType(
    {
        "metropolis": ConsensusLaw(
            averaging_start,
            averaging_message,
            averaging_receive,
            averaging_round,
            averaging_value,
            averaging_update,
            lambda size: size,
            plain=True,
            at_once=averaging_hear,
        ),
        "push-sum": ConsensusLaw(
            push_sum_start,
            push_sum_message,
            push_sum_receive,
            push_sum_round,
            push_sum_value,
            push_sum_update,
            lambda size: size + 1,
        ),
        "running-sum": ConsensusLaw(
            running_sum_start,
            running_sum_message,
            running_sum_receive,
            running_sum_round,
            running_sum_value,
            running_sum_update,
            lambda size: size + 1,
        ),
        "flow-updating": ConsensusLaw(
            flow_updating_start,
            flow_updating_message,
            flow_updating_receive,
            flow_updating_round,
            flow_updating_value,
            flow_updating_update,
            lambda size: 2 * size,
        ),
    }
)
