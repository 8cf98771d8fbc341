"""The estimators that a flying-array module can run, as rounds: a message to each neighbour, then what was heard.

A value of a round is a plain vector; None where there is nothing to say yet.
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
"""Estimators by consensus on (P, q), and the law of average consensus that each rests on."""

_STATE_SIZE = 3


class Rounds(Protocol):
    """An estimator in rounds."""

    def take(self, distance: float | None) -> None:
        """A new measurement of the own distance in metres; None where the sensor saw nothing."""

    def message(self, target: str) -> Vector | None:
        """What to tell a neighbour in this round."""

    def hear(self, received: Mapping[str, Vector]) -> None:
        """End the round with what the neighbours told."""

    def estimate(self) -> Vector | None:
        """(z, γ, β) [m, rad, rad] as the linearised model has it, or None while it cannot be told."""

    def save(self) -> Any:
        """What a death may leave to the next life, as plain values; None for nothing."""

    def restore(self, saved: Any) -> None:
        """Go on from there."""


class ConsensusRounds:
    """Consensus on information pairs, Kriegleder 2012, (21)-(30), by any law of average consensus.

    A module whose sensor saw nothing takes part with P = 0 and q = 0: the ratio of the averages is not changed by it.
    """

    def __init__(self, law: str, position: Position, weights: Mapping[str, float]) -> None:
        self._law: ConsensusLaw[Any] = LAWS[law]
        self._position = position
        self._weights = weights
        self._state: Any = None

    def take(self, distance: float | None) -> None:
        """Begin, or move the own input to the new measurement."""
        value = np.zeros(PACKED_SIZE) if distance is None else pack_pair(initial_pair(self._position, distance))
        if self._state is None:
            self._state = self._law.start(value, self._weights)
        else:
            self._state = self._law.update(self._state, value)

    def message(self, target: str) -> Vector | None:
        """The law's message."""
        return None if self._state is None else self._law.message(self._state, target)

    def hear(self, received: Mapping[str, Vector]) -> None:
        """One round of the law."""
        if self._state is None:
            return
        for source in sorted(received, key=natural_key):
            self._state = self._law.receive(self._state, source, received[source])
        self._state = self._law.round(self._state)

    def estimate(self) -> Vector | None:
        """P⁻¹ q of the averages held."""
        return None if self._state is None else estimate(unpack_pair(self._law.value(self._state)))

    def save(self) -> Any:
        """The state of the law, member by member."""
        if self._state is None:
            return None
        return {member.name: _to_plain(getattr(self._state, member.name)) for member in fields(self._state)}

    def restore(self, saved: Any) -> None:
        """The same state, to the last bit."""
        if saved is not None:
            begun = self._law.start(np.zeros(PACKED_SIZE), self._weights)
            self._state = replace(begun, **{name: _from_plain(value) for name, value in saved.items()})


class NeighbourhoodRounds:
    """Least squares over what the neighbours measured, Kriegleder 2012, (16)-(18).

    The first round exchanges positions and distances; in later ones estimates travel to the modules that cannot solve,
    and with `averaging` those that have one average them towards (19).
    """

    def __init__(self, position: Position, weights: Mapping[str, float], *, averaging: bool) -> None:
        self._position = position
        self._weights = weights
        self._averaging = averaging
        self._measured: Vector | None = None
        self._held: ForwardedEstimate | None = None
        self._round = 0

    def take(self, distance: float | None) -> None:
        """Begin anew with a measurement."""
        self._measured = None if distance is None else np.array([*self._position, distance])
        self._held = None
        self._round = 0

    def message(self, target: str) -> Vector | None:
        """Position and distance at first, then the estimate held and its hops."""
        if self._round == 0:
            return self._measured
        return None if self._held is None else np.append(self._held.state, float(self._held.hops))

    def hear(self, received: Mapping[str, Vector]) -> None:
        """Solve, hand on, or average."""
        if self._round == 0:
            rows = [row for row in (self._measured, *_in_order(received)) if row is not None]
            measured = np.array(rows).reshape(-1, 3)
            state = neighbourhood_estimate(measured[:, :2], measured[:, 2]) if rows else None
            self._held = None if state is None else ForwardedEstimate(state)
        else:
            told = {name: ForwardedEstimate(row[:_STATE_SIZE], int(row[_STATE_SIZE])) for name, row in received.items()}
            if self._averaging and self._held is not None:
                states = {name: held.state for name, held in told.items()}
                self._held = ForwardedEstimate(
                    weighted_average(self._held.state, states, self._weights), self._held.hops
                )
            else:
                self._held = forwarded_estimate(self._held, told)
        self._round += 1

    def estimate(self) -> Vector | None:
        """What it holds."""
        return None if self._held is None else self._held.state

    def save(self) -> None:
        """Each sample begins anew, so there is nothing to keep."""

    def restore(self, saved: Any) -> None:
        """Nothing was kept."""


def _to_plain(value: Any) -> Any:
    """A vector, a number, or several of them by name, as MessagePack has them."""
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
    """The estimator of this name, for a module at `position` [m] with neighbour → w_ij."""
    if estimator in CONSENSUS:
        return ConsensusRounds(CONSENSUS[estimator], position, weights)
    return NeighbourhoodRounds(position, weights, averaging=estimator == "estimate-averaging")


def message_size(estimator: str) -> int:
    """Numbers in the longest message of an estimator."""
    if estimator in CONSENSUS:
        return LAWS[CONSENSUS[estimator]].message_size(PACKED_SIZE)
    return _STATE_SIZE + 1
