"""Vehicles in formation: their relative places and velocities, and one filter that has every camera and every force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from ...agents.agent import Sample
from ...agents.mav.mav_samples import CAMERA, IMU, frame_model, read_camera, read_imu, sightings
from ...agents.mav.mav_settings import MavParameters
from ...agents.mav.vehicle import ATTITUDE, COVARIANCE, FORCE, FORMATION
from ...agents.plan import Plan
from ...estimators.formation.filter import Observation, steps_to
from ...estimators.frames.frame_consensus import FrameConsensus
from ...quantities import Component, Floats, Quantity
from ...rotations import rotate
from . import mav_findings
from .attitude_evaluation import QUATERNION
from .evaluation import Evaluation, Finding, RunData, Series, View

_AT_ONCE = 20
"""Sightings in one update: with many more, their covariance costs more than that of the formation."""


class MavEvaluation(Evaluation):
    """The truth is what the world wrote down; the central estimator has all samples, and all commands as they act."""

    def __init__(self, plan: Plan, world_reports: Mapping[str, Series]) -> None:
        super().__init__(plan, world_reports)
        self._names = tuple(agent.name for agent in plan.agents)
        self.quantities = (
            Quantity(FORMATION, tuple(_relative(self._names)), covariance=COVARIANCE),
            Quantity(FORCE, tuple(Component(f"force {axis}", "N") for axis in "xyz"), "diagnostic", is_shared=False),
            Quantity(ATTITUDE, QUATERNION, role="diagnostic", is_shared=False),
        )
        self._central = CentralisedFormation(plan)

    def sampled(self, agent: str, sample: Sample) -> None:
        """To the central estimator."""
        self._central.sampled(agent, sample)

    def commanded(self, agent: str, command: str, value: Floats, time_ns: int) -> None:
        """To the central estimator."""
        self._central.commanded(agent, command, value, time_ns)

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats | None:
        """The state of the formation."""
        return self._central.state(time_ns) if quantity == FORMATION else None

    def view(self, agent: str, reports: Mapping[str, Floats]) -> View | None:
        """Where all are, about a centre that the estimate does not know."""
        if FORMATION not in reports:
            return None
        return formation_view(self._names, reports[FORMATION], reports.get(COVARIANCE))

    def findings(self, run: RunData) -> Sequence[Finding]:
        """Formation, spread, drift, sight, frames, consistency, and what is no longer observable."""
        return mav_findings.findings(self.plan, run)


def _relative(names: Sequence[str]) -> list[Component]:
    """Place and velocity of each vehicle as seen from the next one."""
    parts = ((pair, *kind) for pair in pairwise(names) for kind in (("", "m"), ("velocity ", "m/s")))
    return [
        Component(f"{kind}{axis} of {one} from {other}", unit) for (one, other), kind, unit in parts for axis in "xyz"
    ]


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

    def commanded(self, agent: str, command: str, value: Floats, time_ns: int) -> None:
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

    def state(self, time_ns: int) -> Floats:
        """Of the formation at an instant, not before any sample or command so far."""
        self._go_on(time_ns)
        self._take_in()
        return self._filter.state


def formation_view(names: Sequence[str], state: Floats, covariance: Floats | None) -> View:
    """All places about their centre, which the estimate does not know, and their covariances about it.

    p_i = c_i − Σ_m c_m / N with c_1 = 0, c_{i+1} = c_i − r_i            Nägeli 2014, (4): r_i = p_i − p_{i+1}

    Args:
        names: of the N vehicles, in natural order.
        state: r_1, ṙ_1, r_2, …, (6(N − 1),) [m, m/s].
        covariance: of the state, of (6(N − 1))² numbers, if it is known.
    """
    count = len(names)
    chain = -np.tri(count, count - 1, -1)
    centred = chain - chain.mean(axis=0)
    places = centred @ state.reshape(count - 1, 6)[:, :2]
    covariances = {}
    if covariance is not None:
        flat = covariance.reshape(count - 1, 6, count - 1, 6)[:, :2, :, :2]
        covariances = {
            name: np.einsum("m,manb,n->ab", row, flat, row) for name, row in zip(names, centred, strict=True)
        }
    return View(dict(zip(names, places, strict=True)), covariances, relative=True)
