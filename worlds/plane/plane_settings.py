"""Settings of a plane under a rigid body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from ...errors import BadInput
from ...kinds import Kinds
from ...topologies import Position
from ...units import Hertz, Metres, RadiansPerSecond, Volts
from ..signals import Angles, Constant, Lengths
from .distance_sensors import GaussianDistance, Infrared
from .plane_world import PlaneWorld

_LEVEL = Constant(0.0)


@dataclass(frozen=True)
class Gyroscope:
    """Rate gyros of every module.

    noise: standard deviation on each axis.
    """

    noise: RadiansPerSecond


@dataclass(frozen=True)
class InfraredSettings:
    """An infrared distance sensor, calibrated.

    noise: standard deviation of the voltage.
    """

    noise: Volts

    def __post_init__(self) -> None:
        """Check the noise."""
        self.sensor()

    def sensor(self) -> Infrared:
        """The sensor."""
        return Infrared(self.noise)


SENSORS = Kinds("distance sensor", {"infrared": InfraredSettings})


@dataclass(frozen=True)
class PlaneSettings:
    """A rigid body over a plane.

    altitude: of the body over the plane, above 0.
    roll: of the body, within 90 deg.
    pitch: of the body, within 90 deg.
    rate: of all sensors.
    distance_noise: standard deviation of a Gaussian distance sensor, 5 mm unless another sensor is given.
    sensor: another distance sensor.
    gyroscope: rate gyros of every module.
    """

    needs_places: ClassVar[bool] = True

    altitude: Lengths
    roll: Angles = _LEVEL
    pitch: Angles = _LEVEL
    rate: Hertz = 20.0
    distance_noise: Metres | None = None
    sensor: Annotated[InfraredSettings, SENSORS] | None = None
    gyroscope: Gyroscope | None = None

    def __post_init__(self) -> None:
        """Check that there is one distance sensor, and its noise."""
        if self.distance_noise is not None and self.sensor is not None:
            raise BadInput("give either distance_noise or sensor, not both")
        try:
            GaussianDistance(self.distance_noise or 0.0)
        except BadInput as error:
            raise BadInput(str(error), ("distance_noise",)) from None

    def build(self, positions: Mapping[str, Position], seed: int, agents: Sequence[str]) -> PlaneWorld:
        """The world, with the modules at these places."""
        gaussian = GaussianDistance(0.005 if self.distance_noise is None else self.distance_noise)
        sensor = gaussian if self.sensor is None else self.sensor.sensor()
        gyroscope = None if self.gyroscope is None else self.gyroscope.noise
        places = {agent: (x, y) for agent, (x, y, *_) in positions.items()}
        return PlaneWorld(self.altitude, self.roll, self.pitch, places, sensor, seed, self.rate, gyroscope)
