"""Agents that do nothing but tell what they would send, for scenarios in tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from volery.agents.agent import Agent
from volery.agents.plan import Plan
from volery.units import Hertz, Metres, Nanoseconds


@dataclass(frozen=True)
class Gain:
    """Nested parameters."""

    value: float = 1.0
    reach: Metres = 0.5


@dataclass(frozen=True)
class Parameters:
    """One of each sort."""

    rate: Hertz = 20.0
    estimator: Literal["mean", "median"] = "mean"
    rounds: int = 3
    payload: int = 46
    wait: Nanoseconds | None = None
    gain: Gain = Gain()
    lengths: tuple[Metres, ...] = ()


class Talker(Agent):
    """Says how much it would send."""

    Parameters = Parameters

    @classmethod
    def largest_payload(cls, parameters: Any) -> int | None:
        """As the parameters say."""
        size: int = parameters.payload
        return size

    @classmethod
    def sends_per_second(cls, parameters: Any) -> float | None:
        """A frame per round."""
        frames: float = parameters.rate * parameters.rounds
        return frames

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """Refuses 13 rounds."""
        return ["13 rounds are unlucky: take 12"] if plan.agents[0].parameters.rounds == 13 else []


class Silent(Agent):
    """Tells nothing beforehand."""
