"""The Kalman consensus filter: each agent fuses its neighbours' measurements and moves towards their predictions.

Letters: x̄_i prediction, P_i its covariance; u_j = H_jᵀ R_j⁻¹ z_j, U_j = H_jᵀ R_j⁻¹ H_j of each neighbour j and of the
own agent; y and S their sums; M_i = (P_i⁻¹ + S_i)⁻¹.

    x̂_i = x̄_i + M_i (y_i − S_i x̄_i) + C_i Σ_j (x̄_j − x̄_i)            Olfati-Saber 2007, Algorithm 3

The 2007 filter has C_i = ε M_i; the one of 2009 has C_i = ε P_i / (1 + ‖P_i‖), ‖·‖ being the Frobenius norm
(Olfati-Saber 2009, Algorithm 1). Both use the covariance M_i, which assumes independent errors of the agents; they are
not independent. One round suffices; further rounds repeat the message for neighbours that have not received it.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ..information import pack_pair, unpack_pair
from .filtering import Filter, Moment, Place, Vector
from .gaussian import Gaussian, added, information, moved
from .gaussian import gaussian as belief_of


class _KalmanConsensus(Filter):
    """Base of both filters. A message is (x̄, U, u): n, then n (n + 3) / 2 numbers."""

    def __init__(self, place: Place, prior: Gaussian, gain: float) -> None:
        super().__init__(place, prior)
        if not gain > 0:
            raise BadInput(f"gain is {gain:g}, it must be above 0: without it there is no consensus")
        self.gain = gain

    @abstractmethod
    def consensus_gain(self, M: NDArray[np.float64]) -> NDArray[np.float64]:
        """Consensus gain C_i, shape (n, n)."""

    def begin(self, moment: Moment) -> None:
        """Predict, and discard the messages of the last sample."""
        super().begin(moment)
        self._heard: dict[str, Vector] = {}
        self._told = np.concatenate([self.belief.mean, pack_pair(self.measured())])

    def message(self, target: str) -> Vector:
        """Prediction and measurement."""
        return self._told

    def forward(self, message: Vector, samples: int) -> Vector | None:
        """Propagate prediction and measurement."""
        measured = self.propagated_pair(message[self.dimension :], samples)
        if measured is None:
            return None
        steps = self.moment.steps
        return np.concatenate([moved(message[: self.dimension], steps[len(steps) - samples :]), measured])

    def hear(self, received: Mapping[str, Vector]) -> None:
        """Keep the latest message of each neighbour for the end of the sample."""
        self._heard.update(received)

    def end(self) -> Gaussian:
        """Do the update with all received messages."""
        told = [self._heard[name] for name in sorted(self._heard)]
        sums = added([self.measured(), *(unpack_pair(vector[self.dimension :]) for vector in told)])
        prediction = self.belief.mean
        corrected = belief_of(added([information(self.belief), sums]))
        assert corrected is not None, "a positive definite P⁻¹ plus measurements"
        M = corrected.covariance
        mean = prediction + M @ (sums.q - sums.P @ prediction)
        if told:
            pull = np.sum([vector[: self.dimension] - prediction for vector in told], axis=0)
            mean = mean + self.consensus_gain(M) @ pull
        self.belief = Gaussian(mean, M)
        return self.belief


class KalmanConsensus2007(_KalmanConsensus):
    """Olfati-Saber 2007, "Distributed Kalman filtering for sensor networks", Algorithm 3.

    Args:
        place: the filter's place in the network.
        prior: the belief about the state at its first sample.
        gain: ε, small, in the inverse of the state's units squared. Above 1 / (neighbours · ‖M‖) the filter diverges,
            and M grows if a neighbourhood does not observe the whole state.
    """

    def __init__(self, place: Place, prior: Gaussian, *, gain: float = 1e-4) -> None:
        super().__init__(place, prior, gain)

    def consensus_gain(self, M: NDArray[np.float64]) -> NDArray[np.float64]:
        """Consensus gain ε M_i."""
        return self.gain * M


class KalmanConsensus2009(_KalmanConsensus):
    """Olfati-Saber 2009, "Kalman-consensus filter: optimality, stability, and performance", Algorithm 1.

    Args:
        place: the filter's place in the network.
        prior: the belief about the state at its first sample.
        gain: ε, dimensionless if the norm of P is large; small, according to the paper.
    """

    def __init__(self, place: Place, prior: Gaussian, *, gain: float = 0.2) -> None:
        super().__init__(place, prior, gain)

    def consensus_gain(self, M: NDArray[np.float64]) -> NDArray[np.float64]:
        """Consensus gain ε P_i / (1 + ‖P_i‖)."""
        P = self.belief.covariance
        return self.gain / (1.0 + float(np.linalg.norm(P))) * P
