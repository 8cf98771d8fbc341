"""What a distributed filter is: in each sample it begins, exchanges messages in rounds, and ends with a belief.

    begin(moment)                     a sample: the model's step to it, the own measurement, the neighbours
    message(j) → vector, hear(…)      as often as there are rounds
    end() → Gaussian                  the belief about the state at this sample

A filter is pure: it knows its place and what it is told. Who carries messages, and which of them arrive, is no business
of it. A message that comes samples too late was right about an earlier state: `forward` makes of it what it is worth
now, or says that it is worth nothing.
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
    """What a filter knows of the network from the beginning.

    name: of its agent. agents: all of them, in natural order. rounds: of messages in each sample. law: the law of
    average consensus to use, by the number of the round with which a consensus begins.
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

    sample: its index. measurement: the own one, None where the agent sees nothing. steps: those of the model that led
    here, the newest last, as many as are remembered; none at the first sample. weights: neighbour → w_ij, of those that
    it may talk to in this sample.
    """

    sample: int
    measurement: Measurement | None
    steps: tuple[Step, ...]
    weights: Mapping[str, float]


class Filter:
    """Base of all filters: it predicts, talks to nobody, and corrects with nothing. Override what you need.

    Args:
        place: where it runs.
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
        """What to tell a neighbour in this round; None for nothing."""
        return None

    def forward(self, message: Vector, samples: int) -> Vector | None:
        """What a message that comes so many samples late is worth now, as if it were of this sample; None: nothing."""
        return None

    def hear(self, received: Mapping[str, Vector]) -> None:
        """End a round with what the neighbours told; of each the newest, and each message once."""

    def end(self) -> Gaussian:
        """End the sample: `belief` is what is believed of its state now."""
        return self.belief

    @property
    def dimension(self) -> int:
        """Components of the state."""
        return len(self.belief.mean)

    def measured(self) -> InformationPair:
        """The own measurement of this sample as information; zero where there is none."""
        return measured_information(self.moment.measurement, self.dimension)

    def ahead(self, packed: Vector, samples: int) -> Vector | None:
        """A packed information pair about the state so many samples ago, run forward to now by the model.

        None where that is longer ago than the model's steps are remembered.
        """
        steps = self.moment.steps
        if samples > len(steps):
            return None
        return pack_pair(run_forward(unpack_pair(packed), steps[len(steps) - samples :]))


class LocalFilter(Filter):
    """The Kalman filter of an agent alone, on its own measurements: the reference that no network is needed for."""

    def end(self) -> Gaussian:
        """Correct with the own measurement."""
        self.belief = corrected(self.belief, [self.measured()])
        return self.belief
