"""A rigid body with distance sensors over a plane: the world of the flying array.

Letters: state x = (z, γ, β) altitude [m], roll and pitch [rad]; (r_X, r_Y) position of a module on the body [m].
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import BadInput
from ..topologies import Position
from ..units import period_ns
from .sensors import DistanceSensor
from .signals import Signal

SENSOR = "distance"


def distances(state: ArrayLike, positions: ArrayLike) -> NDArray[np.float64]:
    """Distances to the ground along the body's downward axis.

    m = (z + r_Y cos β sin γ − r_X sin β) / (cos β cos γ)            Kriegleder 2012, (6)

    Args:
        state: (z, γ, β), shape (3,) [m, rad, rad].
        positions: one row (r_X, r_Y) a module, shape (N, 2) [m].
    Returns:
        Shape (N,) [m]; negative where the module is in the ground.
    Raises:
        BadInput: a tilt of 90° or more, from which the downward axis does not meet the ground.
    """
    altitude, roll, pitch = np.asarray(state, dtype=np.float64).tolist()
    if not (abs(roll) < math.pi / 2 and abs(pitch) < math.pi / 2):
        raise BadInput(f"roll {math.degrees(roll)} deg and pitch {math.degrees(pitch)} deg must be within 90 deg")
    x, y = np.asarray(positions, dtype=np.float64).T
    height = altitude + y * (math.cos(pitch) * math.sin(roll)) - x * math.sin(pitch)
    result: NDArray[np.float64] = height / (math.cos(pitch) * math.cos(roll))
    return result


@dataclass(frozen=True)
class PlaneWorld:
    """A rigid body over a plane; altitude [m], roll and pitch [rad] are given functions of time.

    `positions` maps agent → (r_X, r_Y) [m]. Every agent has one distance sensor, sampled at `rate` [Hz]. All is a pure
    function of seed and time, and can be pickled.

    Raises:
        BadInput: altitude not above 0, a tilt of 90° or more, a rate not above 0, no positions, or one not a pair.
    """

    altitude: Signal
    roll: Signal
    pitch: Signal
    positions: Mapping[str, Position]
    sensor: DistanceSensor
    seed: int
    rate: float = 20.0

    def __post_init__(self) -> None:
        """Check what would make no sense at some instant of the run."""
        lowest, _ = self.altitude.bounds()
        if not lowest > 0.0:
            raise BadInput(f"altitude goes down to {lowest} m: keep it above 0")
        for name, signal in (("roll", self.roll), ("pitch", self.pitch)):
            largest = max(map(abs, signal.bounds()))
            if not largest < math.pi / 2:
                raise BadInput(f"{name} reaches {math.degrees(largest):g} deg: keep it within 90 deg")
        if not self.rate > 0.0:
            raise BadInput(f"rate {self.rate} Hz must be above 0")
        if not self.positions:
            raise BadInput("the topology gives no positions of modules: use one that does, such as hexagonal or cells")
        for agent, position in self.positions.items():
            if len(position) != 2:
                raise BadInput(f"position {position} of agent {agent} must be two numbers, x and y on the body")

    def sensors(self, agent: str) -> Mapping[str, float]:
        """The one sensor of an agent and its rate [Hz].

        Raises:
            BadInput: an agent that has no position.
        """
        self._position(agent)
        return {SENSOR: self.rate}

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """The index-th sample of a sensor, taken at floor(index · 10⁹ / rate).

        Args:
            agent: whose sensor.
            sensor: its name, "distance".
            index: of the sample, ≥ 0.
        Returns:
            Distance, shape (1,) [m]; None where the sensor sees nothing or the module touches the ground.
        Raises:
            BadInput: an agent or a sensor that is not there.
        """
        position = self._position(agent)
        if sensor != SENSOR:
            raise BadInput(f"agent {agent} has no sensor {sensor!r}: it has {SENSOR!r}")
        true = float(distances(self.truth(period_ns(self.rate, index)), [position])[0])
        reading = self.sensor.reading(true, self.seed, agent, index) if true > 0.0 else None
        return None if reading is None else np.array([reading])

    def truth(self, time_ns: int) -> NDArray[np.float64]:
        """The true state (z, γ, β) at an instant, shape (3,) [m, rad, rad]."""
        return np.array([signal.value(time_ns) for signal in (self.altitude, self.roll, self.pitch)])

    def _position(self, agent: str) -> Position:
        if agent not in self.positions:
            raise BadInput(f"agent {agent!r} has no position in the world: it knows {', '.join(self.positions)}")
        return self.positions[agent]
