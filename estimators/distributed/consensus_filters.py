"""Filters based on average consensus of information: on measurements, on information, and hybrids of both.

Letters: N agents; (Ω⁻_i, q⁻_i) prediction of agent i in information form; (δΩ_i, δq_i) = (H_iᵀ R_i⁻¹ H_i, H_iᵀ R_i⁻¹
z_i) its measurement, zero without one; ⟨·⟩_i agent i's estimate of an average after the rounds of a sample.
Any law of average consensus can be used. With some laws and lost messages an average is not positive semidefinite; the
agent then uses its own prediction and measurement instead.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping

import numpy as np

from ..information import InformationPair, pack_pair, packed_size, unpack_trusted
from .filtering import Filter, Moment, Vector
from .gaussian import Gaussian, added, corrected, gaussian, information, scaled

_NEGATIVE_PART = 1e-6
"""Tolerance for negative eigenvalues, relative to the largest: rounding a singular matrix to float32 leaves 6e-8."""


class AveragingFilter(Filter):
    """Base of these filters: the agents average a vector and compute the belief from the average."""

    @abstractmethod
    def source(self) -> Vector:
        """The vector of this agent that is averaged."""

    @abstractmethod
    def posterior(self, average: Vector) -> Gaussian | None:
        """The belief computed from the average; None if that is not valid information."""

    @abstractmethod
    def propagated_source(self, message: Vector, samples: int) -> Vector | None:
        """A vector of an earlier sample, propagated to this one; None if that is not possible."""

    def begin(self, moment: Moment) -> None:
        """Predict, and start a consensus."""
        super().begin(moment)
        self.prior = information(self.belief)
        self._law = self.place.law(moment.sample * self.place.rounds)
        self._state = self._law.start(self.source(), moment.weights)

    def message(self, target: str) -> Vector | None:
        """The message of the consensus law."""
        return self._law.message(self._state, target)

    def forward(self, message: Vector, samples: int) -> Vector | None:
        """Propagate plain values; messages of other laws are valid in their own sample only."""
        return self.propagated_source(message, samples) if self._law.plain else None

    def hear(self, received: Mapping[str, Vector]) -> None:
        """Do one round of the consensus law."""
        self._state = self._law.hear(self._state, received)

    def end(self) -> Gaussian:
        """Compute the belief from the average or, if that is not valid, from the own prediction and measurement."""
        result = self.posterior(self._law.value(self._state))
        self.belief = corrected(self.belief, [self.measured()]) if result is None else result
        return self.belief


class ConsensusOnMeasurements(AveragingFilter):
    """Average the measurements, and add N times the average to the own prediction.

    Ω_i = Ω⁻_i + N ⟨δΩ⟩_i,  q_i = q⁻_i + N ⟨δq⟩_i            Olfati-Saber 2007, Sec. III; Battistelli et al. 2015, CM
    Exact if the average is exact; otherwise some measurements count too much, some too little. Predictions are not
    exchanged, so that the agents' beliefs drift apart. Late messages replace those of this sample.
    """

    def source(self) -> Vector:
        """The own measurement as a packed pair."""
        return pack_pair(self.measured())

    def posterior(self, average: Vector) -> Gaussian | None:
        """Add N times the average to the prediction."""
        measured = unpack_trusted(average)
        if not is_information(measured):
            return None
        return gaussian(added([self.prior, scaled(measured, self.place.count)]))

    def propagated_source(self, message: Vector, samples: int) -> Vector | None:
        """Propagate the old measurement."""
        return self.propagated_pair(message, samples)


class ConsensusOnInformation(AveragingFilter):
    """Average the corrected beliefs.

    Ω_i = ⟨Ω⁻ + δΩ⟩_i,  q_i = ⟨q⁻ + δq⟩_i            Battistelli and Chisci 2014, Kullback-Leibler average, CI
    A convex combination of beliefs is never overconfident, whatever their correlation (covariance intersection): nor
    are the agents, whatever is lost or late. New measurements have only 1/N of their full weight.
    """

    def source(self) -> Vector:
        """The sum of prediction and measurement as a packed pair."""
        return pack_pair(added([self.prior, self.measured()]))

    def posterior(self, average: Vector) -> Gaussian | None:
        """The average itself."""
        return gaussian(unpack_trusted(average))

    def propagated_source(self, message: Vector, samples: int) -> Vector | None:
        """Propagate the old belief."""
        return self.propagated_pair(message, samples)


class InformationWeighted(AveragingFilter):
    """Average predictions weighted by 1/N, and measurements with full weight.

    V_i = Ω⁻_i / N + δΩ_i,  v_i likewise;  Ω_i = N ⟨V⟩_i,  q_i = N ⟨v⟩_i        Kamal, Farrell and Roy-Chowdhury 2013
    Exact if the average is exact and the predictions agree. Equal to the hybrid with ω = N.
    """

    def source(self) -> Vector:
        """The weighted sum as a packed pair."""
        return pack_pair(added([scaled(self.prior, 1.0 / self.place.count), self.measured()]))

    def posterior(self, average: Vector) -> Gaussian | None:
        """N times the average."""
        return gaussian(scaled(unpack_trusted(average), self.place.count))

    def propagated_source(self, message: Vector, samples: int) -> Vector | None:
        """Propagate the old belief, which is N times the message, and divide it by N again."""
        belief = self.propagated_pair(self.place.count * message, samples)
        return None if belief is None else belief / self.place.count


class Hybrid(AveragingFilter):
    """Average predictions and measurements separately, and add ω times the average measurement.

    Ω_i = ⟨Ω⁻⟩_i + ω ⟨δΩ⟩_i,  q_i = ⟨q⁻⟩_i + ω ⟨δq⟩_i            Battistelli et al. 2015, HCMCI
    with ω = N. A message is two packed pairs, prediction first. A late one is propagated as a belief and averaged with
    the predictions, where information counted twice does no harm.
    """

    def source(self) -> Vector:
        """Prediction and measurement, two packed pairs."""
        return np.concatenate([pack_pair(self.prior), pack_pair(self.measured())])

    def factor(self, average: Vector) -> float:
        """The factor ω."""
        return float(self.place.count)

    def posterior(self, average: Vector) -> Gaussian | None:
        """The sum of both averages."""
        return gaussian(unpack_trusted(self._joined(average)))

    def propagated_source(self, message: Vector, samples: int) -> Vector | None:
        """Propagate the old belief, as a prediction without a measurement."""
        belief = self.propagated_pair(self._joined(message), samples)
        return None if belief is None else np.concatenate([belief, np.zeros(len(message) - len(belief))])

    def _joined(self, average: Vector) -> Vector:
        size = packed_size(self.dimension)
        joined: Vector = average[:size] + self.factor(average) * average[size : 2 * size]
        return joined


class HybridContributions(Hybrid):
    """The hybrid with ω chosen such that no measurement counts more than once.

    ω_i = 1 / max_j c_ij, c_ij being the weight of agent j's measurement in ⟨δΩ⟩_i            Battistelli et al. 2015
    which requires ω_i c_ij ≤ 1. Each message also contains the c_ij, N more numbers, so that they are correct whatever
    is lost. If ⟨Ω⁻⟩ is a convex combination the agents are then never overconfident.
    """

    def source(self) -> Vector:
        """Prediction, measurement, and N numbers: 1 at the own index if there is a measurement, else 0."""
        own = [float(name == self.place.name and self.moment.measurement is not None) for name in self.place.agents]
        return np.concatenate([super().source(), own])

    def factor(self, average: Vector) -> float:
        """The factor 1 / max_j c_ij; 1 without any measurement, when it has no effect."""
        most = float(average[2 * packed_size(self.dimension) :].max())
        return 1.0 / most if most > 0.0 else 1.0


def is_information(pair: InformationPair) -> bool:
    """Whether P is positive semidefinite, up to rounding errors."""
    spectrum = np.linalg.eigvalsh(pair.P)
    return bool(spectrum[0] >= -_NEGATIVE_PART * abs(spectrum[-1]))
