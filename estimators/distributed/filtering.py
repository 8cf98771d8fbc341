"""Base class of distributed filters.

For each sample its methods are called in this order:

    begin(moment)                     starts a sample: the model's step to it, the own measurement, the neighbours
    message(j) → vector, hear(…)      once per round
    end() → Gaussian                  the belief about the state at this sample

A filter is a pure state machine: it does not know how messages are transported or which of them arrive. A message that
arrives some samples late concerns an earlier state: `forward` propagates it to the present sample, or rejects it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..averages.laws import LAWS, ConsensusLaw
from ..information import InformationPair, pack_pair, unpack_pair
from .gaussian import Gaussian, Measurement, Step, corrected, measured_information, predict, run_forward

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """What a filter knows of the network from the start.

    name: the name of its agent. agents: names of all agents, in natural order. rounds: rounds of messages per sample.
    law: maps the number of the first round of a consensus to the law of average consensus to use.
    """

    name: str
    agents: tuple[str, ...]
    rounds: int
    law: Callable[[int], ConsensusLaw[Any]] = lambda _first_round: LAWS["metropolis"]

    @property
    def count(self) -> int:
        """N, the number of agents."""
        return len(self.agents)


@dataclass(frozen=True, eq=False)
class Moment:
    """A sample as one agent sees it.

    sample: its index. measurement: the own measurement, or None. steps: the last steps of the model up to this sample,
    newest last, as many as are kept; none at the first sample. weights: neighbour → w_ij, of the neighbours in this
    sample.
    """

    sample: int
    measurement: Measurement | None
    steps: tuple[Step, ...]
    weights: Mapping[str, float]


class Filter:
    """Base of all filters: it only predicts, without messages and corrections. Override what you need.

    Args:
        place: the filter's place in the network.
        prior: the belief about the state at its first sample.
    """

    def __init__(self, place: Place, prior: Gaussian) -> None:
        self.place = place
        self.belief = prior
        self._begun = False

    def begin(self, moment: Moment) -> None:
        """Start a sample: `belief` becomes the prediction to it. An override calls this first."""
        self.moment = moment
        if self._begun:
            self.belief = predict(self.belief, moment.steps[-1])
        self._begun = True

    def message(self, target: str) -> Vector | None:
        """Message to a neighbour in this round, or None."""
        return None

    def forward(self, message: Vector, samples: int) -> Vector | None:
        """Propagate a message that is this many samples late to the present sample; None if it cannot be used."""
        return None

    def hear(self, received: Mapping[str, Vector]) -> None:
        """End a round with the received messages: the newest of each neighbour, and each message once."""

    def end(self) -> Gaussian:
        """End the sample, and return the belief about its state, which `belief` then is."""
        return self.belief

    @property
    def dimension(self) -> int:
        """Number of components of the state."""
        return len(self.belief.mean)

    def measured(self) -> InformationPair:
        """The own measurement of this sample as an information pair; zero if there is none."""
        return measured_information(self.moment.measurement, self.dimension)

    def propagated_pair(self, packed: Vector, samples: int) -> Vector | None:
        """Propagate a packed information pair about the state this many samples ago to now by the model.

        None if the model's steps are not kept for so long.
        """
        steps = self.moment.steps
        if samples > len(steps):
            return None
        return pack_pair(run_forward(unpack_pair(packed), steps[len(steps) - samples :]))


class LocalFilter(Filter):
    """The Kalman filter of a single agent with its own measurements: the reference without communication."""

    def end(self) -> Gaussian:
        """Correct with the own measurement."""
        self.belief = corrected(self.belief, [self.measured()])
        return self.belief
