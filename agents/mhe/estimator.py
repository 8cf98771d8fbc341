"""The agent that estimates attitude and altitude by moving horizon from measurements of its neighbours, sensor nodes.

A measurement enters the window at the point nearest to its stamp, however late it arrives, as long as the point is in
the window; a lost one leaves a gap.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...rotations import quaternion_to_euler
from ...units import first_period, period_ns
from .. import measurements
from ..agent import Agent, Context, Received, Timer
from ..payloads import DamagedPayload
from ..plan import Plan
from ..sensor_node import SensorNodeParameters, own_sensors
from .mhe_settings import Configuration, MheParameters
from .track import IN_TIME, LATE, TOO_LATE, Pair, Track, widths

Floats = NDArray[np.float64]

ATTITUDE, ALTITUDE, DISTURBANCE, COUNTS = "attitude", "altitude", "disturbance", "measurements"
EKF = " ekf"
_OUTCOMES = (IN_TIME, LATE, TOO_LATE, "ahead", "refused")
"""Outcomes of a measurement; one that is ahead of the own clock by less than a horizon is used too."""
COUNT_NAMES = (*(f"measurements {outcome}" for outcome in _OUTCOMES), "windows with an active bound")


class Mhe(Agent):
    """The hub of a star of sensor nodes; it never sends."""

    Parameters = MheParameters
    evaluation = "volery.experiments.evaluation.mhe_evaluation:MheEvaluation"
    timers_only = True

    parameters: MheParameters

    def __init__(self, context: Context, parameters: MheParameters) -> None:
        super().__init__(context, parameters)
        self._first = first_period(parameters.rate, context.now_ns)
        self._tracks = tracks(parameters, self._first)
        self._counts: Counter[str] = Counter()
        self._bounded = 0

    def start(self) -> None:
        """Set the timer of the first estimate, of the next point."""
        self._wait(self._first)

    def _wait(self, point: int) -> None:
        self.context.set_timer(period_ns(self.parameters.rate, point) + self.parameters.wait, index=point)

    def on_frame(self, frame: Received) -> None:
        """Add the measurement at the point nearest to its stamp."""
        try:
            measurement = measurements.decode(frame.payload)
        except DamagedPayload:
            self._counts["refused"] += 1
            return
        sensors = self.parameters.sensors.get(frame.source, ())
        now_ns, rate = self.context.now_ns, self.parameters.rate
        point = round(measurement.stamp_ns * rate / 1e9)
        far = point > now_ns * rate / 1e9 + self.parameters.horizon
        if far or not _fits(sensors, measurement.sensor, measurement.values):
            self._counts["refused"] += 1
            return
        self._counts["ahead"] += measurement.stamp_ns > now_ns
        outcomes = [
            track.put(sensors[measurement.sensor], point, measurement.values) for track in self._tracks.values()
        ]
        self._counts[next(outcome for outcome in (*outcomes, "refused") if outcome is not None)] += 1

    def on_timer(self, timer: Timer) -> None:
        """Estimate and report a point."""
        for configuration, track in self._tracks.items():
            pair = track.estimate(timer.index)
            self._bounded += pair.window.bounded
            for quantity, value in reported(configuration, pair):
                self.context.report(quantity, value, timer.index)
        counts = [self._counts[outcome] for outcome in _OUTCOMES]
        self.context.report(COUNTS, [*counts, self._bounded], timer.index)
        self._wait(timer.index + 1)

    def save(self) -> Any:
        """Windows, filters and counts."""
        return [[track.save() for track in self._tracks.values()], dict(self._counts), self._bounded]

    def restore(self, state: Any) -> None:
        """Restore them; the time in between is a gap."""
        tracks, counts, self._bounded = state
        self._counts = Counter(counts)
        for track, saved in zip(self._tracks.values(), tracks, strict=True):
            track.restore(saved)

    @classmethod
    def sends_per_second(cls, parameters: MheParameters) -> float:
        """It never sends."""
        return 0.0

    @classmethod
    def libraries(cls, parameters: MheParameters) -> Sequence[str]:
        """The solver of its quadratic programs."""
        return (parameters.solver,)

    @classmethod
    def problems(cls, plan: Plan) -> Sequence[str]:
        """Problems: several hubs, sensors that do not match those of the nodes, samples between the points."""
        hubs = [agent.name for agent in plan.agents if isinstance(agent.parameters, MheParameters)]
        if len(hubs) > 1:
            return [f"agents {', '.join(hubs)} are mhe: a scenario has one, with sensor nodes around it"]
        return [*own_sensors(plan, hubs[0]), *_unlisted(plan, hubs[0]), *_misfits(plan, hubs[0])]


def reported(configuration: Configuration, pair: Pair) -> Iterator[tuple[str, Floats]]:
    """Quantities of one point: attitude (3,) [rad], altitude (1,) [m] in A, oldest disturbance in the window."""
    for suffix, state in (("", pair.window.state), (EKF, pair.filtered)):
        yield f"{ATTITUDE} {configuration}{suffix}", quaternion_to_euler(state[:4])
        if configuration == "A":
            yield f"{ALTITUDE} {configuration}{suffix}", -state[7:8]
    if len(pair.window.disturbances):
        yield f"{DISTURBANCE} {configuration}", pair.window.disturbances[0]


def tracks(parameters: MheParameters, first: int) -> dict[Configuration, Track]:
    """Configuration → its estimators, starting at a point."""
    return {configuration: Track(parameters, configuration, first) for configuration in parameters.configurations}


def _fits(sensors: Sequence[str], number: int, values: Floats) -> bool:
    known = 0 <= number < len(sensors) and widths(sensors)[number] == values.size
    return known and bool(np.isfinite(values).all())


def _parameters(plan: Plan) -> MheParameters:
    return next(agent.parameters for agent in plan.agents if isinstance(agent.parameters, MheParameters))


def _sent(plan: Plan, node: str) -> tuple[str, ...]:
    """Sensors that a node sends, in the order of their numbers on the wire; none if it is no sensor node."""
    parameters = plan.agent(node).parameters
    if not isinstance(parameters, SensorNodeParameters) or plan.world is None:
        return ()
    return parameters.sensors or tuple(plan.world.sensors(node))


def _unlisted(plan: Plan, hub: str) -> Iterator[str]:
    listed = _parameters(plan).sensors
    for node in plan.agent(hub).neighbours:
        if node not in listed and (sent := _sent(plan, node)):
            has = ", ".join(sent)
            yield f"what {node} measures would be refused: add {node}: [{has}] to sensors of {hub}, or remove the node"


def _misfits(plan: Plan, hub: str) -> Iterator[str]:
    parameters = _parameters(plan)
    for node, listed in parameters.sensors.items():
        if node not in plan.agent(hub).neighbours:
            near = ", ".join(plan.agent(hub).neighbours)
            yield f"sensors of {hub} name {node}, which is no neighbour of it; its neighbours are {near}"
            continue
        times, sent = {} if plan.world is None else plan.world.sensors(node), _sent(plan, node)
        if tuple(listed) != sent:
            yield (
                f"sensors of {hub} say that {node} has [{', '.join(listed)}], but it sends [{', '.join(sent)}]: "
                "write the same in the same order"
            )
        for sensor, rate in times.items():
            if sensor in listed and not (isinstance(rate, float) and (parameters.rate / rate).is_integer()):
                has = f"{rate:g} samples a second" if isinstance(rate, float) else "samples at instants"
                yield (
                    f"{node}.{sensor} has {has}, which do not fall on the {parameters.rate:g} "
                    f"points a second of {hub}: choose a rate that divides it"
                )
