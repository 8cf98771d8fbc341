"""Parameters of a flying-array module."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...errors import BadInput
from ...units import Count, Hertz, check_fields_above_zero, period_ns
from .. import payloads
from ..sample_counts import COUNTS
from .estimators import CONSENSUS, message_size

_SYNCHRONOUS_SPREAD = 8

Estimator = Literal[
    "metropolis-least-squares", "estimate-averaging", "neighbourhood-least-squares", "running-sum", "flow-updating"
]


@dataclass(frozen=True)
class DfaParameters:
    """Parameters of a module.

    rate: samples per second, the rate of the world's sensors.
    rounds: rounds of communication per sample.
    timing: whether a round uses the frames of that round only, or the newest frame of each neighbour.
    payload: precision of the numbers in a frame.
    model: report the state of the linearised model, or convert it to the exact state of the tilted plane.
    phase: rounds of all modules at the same instants, or shifted by a phase drawn from the seed.
    hold: keep the first sample, so that consensus runs on one measurement.
    report_rounds: report the estimate after every round, as `estimate/round`.
    """

    rate: Hertz = 20.0
    estimator: Estimator = "metropolis-least-squares"
    rounds: Count = 3
    timing: Literal["synchronous", "asynchronous"] = "synchronous"
    payload: payloads.Precision = "float32"
    model: Literal["linear", "exact"] = "linear"
    phase: Literal["aligned", "drawn"] = "drawn"
    hold: bool = False
    report_rounds: bool = False

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(self, "rate")
        if self.rounds < 1:
            raise BadInput(f"rounds is {self.rounds}, at least 1 is needed")
        if self.timing == "asynchronous" and self.estimator not in CONSENSUS:
            raise BadInput(f"{self.estimator} starts anew with each sample: it needs timing: synchronous")

    @property
    def round_rate(self) -> float:
        """Rounds per second."""
        return self.rate * self.rounds

    @property
    def largest_payload(self) -> int:
        """Bytes of the longest message with the largest counts."""
        longest = np.zeros(message_size(self.estimator))
        return len(payloads.encode([COUNTS - 1, self.rounds, longest], self.payload))

    def spread_ns(self) -> int:
        """Largest phase of a module's rounds [ns]: shorter for synchronous rounds, which need each other's frames."""
        if self.phase == "aligned":
            return 0
        share = _SYNCHRONOUS_SPREAD if self.timing == "synchronous" else 1
        return period_ns(self.round_rate, 1) // share
