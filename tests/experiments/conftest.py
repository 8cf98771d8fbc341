"""Agents and plans that the tests of the record share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.agents.agent import Agent, Received, Timer
from volery.agents.journal import Batch, Heard, Sent
from volery.agents.payloads import decode, encode
from volery.agents.plan import AgentPlan, Plan
from volery.experiments.evaluation.evaluation import Evaluation
from volery.experiments.record.evaluation_pass import evaluated
from volery.experiments.record.record import Collector, Record
from volery.experiments.twin import recorded
from volery.quantities import Component, Quantity
from volery.transport.faults import Fault
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings
from volery.units import period_ns

MS = 1_000_000
RATE_HZ = 20.0
PlanOf = Callable[..., Plan]
RecordOf = Callable[..., Record]


class AveragerEvaluation(Evaluation):
    """Of estimates in millimetres and degrees."""

    quantities = (Quantity("estimate", (Component("altitude", "mm", 1e3), Component("roll", "deg", 180 / np.pi))),)

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> NDArray[np.float64] | None:
        """The mean of all numbers."""
        mean = float(np.mean([float(each.name) for each in self.plan.agents]))
        return np.array([mean, -mean]) if quantity == "estimate" else None

    def truth(self, agent: str, quantity: str, index: int, time_ns: int) -> NDArray[np.float64] | None:
        """The mean, wrong by one in the first component."""
        mean = self.central_estimate(agent, quantity, index, time_ns)
        return None if mean is None else np.array([1.0, 0.0]) + mean


class Averager(Agent):
    """Averages its own number with what it heard last of its neighbours; its number is that of its name."""

    timers_only = True
    evaluation = AveragerEvaluation

    def start(self) -> None:
        """Begin at once."""
        self._value = np.array([float(self.context.name), -float(self.context.name)])
        self._heard: dict[str, NDArray[np.float64]] = {}
        self._sample = int(self.context.now_ns * RATE_HZ / 1e9) + 1
        self.context.set_timer(period_ns(RATE_HZ, self._sample), index=self._sample)

    def on_frame(self, frame: Received) -> None:
        """Remember it."""
        self._heard[frame.source] = decode(frame.payload)

    def on_timer(self, timer: Timer) -> None:
        """Average, report, tell the neighbours."""
        if self._heard:
            self._value = np.mean([self._value, *self._heard.values()], axis=0)
        self.context.report("estimate", self._value, timer.index)
        for neighbour in self.context.neighbours:
            self.context.send(neighbour, encode(self._value))
        self.context.set_timer(period_ns(RATE_HZ, timer.index + 1), index=timer.index + 1)


def _plan(edges: Sequence[tuple[str, str]], duration_ms: int = 1000, **changes: Any) -> Plan:
    settings = changes.pop("settings", LinkSettings(latency=Constant(5 * MS)))
    faults: tuple[Fault, ...] = changes.pop("faults", ())
    agent: type[Agent] = changes.pop("kind", Averager)
    assert not changes
    links = {link: settings for a, b in edges for link in ((a, b), (b, a))}
    near = {name: tuple(b for a, b in links if a == name) for name, _ in links}
    degrees = {name: len(others) for name, others in near.items()}
    kind = f"{agent.__module__}:{agent.__qualname__}"
    agents = tuple(AgentPlan(name, kind, None, near[name], degrees) for name in sorted(near, key=int))
    return Plan("crafted", 7, duration_ms * MS, agents, links, None, faults)


@pytest.fixture
def plan_of() -> PlanOf:
    """Make a plan of averagers: `plan_of(edges, duration_ms, settings=…, faults=…, kind=…)`."""
    return _plan


@pytest.fixture
def twin_run() -> Callable[[Plan], Record]:
    """Run a plan in the twin and give its record."""

    def run(plan: Plan) -> Record:
        return recorded(plan)

    return run


@pytest.fixture
def record_of(plan_of: PlanOf) -> RecordOf:
    """Make a record of agents "1" and "2" from batches: `record_of(batch, …, events=…, faults=…)`; it ends at 1 s."""

    def make(*batches: Batch, events: Sequence[dict[str, Any]] = (), faults: tuple[Fault, ...] = ()) -> Record:
        collector = Collector()
        for batch in batches:
            collector(batch)
        for event in (*events, {"event": "finished", "time_ns": 1000 * MS}):
            collector.event(event)
        return evaluated(collector.record(plan_of([("1", "2")], faults=faults)))

    return make


def sent(sequence: int, start_ms: int, verdict: str = "delivered") -> Sent:
    """A frame of 10 bytes from "1" to "2", 2 ms on the air, 3 ms under way."""
    return Sent("2", sequence, 10, start_ms * MS, 2 * MS, (start_ms + 5) * MS, verdict)


def heard(sequence: int, start_ms: int, fate: str = "delivered", incarnation: int = 0) -> Heard:
    """The same frame at "2"."""
    return Heard("1", incarnation, sequence, (start_ms + 5) * MS, fate)


@pytest.fixture(name="sent")
def sent_fixture() -> Callable[..., Sent]:
    """`sent(sequence, start_ms, verdict)`."""
    return sent


@pytest.fixture(name="heard")
def heard_fixture() -> Callable[..., Heard]:
    """`heard(sequence, start_ms, fate, incarnation)`."""
    return heard
