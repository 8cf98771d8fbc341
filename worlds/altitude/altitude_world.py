"""A multirotor over tables, chairs and a platform: the world of the flight altitude estimator of Bavle 2017."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from .altitude_sensors import AltitudeSensor, BarometerSensor
from .room import Room
from .tour import Tour


@dataclass(frozen=True)
class AltitudeWorld:
    """A vehicle that flies over a room; `carried` are pairs of an agent and its one sensor.

    All is a pure function of seed and time, and can be pickled and hashed.

    Raises:
        BadInput: no sensor at all, or the flight goes through an obstacle.
    """

    tour: Tour
    room: Room
    carried: tuple[tuple[str, AltitudeSensor], ...]
    seed: int

    def __post_init__(self) -> None:
        """Check that there are sensors, and that the flight stays clear of the obstacles."""
        if not self.carried:
            raise BadInput("no sensor: give at least one agent one of imu, barometer and range")
        for obstacle in self.room.obstacles:
            if obstacle.top >= self.tour.altitude:
                raise BadInput(
                    f"an obstacle reaches {obstacle.top:g} m, the flight is at {self.tour.altitude:g} m: fly higher"
                )

    def sensors(self, agent: str) -> Mapping[str, float]:
        """The sensor of an agent and its rate [Hz]; none for the agent that estimates."""
        return {sensor.name: sensor.rate for carrier, sensor in self.carried if carrier == agent}

    def measure(self, agent: str, sensor: str, index: int) -> NDArray[np.float64] | None:
        """The index-th sample of a sensor, taken at floor(index · 10⁹ / rate); for its shape see the sensor's class.

        Raises:
            BadInput: an agent that has no such sensor.
        """
        return self._of(agent, sensor).reading(self.tour, self.room, self.seed, agent, index)

    def truth(self, time_ns: int) -> NDArray[np.float64]:
        """Height of the vehicle and of the surface below it, vertical velocity, shape (3,) [m, m, m/s]."""
        pose = self.tour.pose(time_ns)
        x, y, z = pose.position.tolist()
        return np.array([z, self.room.surface(x, y)[0], pose.velocity[2]])

    def bias(self, agent: str, time_ns: int) -> float | None:
        """The true bias of a barometer [m]; None where the agent has none."""
        sensors = (sensor for carrier, sensor in self.carried if carrier == agent)
        sensor = next((sensor for sensor in sensors if isinstance(sensor, BarometerSensor)), None)
        return None if sensor is None else sensor.offset(self.tour, self.seed, agent, time_ns)

    def _of(self, agent: str, name: str) -> AltitudeSensor:
        for carrier, sensor in self.carried:
            if (carrier, sensor.name) == (agent, name):
                return sensor
        has = ", ".join(f"{carrier}.{sensor.name}" for carrier, sensor in self.carried)
        raise BadInput(f"agent {agent} has no sensor {name!r}: there are {has}")
