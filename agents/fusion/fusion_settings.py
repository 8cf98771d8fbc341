"""Parameters of agents with a distributed filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from ...errors import BadInput
from ...estimators.distributed.filters import FilterChoice, choose_filter
from ...units import Count
from .. import payloads
from ..idle import refuse_idle
from ..sample_counts import COUNTS

SPREAD = 8
"""Phases are at most this fraction of a round, so that messages arrive before the end of the round that needs them."""


@dataclass(frozen=True)
class FusingParameters:
    """Parameters that all such agents have.

    filter: name of the filter, optionally with a way to average, such as hybrid/chebyshev; or package.module:Class.
    rounds: rounds of messages per sample.
    options: keyword arguments of the filter's class.
    payload: precision of the numbers in a frame.
    phase: rounds of all agents at the same instants, or shifted by a phase drawn from the seed.
    late: whether a message of an earlier sample is propagated to the present one, or dropped.
    memory: number of model steps that are kept to propagate late messages.
    """

    filter: str = "hybrid-contributions"
    rounds: Count = 3
    options: Mapping[str, float] = field(default_factory=dict)
    payload: payloads.Precision = "float32"
    phase: Literal["aligned", "drawn"] = "drawn"
    late: Literal["run-forward", "drop"] = "run-forward"
    memory: int = 8

    def __post_init__(self) -> None:
        """Check the bounds and the filter's name."""
        if self.rounds < 1:
            raise BadInput(f"rounds is {self.rounds}, at least 1 is needed")
        if not 1 <= self.memory < COUNTS // 2:
            raise BadInput(f"memory is {self.memory}, it must be from 1 to {COUNTS // 2 - 1}")
        if self.payload == "float16":
            raise BadInput(
                "payload is float16, in which information of small noises has no room: use float32 or float64"
            )
        if self.late == "drop":
            because = "late is drop, so no message is run forward: leave it out, or write late: run-forward"
            refuse_idle(self, ("memory",), because)
        self.chosen()

    def chosen(self) -> FilterChoice:
        """The filter.

        Raises:
            BadInput: no such filter, averaging or option.
        """
        return choose_filter(self.filter, self.options)
