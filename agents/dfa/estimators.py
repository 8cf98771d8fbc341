"""Estimators of a flying-array module, in rounds: send a message to each neighbour, then update with those received.

A message is a vector; None where there is nothing to send yet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...estimators.averages.averaging import weighted_average
from ...estimators.averages.laws import LAWS, ConsensusLaw
from ...estimators.flying_array.least_squares import ForwardedEstimate, forwarded_estimate, neighbourhood_estimate
from ...estimators.flying_array.metropolis import PACKED_SIZE, estimate, initial_pair
from ...estimators.information import pack_pair, unpack_pair
from ...topologies import natural_key

Vector = NDArray[np.float64]
Position = tuple[float, ...]

CONSENSUS = {
    "metropolis-least-squares": "metropolis",
    "running-sum": "running-sum",
    "flow-updating": "flow-updating",
}
"""Estimator by consensus on (P, q) → its law of average consensus."""

_STATE_SIZE = 3


class Rounds(Protocol):
    """An estimator that works in rounds."""

    def take(self, distance: float | None) -> None:
        """Take in a measured distance [m]; None where the sensor saw nothing."""

    def message(self, target: str) -> Vector | None:
        """Message to a neighbour in this round."""

    def update(self, received: Mapping[str, Vector]) -> None:
        """End the round with the messages received: neighbour → message."""

    def estimate(self) -> Vector | None:
        """(z, γ, β) [m, rad, rad] as the linearised model has it, or None as long as it is not determined."""

    def save(self) -> Any:
        """State for the next incarnation as plain values; None for none."""

    def restore(self, saved: Any) -> None:
        """Restore what `save` gave."""


class ConsensusRounds:
    """Consensus on information pairs, Kriegleder 2012, (21)-(30), by any law of average consensus.

    A module whose sensor saw nothing contributes P = 0 and q = 0, which leaves the ratio of the averages as it is.
    """

    def __init__(self, law: str, position: Position, weights: Mapping[str, float]) -> None:
        self._law: ConsensusLaw[Any] = LAWS[law]
        self._position = position
        self._weights = weights
        self._state: Any = None

    def take(self, distance: float | None) -> None:
        """Start from the first measurement, or replace the own input by a new one."""
        value = np.zeros(PACKED_SIZE) if distance is None else pack_pair(initial_pair(self._position, distance))
        if self._state is None:
            self._state = self._law.start(value, self._weights)
        else:
            self._state = self._law.update(self._state, value)

    def message(self, target: str) -> Vector | None:
        """Message of the law."""
        return None if self._state is None else self._law.message(self._state, target)

    def update(self, received: Mapping[str, Vector]) -> None:
        """One round of the law."""
        if self._state is not None:
            self._state = self._law.hear(self._state, received)

    def estimate(self) -> Vector | None:
        """P⁻¹ q of the averages so far."""
        return None if self._state is None else estimate(unpack_pair(self._law.value(self._state)))

    def save(self) -> Any:
        """State of the law, field by field."""
        if self._state is None:
            return None
        return {member.name: _to_plain(getattr(self._state, member.name)) for member in fields(self._state)}

    def restore(self, saved: Any) -> None:
        """Restore the state of the law, bit by bit."""
        if saved is not None:
            initial = self._law.start(np.zeros(PACKED_SIZE), self._weights)
            self._state = replace(initial, **{name: _from_plain(value) for name, value in saved.items()})


class NeighbourhoodRounds:
    """Least squares over the neighbours' measurements, Kriegleder 2012, (16)-(18).

    The first round exchanges positions and distances. In later ones estimates are forwarded to modules that have none;
    with `averaging`, modules that have one average it with their neighbours', (19).
    """

    def __init__(self, position: Position, weights: Mapping[str, float], *, averaging: bool) -> None:
        self._position = position
        self._weights = weights
        self._averaging = averaging
        self._measured: Vector | None = None
        self._held: ForwardedEstimate | None = None
        self._round = 0

    def take(self, distance: float | None) -> None:
        """Start again with a measurement."""
        self._measured = None if distance is None else np.array([*self._position, distance])
        self._held = None
        self._round = 0

    def message(self, target: str) -> Vector | None:
        """Position and distance in the first round, then the estimate and its number of hops."""
        if self._round == 0:
            return self._measured
        return None if self._held is None else np.append(self._held.state, float(self._held.hops))

    def update(self, received: Mapping[str, Vector]) -> None:
        """Solve, forward, or average."""
        if self._round == 0:
            rows = [row for row in (self._measured, *_in_order(received)) if row is not None]
            measured = np.array(rows).reshape(-1, 3)
            state = neighbourhood_estimate(measured[:, :2], measured[:, 2]) if rows else None
            self._held = None if state is None else ForwardedEstimate(state)
        else:
            theirs = {
                name: ForwardedEstimate(row[:_STATE_SIZE], int(row[_STATE_SIZE])) for name, row in received.items()
            }
            if self._averaging and self._held is not None:
                states = {name: estimate.state for name, estimate in theirs.items()}
                self._held = ForwardedEstimate(
                    weighted_average(self._held.state, states, self._weights), self._held.hops
                )
            else:
                self._held = forwarded_estimate(self._held, theirs)
        self._round += 1

    def estimate(self) -> Vector | None:
        """The own or forwarded estimate."""
        return None if self._held is None else self._held.state

    def save(self) -> None:
        """Keep nothing: each sample starts again."""

    def restore(self, saved: Any) -> None:
        """Nothing to restore."""


def _to_plain(value: Any) -> Any:
    """Convert a vector, a number, or a mapping of them to plain values for MessagePack."""
    if isinstance(value, Mapping):
        return {name: _to_plain(member) for name, member in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value


def _from_plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _from_plain(member) for name, member in value.items()}
    return np.array(value) if isinstance(value, list) else value


def _in_order(received: Mapping[str, Vector]) -> list[Vector]:
    return [received[name] for name in sorted(received, key=natural_key)]


def rounds(estimator: str, position: Position, weights: Mapping[str, float]) -> Rounds:
    """Estimator of this name for a module at `position` [m], with weights neighbour → w_ij."""
    if estimator in CONSENSUS:
        return ConsensusRounds(CONSENSUS[estimator], position, weights)
    return NeighbourhoodRounds(position, weights, averaging=estimator == "estimate-averaging")


def message_size(estimator: str) -> int:
    """Numbers in the longest message of an estimator."""
    if estimator in CONSENSUS:
        return LAWS[CONSENSUS[estimator]].message_size(PACKED_SIZE)
    return _STATE_SIZE + 1
