"""A module of the Distributed Flight Array: a distance sensor, infrared links, and an estimator in rounds.

Synchronous rounds belong to a sample: each sample starts the estimator again, a round uses only frames with its own
(sample, round), and the last round gives the estimate. Where the graph changes, all rounds of a sample use the
neighbours and degrees of its first one. Asynchronous rounds never start again: they use the newest frame of each
neighbour, whatever its round, and a new sample replaces the own input.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...estimators.flying_array.least_squares import noncollinear
from ...estimators.flying_array.plane import exact_state
from ...topologies import metropolis_weight, natural_key
from ...transport.links import LinkSettings
from ...transport.media import earliest_start
from ...transport.media_settings import EDGE_SLOTS, FullDuplex
from ...units import period_ns
from ...worlds.plane.plane_world import SENSOR
from .. import payloads
from ..agent import Agent, Context, Received, Sample, Timer
from ..plan import Plan
from ..sample_counts import COUNTS, age
from .dfa_settings import DfaParameters
from .estimators import Rounds, rounds

_ROUNDS_CHECKED = 240
Tag = tuple[int, int]
"""Sample and round of a message."""
_NEWEST: Tag = (0, 0)
"""Tag of all asynchronous messages."""


class DfaModule(Agent):
    """One module of the array."""

    Parameters = DfaParameters
    evaluation = "volery.experiments.evaluation.dfa_evaluation:DfaEvaluation"
    timers_only = True

    parameters: DfaParameters

    def __init__(self, context: Context, parameters: DfaParameters) -> None:
        super().__init__(context, parameters)
        self._phase_ns = int(parameters.spread_ns() * context.random("phase").uniform(0))
        self._running = self._sampled = False
        self._latest: float | None = None
        self._open: Tag = _NEWEST
        self._received: dict[Tag, dict[str, NDArray[np.float64]]] = {}
        self._rounds = self._fresh()
        self._synchronous = parameters.timing == "synchronous"

    def _fresh(self) -> Rounds:
        position = self.context.position
        assert position is not None, "problems() refuses arrays without positions"
        self._partners = self.context.neighbours
        own = self.context.degrees[self.context.name]
        weights = {other: metropolis_weight(own, self.context.degrees[other]) for other in self.context.neighbours}
        return rounds(self.parameters.estimator, position, weights)

    def on_sample(self, sample: Sample) -> None:
        """Start the rounds of this sample; an asynchronous estimator takes the sample into the running ones."""
        first, self._running = not self._running, True
        if not self._sampled or not self.parameters.hold:
            self._sampled = True
            self._latest = None if sample.value is None else float(sample.value[0])
            if not self._synchronous:
                self._rounds.take(self._latest)
        each = self.parameters.rounds
        if self._synchronous:
            for number in range(each + 1):
                self._set_round(sample.index * each + number, sample.index, number)
        elif first:
            self._set_round(sample.index * each, sample.index, 0)

    def _set_round(self, count: int, sample: int, number: int) -> None:
        time_ns = period_ns(self.parameters.round_rate, count) + self._phase_ns
        self.context.set_timer(time_ns, str(number), sample)

    def on_timer(self, timer: Timer) -> None:
        """End one round and begin the next."""
        sample, number = timer.index, int(timer.name)
        if self._synchronous:
            self._synchronous_round(sample, number)
        else:
            self._end_round(sample, number + 1, _NEWEST)
            self._send_messages(_NEWEST)
            count = sample * self.parameters.rounds + number + 1
            self._set_round(count, *divmod(count, self.parameters.rounds))

    def _synchronous_round(self, sample: int, number: int) -> None:
        if number == 0:
            self._rounds = self._fresh()
            self._rounds.take(self._latest)
        else:
            self._end_round(sample, number, (sample % COUNTS, number - 1))
        if number < self.parameters.rounds:
            self._open = (sample % COUNTS, number)
            self._send_messages(self._open)
        else:
            self._open = ((sample + 1) % COUNTS, 0)

    def _end_round(self, sample: int, number: int, tag: Tag) -> None:
        """Update with the messages of this round; report after the last round of a sample, on request after each."""
        received = self._received.pop(tag, {})
        self._rounds.update({source: vector for source, vector in received.items() if source in self._partners})
        each = self.parameters.rounds
        if number < each and not self.parameters.report_rounds:
            return
        state = self._rounds.estimate()
        if state is None:
            return
        if self.parameters.model == "exact":
            state = exact_state(state)
        if number == each:
            self.context.report("estimate", state, sample)
        if self.parameters.report_rounds:
            self.context.report("estimate/round", state, sample * each + number)

    def _send_messages(self, tag: Tag) -> None:
        """Send each neighbour its message; one that is the same for all is encoded once."""
        encoded, payload = None, b""
        for other in self._partners:
            vector = self._rounds.message(other)
            if vector is not None and other in self.context.neighbours:
                if vector is not encoded:
                    encoded, payload = vector, payloads.encode([*tag, vector], self.parameters.payload)
                self.context.send(other, payload, stream="round")

    def on_frame(self, frame: Received) -> None:
        """Keep a message for its round, unless that is over; asynchronous rounds use the newest."""
        sample, number, vector = payloads.decode(frame.payload)
        if not self._synchronous or not _is_over((sample, number), self._open):
            self._received.setdefault((sample, number), {})[frame.source] = vector

    def save(self) -> Any:
        """Latest sample, and the state of an asynchronous estimator; synchronous ones start again with each sample."""
        return [self._sampled, self._latest, None if self._synchronous else self._rounds.save()]

    def restore(self, state: Any) -> None:
        """Continue at the next sample, with the messages exchanged before the kill."""
        self._sampled, self._latest, saved = state
        self._rounds.restore(saved)

    @classmethod
    def largest_payload(cls, parameters: DfaParameters) -> int:
        """Size of the longest message with the largest counts [bytes]."""
        return parameters.largest_payload

    @classmethod
    def sends_per_second(cls, parameters: DfaParameters) -> float:
        """One frame per round to each neighbour."""
        return parameters.round_rate

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """Problems: modules on a line, sensors of another rate, or synchronous rounds that are too short."""
        positions = [agent.position for agent in plan.agents if agent.position is not None]
        if plan.world is None:
            return ["dfa-module needs a world to look at: add `world: {kind: plane, …}`"]
        if not plan.is_uniform:
            return ["the modules of a flying array are all alike: remove `only` from agents"]
        if len(positions) < len(plan.agents):
            return ["dfa-module needs positions: use a topology that has them, such as hexagonal or cells"]
        if not noncollinear(positions):
            return ["the modules are on one line, so roll and pitch cannot be told apart: add a cell off the line"]
        return list(chain(_other_rates(plan), _unsteady(plan), _late_rounds(plan)))


def _is_over(tag: Tag, open_tag: Tag) -> bool:
    """Whether the round of a message is over."""
    behind = age(open_tag[0], tag[0])
    return tag[1] < open_tag[1] if behind == 0 else behind > 0


def _unsteady(plan: Plan) -> Iterator[str]:
    if plan.presence and any(agent.parameters.timing == "asynchronous" for agent in plan.agents):
        yield (
            "asynchronous estimators remember what each neighbour was told, so the graph must not change: "
            "use timing: synchronous, whose rounds begin anew with each sample"
        )


def _other_rates(plan: Plan) -> Iterator[str]:
    assert plan.world is not None
    for agent in plan.agents:
        rate = plan.world.sensors(agent.name).get(SENSOR)
        if rate != agent.parameters.rate:
            yield (
                f"agents.rate is {agent.parameters.rate:g} Hz, but the world's sensors run at {rate or 0:g} Hz: "
                "make them equal"
            )
            return


def _late_rounds(plan: Plan) -> Iterator[str]:
    """Problem of synchronous rounds that are over before their frames arrive, at mean latency."""
    kinds = {
        (
            agent.parameters,
            agent.compute_ns,
            plan.links[agent.name, other],
            natural_key(agent.name) > natural_key(other),
        )
        for agent in plan.agents
        for other in agent.neighbours
        if agent.parameters.timing == "synchronous"
    }
    worst_ns = max((_behind(plan, *kind) for kind in kinds), default=0)
    if worst_ns > 0:
        yield (
            f"synchronous rounds do not fit: a frame of mean latency comes {worst_ns / 1e6:.3f} ms after the round "
            "that waits for it; use fewer rounds, less latency, a smaller payload, "
            "phase: aligned, or timing: asynchronous"
        )


def _behind(plan: Plan, parameters: DfaParameters, compute_ns: int, settings: LinkSettings, second: bool) -> int:
    """Largest lag of a frame behind the end of its round [ns], at mean latency; negative if all arrive in time."""
    airtime_ns = settings.airtime_ns(parameters.largest_payload)
    latest = -(2**62)
    total = int(plan.duration_ns * parameters.round_rate / 1e9)
    for number in range(min(total, _ROUNDS_CHECKED)):
        for phase_ns in (0, parameters.spread_ns()):
            ready_ns = period_ns(parameters.round_rate, number) + phase_ns + compute_ns
            start_ns = ready_ns
            if not isinstance(settings.medium, FullDuplex):
                start_ns = earliest_start(settings.medium.access, ready_ns, airtime_ns, int(second), EDGE_SLOTS)
            due_ns = start_ns + airtime_ns + settings.typical_latency_ns()
            latest = max(latest, due_ns - period_ns(parameters.round_rate, number + 1))
    return latest
