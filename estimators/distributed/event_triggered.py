"""Event-triggered consensus on information: agents send their belief only when it has changed.

Battistelli, Chisci and Selvi 2018, "A distributed Kalman filter with event-triggered communication and guaranteed
stability". Letters: (Ω, q) the own belief in information form, x̂ its mean; (Ω̄, q̄) the belief sent last, propagated to
now by the model, x̄ its mean. An agent does not send while

    (x̂ − x̄)ᵀ Ω (x̂ − x̄) ≤ α   and   Ω ≼ (1 + β) Ω̄   and   Ω̄ ≼ (1 + δ) Ω            (10)

For a neighbour without a message the average uses its last message, propagated to now. That is a valid belief about
the state, however old, and an average of beliefs is not overconfident: no inflation is needed, and a lost message,
which the receiver cannot distinguish from no message, only delays information.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...errors import BadInput
from ..averages.averaging import weighted_average
from ..information import InformationPair, pack_pair, unpack_pair
from .filtering import Filter, Moment, Place, Vector
from .gaussian import Gaussian, added, gaussian, information


class EventTriggered(Filter):
    """Consensus on information with triggered messages; a message is a packed pair.

    Args:
        place: where it runs.
        prior: at its first sample.
        alpha: α, bound of the squared Mahalanobis distance of the means.
        beta: β, relative growth of information.
        delta: δ, relative loss of information.
    Raises:
        BadInput: a threshold below 0.
    """

    def __init__(
        self, place: Place, prior: Gaussian, *, alpha: float = 0.3, beta: float = 0.3, delta: float = 0.3
    ) -> None:
        super().__init__(place, prior)
        for name, value in (("alpha", alpha), ("beta", beta), ("delta", delta)):
            if not value >= 0.0:
                raise BadInput(f"{name} is {value:g}, it must be at least 0: 0 tells every change")
        self._alpha, self._beta, self._delta = alpha, beta, delta
        self._told: Vector | None = None
        self._known: dict[str, Vector] = {}

    def begin(self, moment: Moment) -> None:
        """Predict, correct, and propagate the messages sent and received last."""
        super().begin(moment)
        self._pair = pack_pair(added([information(self.belief), self.measured()]))
        if self._told is not None:
            self._told = self.propagated_pair(self._told, 1)
        known = {
            name: self.propagated_pair(vector, 1) for name, vector in self._known.items() if name in moment.weights
        }
        self._known = {name: vector for name, vector in known.items() if vector is not None}
        self._decide()

    def message(self, target: str) -> Vector | None:
        """The belief, if it has changed."""
        return self._told if self._news else None

    def forward(self, message: Vector, samples: int) -> Vector | None:
        """Propagate the old belief."""
        return self.propagated_pair(message, samples)

    def hear(self, received: Mapping[str, Vector]) -> None:
        """Average with the last message of each neighbour."""
        self._known.update(received)
        self._pair = weighted_average(self._pair, self._known, self.moment.weights)
        self._decide()

    def end(self) -> Gaussian:
        """Take the average as the belief."""
        result = gaussian(unpack_pair(self._pair))
        assert result is not None, "a convex combination of positive definite matrices"
        self.belief = result
        return result

    def _decide(self) -> None:
        """Decide whether to send the belief in the next round; if so, remember it as sent."""
        self._news = self._told is None or self._departs(unpack_pair(self._pair), unpack_pair(self._told))
        if self._news:
            self._told = self._pair

    def _departs(self, own: InformationPair, told: InformationPair) -> bool:
        apart = np.linalg.solve(own.P, own.q) - np.linalg.solve(told.P, told.q)
        if apart @ own.P @ apart > self._alpha:
            return True
        factor = np.linalg.cholesky(told.P)
        half = np.linalg.solve(factor, own.P)
        ratios = np.linalg.eigvalsh(np.linalg.solve(factor, half.T))
        return bool(ratios[-1] > 1.0 + self._beta or ratios[0] < 1.0 / (1.0 + self._delta))
