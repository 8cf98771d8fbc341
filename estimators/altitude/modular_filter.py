"""A modular extended Kalman filter, after Bavle 2017: any number of sensors of any kind.

The state vector holds the states of the robot, of the ground, and of each sensor in the order given. The filter
predicts to the instant of each measurement, and to any other on demand. Letters: P covariance, H Jacobian of a
measurement, S covariance of the innovation ν, K gain, R noise variances.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import lapack

from ...errors import BadInput
from ...units import Metres, check_fields_above_zero
from .components import ROBOT_STATES, Blocks, Component, Floats, Ground, Robot, Sensor, State

Variant = Literal["as_printed", "gate", "gate_and_floor"]
GROUND = ROBOT_STATES
"""Index of the ground's height in the state vector."""
_NANOSECOND = 1e-9
_LOST = 1.0


@dataclass(frozen=True)
class GroundJumps:
    """How the filter handles jumps of the ground, which a random walk cannot follow; this is not in the paper.

    variant: `as_printed` accepts every innovation. `gate` takes an innovation of more than `gate` standard deviations,
        of a sensor that sees the ground, for a jump of the ground: the variance of the ground grows by `jump`² before
        the update, so that the jump changes the ground and not the altitude. `gate_and_floor` also recognises the
        floor: if the estimate of the ground is within `level` of 0 and within `gate` standard deviations, the filter
        adds a measurement of 0 with the standard deviation `floor_noise`.
    """

    variant: Variant = "gate_and_floor"
    gate: float = 4.0
    jump: Metres = 1.0
    level: Metres = 0.15
    floor_noise: Metres = 0.02

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(self, "gate", "jump", "level", "floor_noise")


class Belief(NamedTuple):
    """Mean (n,) and covariance (n, n) of the state at an instant, and the number of jumps of the ground so far."""

    time_ns: int
    mean: Floats
    covariance: Floats
    jumps: int = 0

    @property
    def altitude(self) -> float:
        """Altitude of the vehicle above the floor [m]."""
        return float(self.mean[0])

    @property
    def ground(self) -> float:
        """Height of the surface below the vehicle [m]."""
        return float(self.mean[GROUND])

    def deviation(self, state: int) -> float:
        """Standard deviation of one state, in its unit."""
        return math.sqrt(self.covariance[state, state])


