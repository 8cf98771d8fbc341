"""Parameters of a formation of micro aerial vehicles with cameras, after Nägeli 2014.

Inertial axes: x north, y west, z up; body axes: x ahead, where the camera looks, z along the thrust.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations

from ...errors import BadInput
from .air import Gusts, Scripted, Turbulence
from .camera import Camera
from .imu import Imu
from .vehicles import Vehicle

CAMERA, IMU = "camera", "imu"


@dataclass(frozen=True)
class FormationDescription:
    """N vehicles, each with a camera and an inertial measurement unit.

    Attributes:
        agents: names of the vehicles in natural order.
        places: initial positions, (x, y, z) [m].
        headings: initial headings [rad], anticlockwise from north.
        seed: of the run.
        vehicle, camera, imu, turbulence, gusts: their parts; None for a missing sensor.
        ground: whether contacts with the ground are reported.
        steps: rate of the integration [Hz].
        sense_delay_ns, act_delay_ns: from a sample to its arrival, from a command to its effect.
        truth_rate: rate at which the truth is recorded [Hz].

    Raises:
        BadInput: fewer than two vehicles, two of them closer than two radii, rates or delays out of their bounds.
    """

    agents: tuple[str, ...]
    places: tuple[tuple[float, float, float], ...]
    headings: tuple[float, ...]
    seed: int
    vehicle: Vehicle = field(default_factory=Vehicle)
    camera: Camera | None = field(default_factory=Camera)
    imu: Imu | None = field(default_factory=Imu)
    turbulence: Turbulence = field(default_factory=Turbulence)
    gusts: Gusts = field(default_factory=Scripted)
    ground: bool = False
    steps: float = 60.0
    sense_delay_ns: int = 5_000_000
    act_delay_ns: int = 5_000_000
    truth_rate: float = 30.0

    def __post_init__(self) -> None:
        """Check what belongs together."""
        if len(self.agents) < 2:
            raise BadInput(f"a formation has at least 2 vehicles, not {len(self.agents)}")
        if not len(self.agents) == len(self.places) == len(self.headings):
            raise BadInput(
                f"{len(self.places)} places and {len(self.headings)} headings for {len(self.agents)} vehicles"
            )
        for name, rate in (("steps", self.steps), ("truth_rate", self.truth_rate)):
            if not 0.0 < rate < math.inf:
                raise BadInput(f"{name} is {rate:g} Hz, it must be above 0")
        self._check_distances()
        shortest = 1.0 / self.vehicle.attitude_response
        if self.steps < shortest:
            raise BadInput(f"steps is {self.steps:g} Hz, it must be at least 1/attitude_response, {shortest:g} Hz")
        if self.vehicle.drag > self.steps:
            raise BadInput(f"drag is {self.vehicle.drag:g} 1/s, it must be at most steps, {self.steps:g} Hz")
        for name, delay in (("sense_delay", self.sense_delay_ns), ("act_delay", self.act_delay_ns)):
            if delay < 1:
                raise BadInput(f"{name} is {delay} ns, it must be at least 1 ns")

    def _check_distances(self) -> None:
        for (first, here), (second, there) in combinations(zip(self.agents, self.places, strict=True), 2):
            if not math.dist(here, there) >= 2.0 * self.vehicle.radius:
                raise BadInput(
                    f"vehicles {first} and {second} begin {math.dist(here, there):g} m apart, and with a radius of "
                    f"{self.vehicle.radius:g} m each they collide: put them further apart"
                )

    def sensors(self, agent: str) -> Mapping[str, float]:
        """The sensors of a vehicle and their rates [Hz], the inertial one first: one may turn what is seen by it.

        Raises:
            BadInput: an agent that is no vehicle.
        """
        if agent not in self.agents:
            raise BadInput(f"agent {agent!r} is no vehicle of the formation: it has {', '.join(self.agents)}")
        kinds = ((IMU, self.imu), (CAMERA, self.camera))
        return {name: sensor.rate for name, sensor in kinds if sensor is not None}
