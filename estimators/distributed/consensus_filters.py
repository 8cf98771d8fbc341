"""Filters that rest on average consensus of information: on measurements, on information, and what joins both.

Letters: N agents; (Ω⁻_i, q⁻_i) prediction of agent i as information; (δΩ_i, δq_i) = (H_iᵀ R_i⁻¹ H_i, H_iᵀ R_i⁻¹ z_i)
what it has measured, zero where it sees nothing; ⟨·⟩_i what agent i holds of an average after the rounds of a sample.
Any law of average consensus will do. An average that is no information, as some laws leave it when messages get lost,
is not used: then the agent has its own prediction and measurement.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping

import numpy as np

from ..information import InformationPair, pack_pair, packed_size, unpack_trusted
from .filtering import Filter, Moment, Vector
from .gaussian import Gaussian, added, corrected, gaussian, information, scaled

_NEGATIVE_PART = 1e-6
"""Part of the largest eigenvalue that a negative one may have: rounding to float32 leaves 6e-8 on a singular matrix."""


class AveragingFilter(Filter):
    """What they share: a vector that is averaged, and a belief that is made of the average."""

    @abstractmethod
    def source(self) -> Vector:
        """What this agent puts into the average."""

    @abstractmethod
    def posterior(self, average: Vector) -> Gaussian | None:
        """The belief that follows from the average; None where that is no information."""

    @abstractmethod
    def old_source(self, message: Vector, samples: int) -> Vector | None:
        """What an average of an earlier sample is worth now."""

    def begin(self, moment: Moment) -> None:
        """Predict, and begin an average."""
        super().begin(moment)
        self.prior = information(self.belief)
        self._law = self.place.law(moment.sample * self.place.rounds)
        self._state = self._law.start(self.source(), moment.weights)

    def message(self, target: str) -> Vector | None:
        """The law's message."""
        return self._law.message(self._state, target)

    def forward(self, message: Vector, samples: int) -> Vector | None:
        """Plain values are run forward; the messages of other laws are of use in their own sample only."""
        return self.old_source(message, samples) if self._law.plain else None

    def hear(self, received: Mapping[str, Vector]) -> None:
        """One round of the law."""
        self._state = self._law.hear(self._state, received)

    def end(self) -> Gaussian:
        """The belief from the average, or from the own prediction and measurement."""
        result = self.posterior(self._law.value(self._state))
        self.belief = corrected(self.belief, [self.measured()]) if result is None else result
        return self.belief


class ConsensusOnMeasurements(AveragingFilter):
    """Average what was measured, and add N times the average to the own prediction.

    Ω_i = Ω⁻_i + N ⟨δΩ⟩_i,  q_i = q⁻_i + N ⟨δq⟩_i            Olfati-Saber 2007, Sec. III; Battistelli et al. 2015, CM
    Exact where the average is. Where it is not, some measurements count too much, some too little. Predictions are not
    exchanged, so that agents drift apart. Late messages stand in for those of this sample.
    """

    def source(self) -> Vector:
        """The measurement."""
        return pack_pair(self.measured())

    def posterior(self, average: Vector) -> Gaussian | None:
        """N times the average, added."""
        measured = unpack_trusted(average)
        if not is_information(measured):
            return None
        return gaussian(added([self.prior, scaled(measured, self.place.count)]))

    def old_source(self, message: Vector, samples: int) -> Vector | None:
        """The old measurements, run forward."""
        return self.ahead(message, samples)


class ConsensusOnInformation(AveragingFilter):
    """Average the corrected beliefs.

    Ω_i = ⟨Ω⁻ + δΩ⟩_i,  q_i = ⟨q⁻ + δq⟩_i            Battistelli and Chisci 2014, Kullback-Leibler average, CI
    A convex combination of beliefs is never overconfident, however they hang together (covariance intersection), and
    so neither are the agents, whatever is lost or late. New measurements count 1/N of their worth.
    """

    def source(self) -> Vector:
        """Prediction and measurement."""
        return pack_pair(added([self.prior, self.measured()]))

    def posterior(self, average: Vector) -> Gaussian | None:
        """The average is the belief."""
        return gaussian(unpack_trusted(average))

    def old_source(self, message: Vector, samples: int) -> Vector | None:
        """The old belief, run forward."""
        return self.ahead(message, samples)


