"""Measurement units of a body: its attitude, the estimate from all sensors, and the fates of messages."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...agents.agent import Sample
from ...agents.attitude.attitude_network import ALONE, ATTITUDE, FATES, MESSAGES, OWN, network, units
from ...agents.attitude.attitude_unit_settings import AttitudeParameters
from ...agents.plan import Plan
from ...estimators.attitude.directions import least_squares_attitude
from ...estimators.error_measures import attitude_difference, integrated_square_error
from ...quantities import Component, Floats, Quantity
from ...rotations import euler_to_quaternion, rotate, same_sign
from ...units import period_ns
from ...worlds.rigid_body.measurement_units import DIRECTIONS, RigidBodyWorld
from .evaluation import Evaluation, Finding, RunData, Series

QUATERNION = tuple(Component(f"$q_{number}$") for number in range(4))
_TURN = tuple(Component(f"turn about {axis}", "deg", 180 / math.pi) for axis in "xyz")


class AttitudeEvaluation(Evaluation):
    """Attitudes belong to samples. The difference of two is the turn about the inertial axes [rad]."""

    quantities = (
        *(
            Quantity(name, QUATERNION, difference=attitude_difference, difference_components=_TURN)
            for name in (ATTITUDE, ALONE, OWN)
        ),
        Quantity(MESSAGES, tuple(Component(f"messages {fate}") for fate in FATES), role="diagnostic"),
    )

    def __init__(self, plan: Plan, world_reports: Mapping[str, Series]) -> None:
        super().__init__(plan, world_reports)
        parameters: AttitudeParameters = units(plan)[0].parameters
        self._rate = parameters.rate
        self._mountings = {
            unit.name: euler_to_quaternion(*(unit.parameters.mounting(unit.name) or (0.0, 0.0, 0.0)))
            for unit in network(plan)
        }
        self._seen_ns = -1
        self._seen: dict[tuple[str, str], Floats] = {}
        self._central: Floats | None = None

    def instant(self, agent: str, quantity: str, index: int, time_ns: int) -> int:
        """That of the sample."""
        return period_ns(self._rate, index)

    def truth(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats | None:
        """The attitude of the body when the sample was taken."""
        return None if quantity == MESSAGES else self._attitude(time_ns)

    def _attitude(self, time_ns: int) -> Floats:
        assert isinstance(self.plan.world, RigidBodyWorld)
        return self.plan.world.truth(time_ns)[:4]

    def sampled(self, agent: str, sample: Sample) -> None:
        """Keep the directions that the network sees at one instant, in the axes of the sensors."""
        if sample.time_ns > self._seen_ns:
            self._seen_ns, self._seen, self._central = sample.time_ns, {}, None
        norm = 0.0 if sample.value is None else float(np.linalg.norm(sample.value))
        if agent in self._mountings and sample.value is not None and 0.0 < norm < math.inf:
            self._seen[agent, sample.sensor] = sample.value / norm

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats | None:
        """The attitude that fits best the directions that all sensors of the network see in one sample.

        Each is turned into the body's frame by the mounting of its unit. Of q and −q, which are one attitude, that
        nearer to the true one. None where the directions leave a turn open.
        """
        if quantity != ATTITUDE or self._seen_ns != time_ns:
            return None
        if self._central is None:
            found = self._least_squares()
            self._central = None if found is None else same_sign(found, self._attitude(time_ns))
        return self._central

    def _least_squares(self) -> Floats | None:
        observed, references = [], []
        for name, mounting in self._mountings.items():
            for sensor, direction in DIRECTIONS.items():
                if (seen := self._seen.get((name, sensor))) is not None:
                    observed.append(rotate(mounting, seen))
                    references.append(direction)
        return least_squares_attitude(np.array(observed).reshape(-1, 3), np.array(references).reshape(-1, 3))

    def findings(self, run: RunData) -> Sequence[Finding]:
        """Each unit's rms error, the integral of the square of half of it, Betanzos 2024, (31); messages."""
        found = []
        for quantity in (ATTITUDE, ALONE):
            for name, series in run.estimates(quantity).items() if quantity in run.quantities() else ():
                angle = np.linalg.norm(attitude_difference(series.value, run.truth(quantity)[name]), axis=1)
                where = "alone" if quantity == ALONE else "in the network"
                rms = math.degrees(math.sqrt(float(np.mean(angle**2))))
                ise = integrated_square_error(series.time_ns, 0.5 * angle)
                text = f"root mean square; the ISE of half of it is {ise:.4g} rad² s"
                found.append(Finding(f"attitude error of unit {name}, {where}", rms, "deg", text))
        return [*found, *_messages(run)]


def _messages(run: RunData) -> Iterator[Finding]:
    """The fates of messages up to each unit's last count; the counts of a restarted unit begin at 0."""
    if MESSAGES not in run.quantities():
        return
    total = np.zeros(len(FATES))
    for series in run.estimates(MESSAGES).values():
        more = np.diff(series.value, axis=0, prepend=0.0)
        total += np.where((more < 0.0).any(axis=1, keepdims=True), series.value, more).sum(axis=0)
    for fate, count in zip(FATES, total.tolist(), strict=True):
        yield Finding(f"messages {fate}", count)
