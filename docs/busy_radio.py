"""Radios that always have something to send, for csma.py; a user's own kind of agent."""

# ruff: noqa: TID251 - it is a user of the package
from __future__ import annotations

from dataclasses import dataclass

from volery.agents.agent import Agent, Timer
from volery.agents.plan import Plan

LISTENER = "1"
_EVERY_NS = 2_000_000


@dataclass(frozen=True)
class BusyParameters:
    """Length of the payloads in bytes."""

    size: int = 108


class Busy(Agent):
    """Offers a frame for the listener more often than any could leave."""

    Parameters = BusyParameters
    timers_only = True
    parameters: BusyParameters

    def start(self) -> None:
        """All but the listener begin at once."""
        if self.context.name != LISTENER:
            self.context.set_timer(_EVERY_NS)

    def on_timer(self, timer: Timer) -> None:
        """Offer one more."""
        self.context.send(LISTENER, bytes(self.parameters.size))
        self.context.set_timer(timer.time_ns + _EVERY_NS)

    @classmethod
    def is_silent(cls, plan: Plan, name: str) -> bool:
        """The listener is."""
        return name == LISTENER