class ModularFilter:
    """The filter: a robot, a ground and named sensors.

    Args:
        robot, ground: the two components that every such filter has.
        sensors: pairs (name, component); measurements are given by this name.
        jumps: how jumps of the ground are handled.
    Raises:
        BadInput: no sensor at all, or two components of one name.
    """

    def __init__(self, robot: Robot, ground: Ground, sensors: Sequence[tuple[str, Sensor]], jumps: GroundJumps) -> None:
        check_names([name for name, _ in sensors])
        parts: list[tuple[str, Component]] = [("", robot), ("", ground), *sensors]
        self._parts: list[tuple[Component, slice]] = []
        states: list[State] = []
        for name, part in parts:
            own = part.states()
            self._parts.append((part, slice(len(states), len(states) + len(own))))
            states += [state._replace(name=f"{state.name} of {name}" if name else state.name) for state in own]
        self._sensors = {
            name: (sensor, place, sensor.variances())
            for (name, sensor), (_, place) in zip(sensors, self._parts[2:], strict=True)
        }
        self._states = tuple(states)
        self._jumps = jumps
        self._walks = np.square([state.walk for state in states])
        self._identity = np.eye(len(states))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the states, in order; those of a sensor as "barometer bias of NAME"."""
        return tuple(state.name for state in self._states)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors."""
        return tuple(self._sensors)

    def size(self, name: str) -> int:
        """Number of values in a measurement of a sensor.

        Raises:
            BadInput: there is no such sensor.
        """
        return len(self._of(name)[2])

    def start(self, time_ns: int = 0, *, lost: bool = False) -> Belief:
        """The belief before any measurement; with `lost`, the deviation of altitude and ground is 1 m."""
        mean = np.array([state.start for state in self._states])
        deviations = np.array([state.deviation for state in self._states])
        if lost:
            deviations[[0, GROUND]] = _LOST
        return Belief(time_ns, mean, np.diag(deviations**2))

    def predict(self, belief: Belief, time_ns: int) -> Belief:
        """Predict the belief to a later instant, or to the same.

        x⁻ = f(x, dt), P⁻ = F P Fᵀ + T         Bavle 2017, (1); T is diagonal, walk²·dt for each state

        Raises:
            BadInput: the instant is before that of the belief.
        """
        if time_ns <= belief.time_ns:
            if time_ns < belief.time_ns:
                raise BadInput(f"prediction to {time_ns} ns from {belief.time_ns} ns: time does not run back")
            return belief
        dt = (time_ns - belief.time_ns) * _NANOSECOND
        mean, jacobian = self.transition(belief.mean, dt)
        covariance: Floats = jacobian @ belief.covariance @ jacobian.T
        _diagonal(covariance)[:] += self._walks * dt
        return Belief(time_ns, mean, _symmetric(covariance), belief.jumps)

    def transition(self, mean: Floats, dt: float) -> tuple[Floats, Floats]:
        """State after dt [s] without noise (n,), and the Jacobian F (n, n)."""
        after, jacobian = mean.copy(), self._identity.copy()
        for part, place in self._parts:
            part.move(after[place], jacobian[place, place], dt)
        return after, jacobian

    def expected(self, name: str, mean: Floats) -> tuple[Floats, Floats]:
        """Expected measurement of a sensor (m,), and its Jacobian H (m, n).

        Raises:
            BadInput: there is no such sensor.
        """
        sensor, place, variances = self._of(name)
        jacobian = np.zeros((len(variances), len(mean)))
        blocks = Blocks(jacobian[:, :ROBOT_STATES], jacobian[:, GROUND], jacobian[:, place])
        return sensor.expected(mean[:ROBOT_STATES], mean[GROUND], mean[place], blocks), jacobian

    def update(self, belief: Belief, name: str, values: Floats) -> Belief:
        """Update the belief with a measurement taken at its instant.

        ν = z − h(x), S = H P Hᵀ + R, K = P Hᵀ S⁻¹, x⁺ = x + K ν, P⁺ = P − K H P         Bavle 2017, (3)–(7)

        Args:
            belief: the belief before the measurement.
            name: name of the sensor.
            values: shape (m,), in the sensor's units.
        Raises:
            BadInput: no such sensor, wrong number of values, or a value that is not finite.
        """
        sensor, _, variances = self._of(name)
        if values.shape != variances.shape:
            raise BadInput(f"measurement of {name} has shape {values.shape}: give {variances.shape}")
        predicted, jacobian = self.expected(name, belief.mean)
        innovation: Floats = values - predicted
        if not math.isfinite(innovation.sum()):
            raise BadInput(f"measurement of {name} holds a value that is not finite: {values.tolist()}")
        if not sensor.sees_ground or self._jumps.variant == "as_printed":
            return _corrected(belief, jacobian, innovation, variances)
        belief = _corrected(self._gated(belief, jacobian, innovation, variances), jacobian, innovation, variances)
        return self._floored(belief) if self._jumps.variant == "gate_and_floor" else belief

    def take(self, belief: Belief, time_ns: int, name: str, values: Floats) -> Belief:
        """Predict to the instant of a measurement, then update."""
        return self.update(self.predict(belief, time_ns), name, values)

    def _gated(self, belief: Belief, jacobian: Floats, innovation: Floats, variances: Floats) -> Belief:
        """Increase the variance of the ground by jump² if the innovation exceeds the gate: νᵀ S⁻¹ ν > gate²."""
        spread = jacobian @ belief.covariance @ jacobian.T
        _diagonal(spread)[:] += variances
        if innovation @ _solved(spread, innovation) <= self._jumps.gate**2:
            return belief
        covariance = belief.covariance.copy()
        covariance[GROUND, GROUND] += self._jumps.jump**2
        return belief._replace(covariance=covariance, jumps=belief.jumps + 1)

    def _floored(self, belief: Belief) -> Belief:
        """Update with the measurement z_G = 0, if it is plausible that the ground is the floor."""
        jumps, height = self._jumps, float(belief.mean[GROUND])
        variance = float(belief.covariance[GROUND, GROUND]) + jumps.floor_noise**2
        if abs(height) > jumps.level or height**2 > jumps.gate**2 * variance:
            return belief
        return _corrected_by_one(belief, belief.covariance[GROUND], -height, variance)

    def _of(self, name: str) -> tuple[Sensor, slice, Floats]:
        if name not in self._sensors:
            raise BadInput(f"the filter has no component {name!r}: it has {', '.join(self._sensors)}")
        return self._sensors[name]


