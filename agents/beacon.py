"""Beacons: agents that estimate nothing and send payloads of one size, for experiments with links and media."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from ..errors import BadInput
from ..units import Bytes, Hertz, check_fields_above_zero, first_period, period_ns
from .agent import Agent, Context, Received, Timer
from .idle import refuse_idle
from .plan import Plan

_SEND, _REPORT = "send", "report"
_COUNTER_BYTES = 8


@dataclass(frozen=True)
class BeaconParameters:
    """What a beacon sends, and who talks.

    `rate` is that of the payloads to each neighbour, `size` their length. `pattern`: at even intervals, or with
    independent exponential intervals of mean 1/rate. `phase` of the even ones: drawn from the seed, or 0 for all.
    `broadcast`: one transmission for all neighbours where they share a radio, instead of one to each.
    `talkers`: all agents, those with one neighbour, or the named ones; the others only listen. Every agent reports
    `report` times a second how many payloads it has received.
    """

    rate: Hertz = 10.0
    size: Bytes = 20
    pattern: Literal["periodic", "poisson"] = "periodic"
    phase: Literal["drawn", "aligned"] = "drawn"
    broadcast: bool = False
    talkers: Literal["all", "leaves"] | tuple[str | int, ...] = "all"
    report: Hertz = 1.0

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(self, "rate", "report")
        if self.size < 1:
            raise BadInput(f"size is {self.size} B, a payload has at least 1 B")
        if not self.talkers:
            raise BadInput("talkers is empty, so nobody would send: write all, leaves, or names of agents")
        if self.pattern == "poisson":
            refuse_idle(self, ("phase",), "pattern is poisson, which has no phase: leave it out, or choose periodic")

    @property
    def named(self) -> tuple[str, ...]:
        """The agents that `talkers` names."""
        return tuple(map(str, self.talkers)) if isinstance(self.talkers, tuple) else ()

    def talks(self, name: str, degree: int) -> bool:
        """Whether an agent of this name, with so many neighbours, sends."""
        return name in self.named or self.talkers == "all" or (self.talkers == "leaves" and degree == 1)


class Beacon(Agent):
    """Sends on timers and counts what it receives, reported as `received`; a restart with state counts on."""

    Parameters = BeaconParameters
    evaluation = "volery.experiments.evaluation.beacon_evaluation:BeaconEvaluation"
    timers_only = True

    def __init__(self, context: Context, parameters: BeaconParameters) -> None:
        super().__init__(context, parameters)
        self._received = 0
        self._intervals = context.random("interval")
        self._phase_ns = int(context.random("phase").uniform(0) * period_ns(parameters.rate, 1))

    def start(self) -> None:
        """Set the first timers, at the next instant of their patterns."""
        now_ns = self.context.now_ns
        index = first_period(self.parameters.report, now_ns)
        self.context.set_timer(period_ns(self.parameters.report, index), _REPORT, index)
        if self.parameters.talks(self.context.name, self.context.degrees[self.context.name]):
            self._wait(now_ns, 0)

    def on_frame(self, frame: Received) -> None:
        """Count it."""
        self._received += 1

    def on_timer(self, timer: Timer) -> None:
        """Send to all neighbours of now, or report."""
        if timer.name == _REPORT:
            self.context.report("received", self._received, timer.index)
            following = period_ns(self.parameters.report, timer.index + 1)
            self.context.set_timer(following, _REPORT, timer.index + 1)
            return
        parameters: BeaconParameters = self.parameters
        payload = timer.index.to_bytes(_COUNTER_BYTES, "big").rjust(parameters.size, b"\0")[-parameters.size :]
        if parameters.broadcast:
            self.context.broadcast(payload, stream="beacon")
        for other in () if parameters.broadcast else self.context.neighbours:
            self.context.send(other, payload, stream="beacon")
        self._wait(timer.time_ns + 1, timer.index + 1)

    def _wait(self, from_ns: int, index: int) -> None:
        """Set the timer of the index-th payload, not before an instant."""
        parameters: BeaconParameters = self.parameters
        if parameters.pattern == "poisson":
            due_ns = from_ns + int(-math.log(self._intervals.uniform(index)) * 1e9 / parameters.rate)
        else:
            phase_ns = self._phase_ns if parameters.phase == "drawn" else 0
            due_ns = phase_ns + period_ns(parameters.rate, first_period(parameters.rate, max(0, from_ns - phase_ns)))
        self.context.set_timer(due_ns, _SEND, index)

    def save(self) -> int:
        """The number of payloads received so far."""
        return self._received

    def restore(self, state: Any) -> None:
        """Count on from there."""
        self._received = state

    @classmethod
    def largest_payload(cls, parameters: Any) -> int:
        """The one size."""
        size: int = parameters.size
        return size

    @classmethod
    def sends_per_second(cls, parameters: Any) -> float | None:
        """The rate, if all talk; else it depends on the agent."""
        rate: float = parameters.rate
        return rate if parameters.talkers == "all" else None

    @classmethod
    def is_silent(cls, plan: Plan, name: str) -> bool:
        """Who is not among the talkers only listens."""
        agent = plan.agent(name)
        return not agent.parameters.talks(name, len(agent.neighbours))

    @classmethod
    def broadcasts(cls, parameters: Any) -> bool:
        """As its parameter says."""
        once: bool = parameters.broadcast
        return once

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """Names of unknown agents, or leaves where there are none."""
        beacons = [agent for agent in plan.agents if isinstance(agent.parameters, BeaconParameters)]
        named = {str(name) for agent in beacons for name in agent.parameters.named}
        if strangers := sorted(named - {agent.name for agent in plan.agents}):
            return [f"talkers names {', '.join(strangers)}, and there is no such agent"]
        if not any(agent.parameters.talks(agent.name, len(agent.neighbours)) for agent in beacons):
            return ["talkers is leaves, and every agent has more than one neighbour: take a star, or name the talkers"]
        return []
