"""A coupled world for tests: carts on a line that are pushed, and agents that push by what they saw and heard."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.agents.agent import Agent, Received, Sample, Timer
from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.evaluation.evaluation import Evaluation, Finding, RunData, Series
from volery.randomness import stream

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CartWorld:
    """Carts of unit mass without friction, which start at 1, 2, 3 … m at rest; gauges of their places with noise."""

    agents: tuple[str, ...]
    seed: int = 0
    noise: float = 0.1
    rate: float = 50.0
    sense_delay_ns: int = 4_000_000
    act_delay_ns: int = 3_000_000
    truth_rate: float = 25.0

    def sensors(self, agent: str) -> Mapping[str, float]:
        """A gauge for each cart, and a buzzer of another rate that sees nothing."""
        return {"gauge": self.rate, "buzzer": 20.0}

    def begin(self) -> RunningCarts:
        """At rest."""
        return RunningCarts(self)


class RunningCarts:
    """Places and speeds; between pushes the motion is exact."""

    def __init__(self, world: CartWorld) -> None:
        self._world = world
        self._now_ns = 0
        self._place = np.arange(1.0, len(world.agents) + 1)
        self._speed = np.zeros(len(world.agents))
        self._force = np.zeros(len(world.agents))
        self._events: list[dict[str, Any]] = []

    def advance(self, time_ns: int) -> None:
        """Move on."""
        assert time_ns >= self._now_ns
        dt = (time_ns - self._now_ns) / 1e9
        self._place = self._place + dt * self._speed + dt**2 / 2 * self._force
        self._speed = self._speed + dt * self._force
        self._now_ns = time_ns

    def act(self, agent: str, command: str, value: Floats) -> None:
        """Push a cart with a force that lasts."""
        if command != "push" or value.shape != (1,):
            raise BadInput(f"cart {agent} cannot {command}")
        self._force[self._world.agents.index(agent)] = value[0]
        self._events.append({"event": "pushed", "time_ns": self._now_ns, "cart": agent})

    def measure(self, agent: str, sensor: str, index: int) -> Floats | None:
        """Where the cart is, with noise."""
        if sensor == "buzzer":
            return None
        draw = stream(self._world.seed, "gauge", agent).normal(index)
        place: float = self._place[self._world.agents.index(agent)] + self._world.noise * draw
        return np.array([place])

    def truth(self) -> Mapping[str, Floats]:
        """All places, and of each cart its speed."""
        speeds = {f"speed@{name}": self._speed[[index]] for index, name in enumerate(self._world.agents)}
        return {"places": self._place, **speeds}

    def events(self) -> list[dict[str, Any]]:
        """Pushes."""
        found, self._events = self._events, []
        return found


class CartEvaluation(Evaluation):
    """The central estimator knows all gauges, and how often anybody pushed."""

    def __init__(self, plan: Plan, world_reports: Mapping[str, Series]) -> None:
        super().__init__(plan, world_reports)
        self._seen = dict.fromkeys((agent.name for agent in plan.agents), np.nan)
        self.pushes = 0

    def sampled(self, agent: str, sample: Sample) -> None:
        """Keep the newest gauge."""
        if sample.value is not None:
            self._seen[agent] = float(sample.value[0])

    def commanded(self, agent: str, command: str, value: Floats, time_ns: int) -> None:
        """Count it."""
        self.pushes += 1

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats:
        """The gauges."""
        return np.array(list(self._seen.values()))

    def findings(self, run: RunData) -> Sequence[Finding]:
        """How many pushes it was told of."""
        return [Finding("pushes", self.pushes)]


class Driver(Agent):
    """Pushes its cart towards the mean of the places it heard of; reports what it believes all places to be."""

    evaluation = CartEvaluation

    def start(self) -> None:
        """Knows nothing yet."""
        self._names = sorted({self.context.name, *self.context.neighbours})
        self.places = dict.fromkeys(self._names, 0.0)

    def on_sample(self, sample: Sample) -> None:
        """Tell the neighbours now and then, and push."""
        if sample.value is None:
            self.context.note("silence", index=sample.index)
            return
        self.places[self.context.name] = float(sample.value[0])
        if sample.index % 5 == 0:
            self.context.broadcast(sample.value.tobytes())
        mean = sum(self.places.values()) / len(self.places)
        self.context.command({"push": [mean - self.places[self.context.name]]})
        if sample.index % 2 == 0:
            self.context.report("places", list(self.places.values()), sample.index // 2)

    def on_frame(self, frame: Received) -> None:
        """Take note."""
        self.places[frame.source] = float(np.frombuffer(frame.payload)[0])


class SteadyDriver(Driver):
    """The same, by a class that promises to act on samples and timers only."""

    timers_only = True

    def on_timer(self, timer: Timer) -> None:
        """It sets none."""
        raise AssertionError(timer)
