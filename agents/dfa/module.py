"""A module of the Distributed Flight Array: a distance sensor, infrared links, and an estimator in rounds.

Synchronous rounds belong to a sample: each sample starts the estimator anew, a round uses only frames of its own
(sample, round), and the estimate is there when the last round is. Where the graph changes, all rounds of a sample
have the neighbours and degrees of its first one. Asynchronous rounds go on and on: they use what was heard last,
whatever round it was of, and a new sample moves the own input.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...estimators.flying_array.plane import exact_state
from ...topologies import metropolis_weight
from ...units import period_ns
from .. import payloads
from ..agent import Agent, Context, Received, Sample, Timer
from ..plan import Plan
from . import array as flying_array
from .dfa_settings import COUNTS, DfaParameters
from .estimators import Rounds, rounds

_NEWEST = (0, 0)
Tag = tuple[int, int]
"""Sample and round that a message belongs to; asynchronous messages are all alike."""


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
        self._heard: dict[Tag, dict[str, NDArray[np.float64]]] = {}
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
        """Start the rounds of this sample; an asynchronous estimator takes it in where it stands."""
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
            self._tell(_NEWEST)
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
            self._tell(self._open)
        else:
            self._open = ((sample + 1) % COUNTS, 0)

    def _end_round(self, sample: int, number: int, tag: Tag) -> None:
        """Use what was heard for this round; report after the last round of a sample, on request after each."""
        heard = self._heard.pop(tag, {})
        self._rounds.hear({source: vector for source, vector in heard.items() if source in self._partners})
        state = self._rounds.estimate()
        if state is None:
            return
        if self.parameters.model == "exact":
            state = exact_state(state)
        each = self.parameters.rounds
        if number == each:
            self.context.report("estimate", state, sample)
        if self.parameters.report_rounds:
            self.context.report("estimate/round", state, sample * each + number)

    def _tell(self, tag: Tag) -> None:
        for other in self._partners:
            vector = self._rounds.message(other)
            if vector is not None and other in self.context.neighbours:
                payload = payloads.encode([*tag, vector], self.parameters.payload)
                self.context.send(other, payload, stream="round")

    def on_frame(self, frame: Received) -> None:
        """Keep a neighbour's message for its round, unless that is over; without rounds, the newest counts."""
        sample, number, vector = payloads.decode(frame.payload)
        if not self._synchronous or not _before((sample, number), self._open):
            self._heard.setdefault((sample, number), {})[frame.source] = vector

    def save(self) -> Any:
        """The latest sample, and where an asynchronous estimator stands; a synchronous one begins anew each time."""
        return [self._sampled, self._latest, None if self._synchronous else self._rounds.save()]

    def restore(self, state: Any) -> None:
        """Go on from there at the next sample, with what neighbours were told and have told before the death."""
        self._sampled, self._latest, saved = state
        self._rounds.restore(saved)

    @classmethod
    def largest_payload(cls, parameters: DfaParameters) -> int:
        """Bytes of the longest message with the largest counts."""
        return parameters.largest_payload

    @classmethod
    def sends_per_second(cls, parameters: DfaParameters) -> float:
        """One frame a round to each neighbour."""
        return parameters.round_rate

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """An array on a line, sensors of another rate, or rounds that cannot wait for each other."""
        return flying_array.problems(plan)


def _before(tag: Tag, open_tag: Tag) -> bool:
    """Whether a round is over, by counts that start again at `COUNTS`."""
    behind = (open_tag[0] - tag[0]) % COUNTS
    return tag[1] < open_tag[1] if behind == 0 else behind < COUNTS // 2
