"""Agents with a distributed filter, in rounds of messages after each sample.

Rounds belong to a sample: the first begins when the sample is taken, the last ends when the next one is. A message
carries its sample and round. Each round uses the newest message of each neighbour that was not used before; one of an
earlier sample is first propagated by the filter. A `Problem` defines what is estimated, a `Filter` how.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...estimators.averages.average_consensus import LOCAL
from ...estimators.distributed.filtering import Filter, Moment, Place
from ...estimators.distributed.gaussian import Gaussian, Step, predict
from ...estimators.information import pack_symmetric
from ...topologies import metropolis_weight
from ...units import first_period, period_ns
from .. import payloads
from ..agent import Agent, Context, Offer, Received, Sample, Timer
from ..plan import Plan, PublicPlan
from ..sample_counts import COUNTS, age
from .fusion_settings import SPREAD, FusingParameters
from .problem import Briefing, Problem, Readings, parts, predicted_mean

ESTIMATE, COVARIANCE = "estimate", "covariance"
_TOO_FAR = 1e9
"""A mean that is more than this many standard deviations of the prior away has diverged."""
Tag = tuple[int, int]
"""Sample and round that a message belongs to."""


class FusingAgent(Agent):
    """Base of agents with a distributed filter; subclasses define the problem."""

    timers_only = True

    parameters: FusingParameters

    def __init__(self, context: Context, parameters: FusingParameters) -> None:
        super().__init__(context, parameters)
        self._own: Briefing = context.briefing
        self._problem = self._own.problem
        self._start = self._problem.prior
        self._bound = _TOO_FAR * float(np.sqrt(np.diag(self._start.covariance).max()))
        self._phase = context.random("phase").uniform(0) / SPREAD if parameters.phase == "drawn" else 0.0
        self._readings: dict[int, dict[str, NDArray[np.float64] | None]] = {}
        self._inbox: dict[str, dict[Tag, NDArray[np.float64]]] = {}
        self._used: dict[str, Tag] = {}
        self._steps: tuple[Step, ...] = ()
        self._filter: Filter | None = None
        self._sample = 0

    # -- defined by subclasses -----------------------------------------------------------------------------------

    @classmethod
    @abstractmethod
    def problem(cls, plan: PublicPlan) -> Problem:
        """What is estimated, from the agents' parameters and the known model of the world."""

    @classmethod
    @abstractmethod
    def unfit(cls, plan: Plan) -> Sequence[str]:
        """Why the world of a plan does not fit, each a sentence with the remedy."""

    # -- rounds ---------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Wait for the first sample."""
        self._sample = first_period(self._problem.rate, self.context.now_ns)
        self._set_round(self._sample * self.parameters.rounds)

    def on_sample(self, sample: Sample) -> None:
        """Keep the sample for its first round."""
        self._readings.setdefault(sample.index, {})[sample.sensor] = sample.value

    def on_timer(self, timer: Timer) -> None:
        """End one round and begin the next."""
        sample, number = divmod(timer.index, self.parameters.rounds)
        if self._filter is not None:
            ended = (sample, number - 1) if number else (sample - 1, self.parameters.rounds - 1)
            self._take_messages(self._filter, ended)
        if number == 0:
            if self._filter is not None:
                self._report(self._filter)
            self._begin(sample)
        self._send_messages((sample, number))
        self._set_round(timer.index + 1)

    def _set_round(self, count: int) -> None:
        sample, number = divmod(count, self.parameters.rounds)
        begin_ns = period_ns(self._problem.rate, sample)
        length_ns = period_ns(self._problem.rate, sample + 1) - begin_ns
        offset_ns = int((number + self._phase) * length_ns / self.parameters.rounds)
        self.context.set_timer(begin_ns + offset_ns, "round", count)

    def _begin(self, sample: int) -> None:
        readings: Readings = self._readings.get(sample, {})
        self._readings = {index: kept for index, kept in self._readings.items() if index > sample}
        if self._filter is None:
            self._filter = self._fresh(sample)
        else:
            step = self._problem.step([readings], self._filter.belief.mean)
            self._steps = (*self._steps, step)[-self.parameters.memory :]
        self._sample = sample
        mean = predicted_mean(self._filter.belief, self._steps)
        measurement = self._problem.measurement(self.context.name, readings, mean)
        self._weights = self._present_weights()
        self._filter.begin(Moment(sample, measurement, self._steps, self._weights))

    def _fresh(self, sample: int) -> Filter:
        """A new filter: the prior of the first sample, propagated without measurements."""
        prior = self._start
        for _ in range(sample):
            prior = predict(prior, self._problem.step([{}], prior.mean))
        place = Place(self.context.name, self.context.swarm, self.parameters.rounds, self._own.average.law)
        return self.parameters.chosen().make(place, prior)

    def _present_weights(self) -> Mapping[str, float]:
        if not self._own.local:
            return self._own.average.weights
        degrees = self.context.degrees
        mine = degrees[self.context.name]
        return {other: metropolis_weight(mine, degrees[other]) for other in self.context.neighbours}

    def _send_messages(self, tag: Tag) -> None:
        if self._filter is None or self._diverged(self._filter.belief):
            return
        sample, number = tag
        for other in self._weights:
            vector = self._filter.message(other)
            if vector is not None and other in self.context.neighbours:
                payload = payloads.encode([sample % COUNTS, number, vector], self.parameters.payload)
                self.context.send(other, payload, stream="round")

    def on_frame(self, frame: Received) -> None:
        """Keep a message until the end of its round."""
        counted, number, vector = payloads.decode(frame.payload)
        sample = self._sample - age(self._sample, counted)
        self._inbox.setdefault(frame.source, {})[sample, number] = vector

    def _take_messages(self, one: Filter, ended: Tag) -> None:
        """End a round: give the filter the newest unused message of each neighbour, late ones propagated."""
        received = {}
        for source, waiting in self._inbox.items():
            last = self._used.get(source, (-1, 0))
            newest = max((tag for tag in waiting if last < tag <= ended), default=None)
            if newest is not None:
                self._used[source] = newest
                late = ended[0] - newest[0]
                vector = waiting[newest] if late == 0 else self._propagated(one, waiting[newest], late)
                if vector is not None and source in self._weights:
                    received[source] = vector
        self._inbox = {
            source: {tag: vector for tag, vector in waiting.items() if tag > ended}
            for source, waiting in self._inbox.items()
        }
        if not self._diverged(one.belief):
            one.hear(received)

    def _propagated(self, one: Filter, vector: NDArray[np.float64], late: int) -> NDArray[np.float64] | None:
        return one.forward(vector, late) if self.parameters.late == "run-forward" else None

    def _report(self, one: Filter) -> None:
        """Report the result of a sample; infinity, with a note, once the filter has diverged."""
        if self._diverged(one.belief):
            belief, known = one.belief, False
        else:
            belief = one.end()
            known = not self._diverged(belief)
            if not known:
                self.context.note("diverged", sample=self._sample)
        self.context.report(ESTIMATE, belief.mean if known else np.full(len(belief.mean), np.inf), self._sample)
        self.context.report(COVARIANCE, pack_symmetric(belief.covariance), self._sample)

    def _diverged(self, belief: Gaussian) -> bool:
        return bool(np.abs(belief.mean - self._start.mean).max() > self._bound)

    # -- the run as a whole ---------------------------------------------------------------------------------------

    @classmethod
    def briefing(cls, plan: PublicPlan, name: str) -> Briefing:
        """The model, and this agent's weights."""
        averaging = plan.agent(name).parameters.chosen().averaging
        return Briefing(cls.problem(plan), parts(plan, averaging)[name], averaging in LOCAL)

    @classmethod
    def offers(cls, plan: Plan, name: str) -> Offer:
        """At most one frame per round to each neighbour; the messages of the first sample have the usual lengths."""
        if cls.unfit(plan):
            return Offer(None, None)
        own, parameters = plan.agent(name), plan.agent(name).parameters
        problem, part = cls.problem(plan.public), parts(plan.public, parameters.chosen().averaging)[name]
        agents = tuple(agent.name for agent in plan.agents)
        one = parameters.chosen().make(Place(name, agents, parameters.rounds, part.law), problem.prior)
        one.begin(Moment(0, None, (), part.weights))
        longest, sends = 0, False
        for _ in range(parameters.rounds):
            for other in own.neighbours:
                vector = one.message(other)
                if vector is not None:
                    sends = True
                    payload = payloads.encode([COUNTS - 1, parameters.rounds, vector], parameters.payload)
                    longest = max(longest, len(payload))
            one.hear({})
        return Offer(longest, problem.rate * parameters.rounds if sends else 0.0)

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """Problems: agents that differ, a world that does not fit, constant weights on a graph that changes."""
        if not plan.is_uniform:
            return ["agents with a distributed filter are all alike: remove `only` from agents"]
        found = list(cls.unfit(plan))
        averaging = plan.agents[0].parameters.chosen().averaging
        if plan.presence and averaging not in LOCAL:
            found.append(f"{averaging} weights are worked out for one graph, and this one changes: use metropolis")
        if not found:
            found.extend(_refused(plan, cls))
        return found


def _refused(plan: Plan, kind: type[FusingAgent]) -> Iterator[str]:
    """Problem of options that the filter's class refuses."""
    try:
        kind.offers(plan, plan.agents[0].name)
    except BadInput as error:
        yield f"filter {plan.agents[0].parameters.filter}: {error}"