def _corrected(belief: Belief, jacobian: Floats, innovation: Floats, variances: Floats) -> Belief:
    if len(variances) == 1:
        row = jacobian[0]
        crossed = belief.covariance @ row
        return _corrected_by_one(belief, crossed, float(innovation[0]), float(row @ crossed) + float(variances[0]))
    crossed = belief.covariance @ jacobian.T
    spread = jacobian @ crossed
    _diagonal(spread)[:] += variances
    gain = _solved(spread, crossed.T).T
    mean: Floats = belief.mean + gain @ innovation
    covariance: Floats = belief.covariance - gain @ crossed.T
    return Belief(belief.time_ns, mean, _symmetric(covariance), belief.jumps)


def _corrected_by_one(belief: Belief, crossed: Floats, innovation: float, variance: float) -> Belief:
    """The same for one value: P Hᵀ is a vector, S a number, and K H P is exactly symmetric."""
    spread = math.sqrt(variance)
    part = crossed / spread
    mean: Floats = belief.mean + part * (innovation / spread)
    covariance: Floats = belief.covariance - part[:, np.newaxis] * part
    return Belief(belief.time_ns, mean, covariance, belief.jumps)


def _solved(matrix: Floats, right: Floats) -> Floats:
    """Solve a linear system with a symmetric, positive definite matrix, which is overwritten."""
    _, solution, failed = lapack.dposv(matrix, right, overwrite_a=1)
    assert not failed, "a covariance of innovations is positive definite"
    result: Floats = solution
    return result


def _diagonal(matrix: Floats) -> Floats:
    """A view of the diagonal of a C-contiguous matrix."""
    return matrix.ravel()[:: len(matrix) + 1]


def _symmetric(matrix: Floats) -> Floats:
    halves: Floats = (matrix + matrix.T) * 0.5
    return halves


def check_names(names: Sequence[str]) -> None:
    """Check the names of a filter's sensors.

    Raises:
        BadInput: no sensor at all, or two with the same name.
    """
    if not names:
        raise BadInput("a filter without any sensor estimates nothing: add an imu, a barometer or a range finder")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise BadInput(f"component {', '.join(twice)} is named twice: each sensor has one component")


def unobservable(of: ModularFilter, mean: Floats, tolerance: float = 1e-6) -> Floats:
    """The unobservable directions of the state, linearised at a state.

    The null space of H, HF, HF², … with H of all sensors and F over one second.

    Args:
        of: the filter.
        mean: the state (n,) at which H and F are taken; with a ground above 0 the clamp (19) has no effect.
        tolerance: singular values below this fraction of the largest count as zero.
    Returns:
        An orthonormal basis, (n, number of directions); the largest entry of each is positive.
    """
    _, F = of.transition(mean, 1.0)
    H = np.vstack([of.expected(name, mean)[1] for name in of.sensors])
    rows = [H]
    for _ in range(len(mean) - 1):
        rows.append(rows[-1] @ F)
    stacked = np.vstack(rows)
    _, sizes, directions = np.linalg.svd(stacked / np.linalg.norm(stacked, axis=1, keepdims=True))
    null = directions[int((sizes > tolerance * sizes[0]).sum()) :]
    return np.array([row * np.sign(row[np.argmax(np.abs(row))]) for row in null]).T.reshape(len(mean), -1)
