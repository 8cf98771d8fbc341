"""Measurement units of a rigid body: each learns an attitude from its sensors, and all agree on one, Betanzos 2024.

After each sample a unit does a step of the dynamic consensus with its neighbours' messages of the previous sample,
takes the average as the prior of its own estimate, and sends both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...estimators.attitude.directions import learned_quaternion
from ...estimators.attitude.dynamic_consensus import AttitudeMessage, consensus_step
from ...estimators.attitude.trust import Trust, updated_trust
from ...rotations import conjugate, euler_to_quaternion, mean_quaternion, quaternion_product, rotate
from ...units import first_period, period_ns
from ...worlds.rigid_body.measurement_units import DIRECTIONS
from ..agent import Agent, Context, Offer, Received, Sample, Timer
from ..plan import Plan
from ..sample_counts import COUNTS
from . import attitude_network as network
from .attitude_network import ALONE, ATTITUDE, OWN
from .attitude_unit_settings import AttitudeParameters, UnitMessage
from .inbox import Inbox

Floats = NDArray[np.float64]

_REFERENCES: Mapping[str, Floats] = {sensor: np.array(direction) for sensor, direction in DIRECTIONS.items()}


class AttitudeUnit(Agent):
    """One unit, in the network or alone. One that starts later listens for up to a second before its first round.

    It reports the attitude of the body as a unit quaternion: in the network the average as `attitude`, alone its own
    estimate as `attitude-alone`. `messages`, once a second, are the numbers of messages used, too late, and ahead of
    its clock so far.
    """

    Parameters = AttitudeParameters
    evaluation = "volery.experiments.evaluation.attitude_evaluation:AttitudeEvaluation"
    timers_only = True

    parameters: AttitudeParameters

    def __init__(self, context: Context, parameters: AttitudeParameters) -> None:
        super().__init__(context, parameters)
        self._alone = parameters.is_alone(context.name)
        self._mounting = euler_to_quaternion(*(parameters.mounting(context.name) or (0.0, 0.0, 0.0)))
        self._phase_ns = int(parameters.spread_ns() * context.random("phase").uniform(0))
        self._seen: dict[str, Floats] = {}
        self._trust = {sensor: Trust() for sensor in _REFERENCES}
        self._inbox = Inbox(parameters.max_age)
        self._state: AttitudeMessage | None = None

    def start(self) -> None:
        """Wait for the next round."""
        first = first_period(self.parameters.rate, max(0, self.context.now_ns - self._phase_ns))
        self._listens_until = first + round(self.parameters.rate) if first and not self._alone else first
        self._wait(first)

    def _wait(self, index: int) -> None:
        self.context.set_timer(period_ns(self.parameters.rate, index) + self._phase_ns, index=index)

    def on_sample(self, sample: Sample) -> None:
        """Keep the measured direction for the next round, unless the sensor saw nothing."""
        norm = 0.0 if sample.value is None else float(np.linalg.norm(sample.value))
        if sample.value is not None and 0.0 < norm < math.inf:
            self._seen[sample.sensor] = sample.value / norm

    def on_frame(self, frame: Received) -> None:
        """Keep the message for a round."""
        self._inbox.put(frame.source, UnitMessage.decode(frame.payload))

    def on_timer(self, timer: Timer) -> None:
        """One round: average, learn, report, send."""
        count = timer.index % COUNTS
        received = self._inbox.take(count, self._partners)
        if self._state is None and not received and timer.index < self._listens_until:
            self._wait(timer.index + 1)
            return
        prior = self._prior(received)
        directions, own = self._learned(prior, received)
        self._state = AttitudeMessage(own, own if self._alone else prior)
        self._report(timer.index)
        if not self._alone:
            payload = UnitMessage(count, directions, self._state).encode(self.parameters.payload)
            for other in self._partners:
                self.context.send(other, payload, stream="attitude")
        self._wait(timer.index + 1)

    @property
    def _partners(self) -> list[str]:
        """Present neighbours in the network; none if this unit is alone."""
        if self._alone:
            return []
        return [other for other in self.context.neighbours if not self.parameters.is_alone(other)]

    def _prior(self, received: Mapping[str, UnitMessage]) -> Floats:
        """Average after one step, Betanzos 2024, (22); at first the mean of the neighbours, or the initial value."""
        if self._state is None:
            averages = [message.attitude.average for message in received.values()]
            return mean_quaternion(np.array(averages)) if averages else euler_to_quaternion(*self.parameters.initial)
        if self._alone:
            return self._state.average
        attitudes = {source: message.attitude for source, message in received.items()}
        return consensus_step(self._state, attitudes, self.parameters.step)

    def _learned(self, prior: Floats, received: Mapping[str, UnitMessage]) -> tuple[int, Floats]:
        """Number of directions used, and the attitude learned from them and the prior: (20), (18), (19), (21)."""
        frame = quaternion_product(prior, self._mounting)
        sensors = self._usable(frame, received)
        observed, references = [self._seen[sensor] for sensor in sensors], [_REFERENCES[sensor] for sensor in sensors]
        self._seen = {}
        if not sensors:
            return 0, prior
        learned = learned_quaternion(frame, observed, references, self.parameters.alpha, self.parameters.gamma)
        return len(sensors), quaternion_product(learned, conjugate(self._mounting))

    def _usable(self, frame: Floats, received: Mapping[str, UnitMessage]) -> list[str]:
        """Sensors that saw something and are trusted; all that saw something where no neighbour used a direction."""
        seen = [sensor for sensor in _REFERENCES if sensor in self._seen]
        bound = self.parameters.trust
        if bound is None or self._alone:
            return seen
        for sensor in seen:
            expected = rotate(conjugate(frame), _REFERENCES[sensor])
            before = self._trust[sensor]
            now = updated_trust(before, _angle(self._seen[sensor], expected), bound, self.parameters.share)
            if now.trusted != before.trusted:
                self.context.note("sensor trusted again" if now.trusted else "sensor put aside", sensor=sensor)
            self._trust[sensor] = now
        trusted = [sensor for sensor in seen if self._trust[sensor].trusted]
        return trusted or ([] if any(message.directions for message in received.values()) else seen)

    def _report(self, index: int) -> None:
        assert self._state is not None, "a round has made it"
        self.context.report(ALONE if self._alone else ATTITUDE, self._state.average, index)
        if self.parameters.report_own and not self._alone:
            self.context.report(OWN, self._state.estimate, index)
        if not self._alone and index % max(1, round(self.parameters.rate)) == 0:
            box = self._inbox
            self.context.report(network.MESSAGES, [box.used, box.late, box.ahead], index)

    def save(self) -> Any:
        """The attitudes and the trust in the sensors."""
        state = None if self._state is None else [self._state.estimate.tolist(), self._state.average.tolist()]
        return [state, {sensor: [trust.mean_square, trust.trusted] for sensor, trust in self._trust.items()}]

    def restore(self, state: Any) -> None:
        """Restore the attitudes and the trust; messages from before the kill are lost."""
        attitudes, trust = state
        if attitudes is not None:
            self._state = AttitudeMessage(*(np.array(attitude) for attitude in attitudes))
        self._trust = {sensor: Trust(*fields) for sensor, fields in trust.items()}

    @classmethod
    def offers(cls, plan: Plan, name: str) -> Offer:
        """One frame per sample to each neighbour; none where it or all its neighbours are alone."""
        parameters: AttitudeParameters = plan.agent(name).parameters
        return Offer(parameters.largest_payload, parameters.rate if network.partners(plan, name) else 0.0)

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """See `attitude_network.problems`."""
        return network.problems(plan)


def _angle(first: Floats, second: Floats) -> float:
    """Angle between two unit vectors [rad]."""
    return 2.0 * math.atan2(float(np.linalg.norm(first - second)), float(np.linalg.norm(first + second)))
