"""The centralised estimator of a formation: one filter that has every camera and every vehicle's force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...agents.agent import Sample
from ...agents.mav.mav_samples import CAMERA, IMU, frame_model, read_camera, read_imu, sightings
from ...agents.mav.mav_settings import MavParameters
from ...agents.plan import Plan
from ...estimators.formation.filter import Observation, steps_to
from ...estimators.frames.frame_consensus import FrameConsensus
from ...rotations import rotate

_AT_ONCE = 20
"""Sightings in one update: with many more, their covariance costs more than that of the formation."""


class CentralisedFormation:
    """Algorithm 1 of Nägeli 2014 with all sightings of an instant in one update, and with the forces as commanded.

    It turns what a camera sees into the inertial frame by that vehicle's own attitude, as without consensus on frames.
    """

    def __init__(self, plan: Plan) -> None:
        first: MavParameters = plan.agents[0].parameters
        self._parameters = first
        self._names = tuple(agent.name for agent in plan.agents)
        count = len(self._names)
        self._filter = first.filter(count)
        frames = first.frames
        self._frames = {
            name: FrameConsensus(name, {}, frames.step, frame_model(), upright=frames.upright) for name in self._names
        }
        self._forces = np.zeros((count, 3))
        self._now_ns = 0
        self._seen: list[Observation] = []

    def sampled(self, agent: str, sample: Sample) -> None:
        """Keep what was seen until all of the instant is there."""
        frame = self._frames[agent]
        if sample.sensor == IMU and sample.value is not None:
            frame.predict(sample.time_ns)
            frame.update(**read_imu(sample.value))
        elif sample.sensor == CAMERA:
            self._go_on(sample.time_ns)
            attitude = frame.attitude(sample.time_ns)
            if attitude is not None:
                observer = self._names.index(agent)
                self._seen += sightings(self._parameters, observer, read_camera(sample.value), attitude)

    def commanded(self, agent: str, command: str, value: NDArray[np.float64], time_ns: int) -> None:
        """A force, by the vehicle's own attitude."""
        if command != "thrust":
            return
        attitude = self._frames[agent].attitude()
        if attitude is not None:
            self._go_on(time_ns)
            self._forces[self._names.index(agent)] = rotate(attitude, value)

    def _go_on(self, time_ns: int) -> None:
        """Take in all that was seen at the instant before, and predict to a later one."""
        if time_ns <= self._now_ns:
            return
        self._take_in()
        for instant_ns in steps_to(self._filter.time_ns, time_ns):
            self._filter.predict(instant_ns, self._forces)
        self._now_ns = time_ns

    def _take_in(self) -> None:
        """In several updates where there is much: their noises are independent, so that it comes to the same."""
        for first in range(0, len(self._seen), _AT_ONCE):
            self._filter.update(self._seen[first : first + _AT_ONCE])
        self._seen = []

    def state(self, time_ns: int) -> NDArray[np.float64]:
        """Of the formation at an instant, which is not before anything that was told."""
        self._go_on(time_ns)
        self._take_in()
        return self._filter.state