class InformationWeighted(AveragingFilter):
    """Average predictions at 1/N of their worth, and measurements at their full one.

    V_i = Ω⁻_i / N + δΩ_i,  v_i likewise;  Ω_i = N ⟨V⟩_i,  q_i = N ⟨v⟩_i        Kamal, Farrell and Roy-Chowdhury 2013
    Exact where the average is and the predictions agree. It is the hybrid with ω = N.
    """

    def source(self) -> Vector:
        """Both, in one pair."""
        return pack_pair(added([scaled(self.prior, 1.0 / self.place.count), self.measured()]))

    def posterior(self, average: Vector) -> Gaussian | None:
        """N times the average."""
        return gaussian(scaled(unpack_trusted(average), self.place.count))

    def old_source(self, message: Vector, samples: int) -> Vector | None:
        """The old belief, which is N times the message, run forward and taken back to 1/N."""
        belief = self.ahead(self.place.count * message, samples)
        return None if belief is None else belief / self.place.count


class Hybrid(AveragingFilter):
    """Average predictions and measurements apart, and add ω times the average measurement.

    Ω_i = ⟨Ω⁻⟩_i + ω ⟨δΩ⟩_i,  q_i = ⟨q⁻⟩_i + ω ⟨δq⟩_i            Battistelli et al. 2015, HCMCI
    with ω = N. A message is two packed pairs, predictions first. A late one was a belief about an earlier state:
    it is run forward and joins the predictions, where what is known twice does no harm.
    """

    def source(self) -> Vector:
        """Prediction, then measurement."""
        return np.concatenate([pack_pair(self.prior), pack_pair(self.measured())])

    def factor(self, average: Vector) -> float:
        """ω."""
        return float(self.place.count)

    def posterior(self, average: Vector) -> Gaussian | None:
        """The sum."""
        return gaussian(unpack_trusted(self._joined(average)))

    def old_source(self, message: Vector, samples: int) -> Vector | None:
        """The old belief as a prediction, and no measurement."""
        belief = self.ahead(self._joined(message), samples)
        return None if belief is None else np.concatenate([belief, np.zeros(len(message) - len(belief))])

    def _joined(self, average: Vector) -> Vector:
        size = packed_size(self.dimension)
        joined: Vector = average[:size] + self.factor(average) * average[size : 2 * size]
        return joined


class HybridContributions(Hybrid):
    """The hybrid whose ω is chosen so that no measurement counts more than once.

    ω_i = 1 / max_j c_ij, c_ij being the weight of agent j's measurement in ⟨δΩ⟩_i            Battistelli et al. 2015
    which wants ω_i c_ij ≤ 1. Each message brings the c_ij along, N more numbers, so that they are right whatever is
    lost. With ⟨Ω⁻⟩ a convex combination the agents are then never overconfident.
    """

    def source(self) -> Vector:
        """Prediction, measurement, and a one at the own place if there is a measurement."""
        own = [float(name == self.place.name and self.moment.measurement is not None) for name in self.place.agents]
        return np.concatenate([super().source(), own])

    def factor(self, average: Vector) -> float:
        """1 / max_j c_ij; 1 where no measurement has come, and nothing is multiplied."""
        most = float(average[2 * packed_size(self.dimension) :].max())
        return 1.0 / most if most > 0.0 else 1.0


def is_information(pair: InformationPair) -> bool:
    """Whether P is positive semidefinite, to rounding."""
    spectrum = np.linalg.eigvalsh(pair.P)
    return bool(spectrum[0] >= -_NEGATIVE_PART * abs(spectrum[-1]))
