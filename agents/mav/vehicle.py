"""A micro aerial vehicle of a formation: it estimates the whole formation, controls it, and keeps one other in view.

With each frame of its camera: predict with the estimated forces of all vehicles, update with sightings and messages,
command its own force (Nägeli 2014, Algorithm 1 and Sec. III-B), and yaw towards the tracked vehicle (Sec. III-D). With
each sample of its inertial measurement unit: update its inertial frame (Algorithm 2). On a timer: send a message.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...estimators.formation.control import control, regulator
from ...estimators.formation.filter import steps_to
from ...estimators.formation.formation_consensus import ConsensusFilter
from ...estimators.formation.formation_messages import Message
from ...estimators.frames.frame_consensus import FrameConsensus
from ...rotations import conjugate, quaternion_product, rotate
from ...units import first_period, period_ns
from ..agent import Agent, Context, Received, Sample, Timer
from ..payloads import DamagedPayload
from ..plan import Plan
from . import problems as mav_problems
from .mav_messages import decode, encode
from .mav_samples import CAMERA, IMU, Sight, frame_model, read_camera, read_imu, sightings
from .mav_settings import MavParameters

SIGHTS_KEPT_NS = 1_000_000_000
STAMP_NS = 1_000_000
"""Stamps are rounded to less than this."""
FORMATION, FORCE, ATTITUDE, COVARIANCE = "formation", "force", "attitude", "covariance"
_RADIO = "radio"
_LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


class Mav(Agent):
    """One vehicle. It acts on samples and timers only: messages are used with the next frame of its camera.

    Reports `formation`, its estimate in the paper's order; besides, its own `force` [N, inertial], its `attitude`
    (quaternion) and, on request, the `covariance`.
    """

    Parameters = MavParameters
    evaluation = "volery.experiments.evaluation.mav_evaluation:MavEvaluation"
    timers_only = True
    parameters: MavParameters

    def __init__(self, context: Context, parameters: MavParameters) -> None:
        super().__init__(context, parameters)
        names = context.swarm
        self._names, self._me = names, names.index(context.name)
        self._gone: frozenset[int] = frozenset()
        self._others = tuple(number for number in range(len(names)) if number != self._me)
        self._messages = 0
        self._last = dict.fromkeys(self._others, 0)
        self._references = parameters.states(len(names))
        self._layout = parameters.messages.layout(len(names))
        self._forces = np.zeros((len(names), 3))
        own = parameters.filter(len(names), context.now_ns)
        self._filter = ConsensusFilter(own, parameters.filtering.settings())
        frames = parameters.frames
        anchor = frames.anchor if frames.consensus else 0.0
        on_ground = frames.upright if context.now_ns == 0 else None
        self._frames = FrameConsensus(context.name, {}, frames.step, frame_model(), anchor=anchor, upright=on_ground)
        self._regroup()
        self._sights: deque[tuple[int, Mapping[int, Sight]]] = deque()
        self._seen_ns = self._met_ns = context.now_ns
        self._turned = 0.0
        self._holds = self._lost = False
        self._unusable = 0

    def start(self) -> None:
        """Set the timer of the radio."""
        drawn = self.parameters.phase == "drawn"
        phase = self.context.random("radio").uniform(0) if drawn else 0.0
        self._phase_ns = int(phase * period_ns(self.parameters.radio, 1))
        self._next_message(max(0, self.context.now_ns - self._phase_ns))

    def _next_message(self, from_ns: int) -> None:
        index = first_period(self.parameters.radio, from_ns)
        self.context.set_timer(self._phase_ns + period_ns(self.parameters.radio, index), _RADIO, index)

    def _regroup(self) -> None:
        """Set the tracked vehicle and the gain for the vehicles that are not left out."""
        self._tracked = self.parameters.tracked(self._names, self._gone).get(self._me, self._me)
        self._gain = regulator(self._filter.own.model, self.parameters.weights, self._gone)
        if self.parameters.frames.consensus and self._tracked != self._me:
            self._frames.weigh({self._names[self._tracked]: 1.0})

    # -- samples and messages ---------------------------------------------------------------------------------------

    def on_sample(self, sample: Sample) -> None:
        """Update the inertial frame with each IMU sample, everything else with each frame of the camera."""
        if sample.sensor == IMU and sample.value is not None:
            self._frames.predict(sample.time_ns)
            self._frames.update(**read_imu(sample.value))
        elif sample.sensor == CAMERA and sample.time_ns >= self._filter.own.time_ns:
            self._see(sample)
        elif sample.sensor == CAMERA:
            self.context.note("frame from the past")

    def on_frame(self, frame: Received) -> None:
        """Keep a message for the next frame of the camera."""
        sender = self._names.index(frame.source)
        try:
            message = decode(self._layout, frame.payload, sender=sender, now_ns=frame.time_ns)
        except DamagedPayload as error:
            self.context.note("damaged message", source=frame.source, reason=str(error))
            return
        self._met_ns = frame.time_ns
        self._messages += 1
        self._last[sender] = self._messages
        self._filter.receive(message)
        if sender == self._tracked:
            self._compare_frames(frame.source, message)

    def _compare_frames(self, source: str, message: Message) -> None:
        """Own attitude from that of a vehicle in view and its seen orientation: R_i = R_j ξᵀ."""
        attitude = getattr(message, "attitude", None)
        if attitude is None or not self.parameters.frames.consensus:
            return
        for time_ns, sights in self._sights:
            if abs(time_ns - message.time_ns) < STAMP_NS and self._tracked in sights:
                own = quaternion_product(attitude, conjugate(sights[self._tracked].orientation))
                self._frames.receive(source, own, time_ns)

    # -- one step of the camera ---------------------------------------------------------------------------------------

    def _see(self, sample: Sample) -> None:
        now_ns = sample.time_ns
        self._leave_out()
        self._predict(now_ns)
        self._frames.agree()
        attitude = self._frames.attitude(now_ns)
        sights = read_camera(sample.value)
        self._remember(now_ns, sights)
        seen = [] if attitude is None else sightings(self.parameters, self._me, sights, attitude)
        self._filter.update(seen)
        self._note_unusable()
        self._hold_or_go_on(now_ns, lost=attitude is None)
        believed = _LEVEL if attitude is None else attitude
        thrust, yaw_rate = self._thrust(now_ns, believed), self._yaw_rate(sights, believed)
        self.context.command({"thrust": thrust, "yaw-rate": [yaw_rate]})
        self._report(sample.index, attitude)

    def _leave_out(self) -> None:
        """Leave out vehicles that are silent while others send; where all are silent, nobody is left out."""
        several = len(self._others) - 1
        most = several * self.parameters.radio * self.parameters.silence * 1e-9
        silent = frozenset(other for other, last in self._last.items() if several and self._messages - last > most)
        if silent == self._gone:
            return
        for other in sorted(silent ^ self._gone):
            self.context.note("left out" if other in silent else "taken in again", vehicle=self._names[other])
        self._gone = silent
        self._regroup()

    def _note_unusable(self) -> None:
        """Note messages that are too old, or stamped too far ahead, to be propagated to now."""
        unusable = self._filter.message_counts.too_old + self._filter.message_counts.ahead
        if unusable > self._unusable:
            self._unusable = unusable
            self.context.note("messages out of reach")

    def _predict(self, now_ns: int) -> None:
        """Predict with the forces of the last step, in several steps where frames of the camera are missing."""
        for instant_ns in steps_to(self._filter.own.time_ns, now_ns):
            self._filter.predict(instant_ns, self._forces)

    def _remember(self, now_ns: int, sights: Mapping[int, Sight]) -> None:
        self._sights.append((now_ns, sights))
        while self._sights[0][0] < now_ns - SIGHTS_KEPT_NS:
            self._sights.popleft()
        if sights:
            self._met_ns = max(self._met_ns, now_ns)
        if self._tracked in sights:
            self._seen_ns = now_ns
        lost = self._seen_ns < now_ns - self.parameters.patience
        if lost != self._lost:
            self._lost = lost
            self.context.note("lost from sight" if lost else "in sight again", vehicle=self._names[self._tracked])

    def _hold_or_go_on(self, now_ns: int, *, lost: bool) -> None:
        """Carry the own weight only while the attitude is unknown, or after `patience` without sighting and message."""
        holds = lost or max(self._met_ns, self._seen_ns) < now_ns - self.parameters.patience
        if holds != self._holds:
            self._holds = holds
            self.context.note("holds" if holds else "goes on")

    def _thrust(self, now_ns: int, attitude: NDArray[np.float64]) -> NDArray[np.float64]:
        """Force that the regulator asks of the own vehicle, without its weight, in the body's axes [N]."""
        reference = self._references[self.parameters.reference_at(now_ns)]
        if self._holds:
            self._forces = np.zeros_like(self._forces)
        else:
            self._forces = control(self._gain, self._filter.own.state, reference)
        return rotate(conjugate(attitude), self._forces[self._me])

    def _yaw_rate(self, sights: Mapping[int, Sight], attitude: NDArray[np.float64]) -> float:
        """PI control of the bearing of the tracked vehicle, as seen or else as estimated [rad/s]."""
        if self._tracked in sights:
            ahead = sights[self._tracked].place
        else:
            apart, _ = self._filter.own.pair(self._tracked, self._me)
            ahead = rotate(conjugate(attitude), apart[:3])
        bearing = math.atan2(ahead[1], ahead[0])
        self._turned += bearing / self.parameters.rate
        self._turned = max(-1.0, min(1.0, self._turned))
        wanted = self.parameters.yaw_gain * bearing + self.parameters.yaw_integral * self._turned
        return max(-self.parameters.yaw_rate, min(self.parameters.yaw_rate, wanted))

    def _report(self, index: int, attitude: NDArray[np.float64] | None) -> None:
        if index % self._every(self.parameters.report) == 0:
            self.context.report(FORMATION, self._filter.own.state, index)
            self.context.report(FORCE, self._forces[self._me], index)
            if attitude is not None:
                self.context.report(ATTITUDE, attitude, index)
        rate = self.parameters.report_covariance
        if rate > 0 and index % self._every(rate) == 0:
            self.context.report(COVARIANCE, self._filter.own.covariance, index)

    def _every(self, rate: float) -> int:
        return max(1, round(self.parameters.rate / rate))

    # -- the radio ----------------------------------------------------------------------------------------------------

    def on_timer(self, timer: Timer) -> None:
        """Send the estimate of the last frame of the camera; missed instants are skipped."""
        if (message := self._message()) is not None:
            self.context.broadcast(encode(self._layout, message), stream="formation")
        self._next_message(max(timer.time_ns, self.context.now_ns) - self._phase_ns + 1)

    def _message(self) -> Message | None:
        """The message; None where it carries an attitude and that is not known."""
        if self._layout.kind == "full":
            return self._filter.full_message(self._me)
        now_ns = self._filter.own.time_ns
        attitude = self._frames.attitude(now_ns)
        if attitude is None and self._layout.attitude:
            return None
        unseen_ns = max(0, now_ns - self._seen_ns)
        return self._filter.pair_message(self._me, self._tracked, unseen_ns=unseen_ns, attitude=attitude)

    # -- properties of the class --------------------------------------------------------------------------------------

    @classmethod
    def sends_per_second(cls, parameters: Any) -> float:
        """Rate of the radio."""
        rate: float = parameters.radio
        return rate

    @classmethod
    def largest_payload(cls, parameters: Any) -> int:
        """Size of a packet, which no message exceeds."""
        packet: int = parameters.messages.packet
        return packet

    @classmethod
    def broadcasts(cls, parameters: Any) -> bool:
        """Always."""
        return True

    @classmethod
    def libraries(cls, parameters: Any) -> Sequence[str]:
        """The compiler of its filter, if it is compiled."""
        return ("numba",) if parameters.filtering.form == "compiled" else ()

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """See `problems.problems`."""
        return mav_problems.problems(plan)
