"""The diffusion Kalman filter: add the neighbours' measurements, then average the neighbours' estimates.

Cattivelli and Sayed 2010, "Diffusion strategies for distributed Kalman filtering and smoothing", Algorithm 2, with the
incremental update over the neighbourhood 𝒩_i (which includes the own agent) in information form:

    P_i⁻¹ ← P_i⁻¹ + Σ_{j ∈ 𝒩_i} H_jᵀ R_j⁻¹ H_j,  ψ_i ← x̂_i + P_i Σ_{j ∈ 𝒩_i} H_jᵀ R_j⁻¹ (z_j − H_j x̂_i)
    x̂_i ← Σ_{j ∈ 𝒩_i} c_ij ψ_j,  Σ_j c_ij = 1

The covariance stays P_i: it is that of ψ_i, not of the average, as the paper states.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..averages.averaging import weighted_average
from ..information import pack_pair, unpack_pair
from .filtering import Filter, Moment, Vector
from .gaussian import Gaussian, corrected, moved


class DiffusionFilter(Filter):
    """The first round exchanges measurements, the others exchange estimates; with a single round, estimates only.

    A message is a packed information pair, n (n + 3) / 2 numbers, or an estimate, n numbers. c_ij are the weights of
    the sample; that of a neighbour without a message is added to the own weight.
    """

    def begin(self, moment: Moment) -> None:
        """Predict, and correct with the own measurement."""
        super().begin(moment)
        own = self.measured()
        self.belief = corrected(self.belief, [own])
        self._measured = pack_pair(own) if self.place.rounds > 1 else None

    def message(self, target: str) -> Vector:
        """The measurement in the first round, then the estimate."""
        return self.belief.mean if self._measured is None else self._measured

    def forward(self, message: Vector, samples: int) -> Vector | None:
        """Propagate a message of either kind by the model."""
        steps = self.moment.steps
        if len(message) != self.dimension:
            return self.propagated_pair(message, samples)
        return moved(message, steps[len(steps) - samples :]) if samples <= len(steps) else None

    def hear(self, received: Mapping[str, Vector]) -> None:
        """Add measurements, and average estimates; the length of a message tells its kind."""
        self._measured = None
        estimates = {name: vector for name, vector in received.items() if len(vector) == self.dimension}
        pairs = [unpack_pair(received[name]) for name in sorted(received) if name not in estimates]
        if pairs:
            self.belief = corrected(self.belief, pairs)
        mean = weighted_average(self.belief.mean, estimates, self.moment.weights)
        self.belief = Gaussian(mean, self.belief.covariance)

    def end(self) -> Gaussian:
        """The average of the estimates, with the covariance of the own one."""
        return self.belief
