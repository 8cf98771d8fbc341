"""Parameters of the agent that estimates by moving horizon."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...estimators.horizon.attitude_model import AttitudeModel
from ...estimators.horizon.quadratic_programs import Solver
from ...estimators.horizon.quadrotor_model import Deviations, QuadrotorModel
from ...rotations import euler_to_quaternion
from ...units import (
    Duration,
    Hertz,
    Metres,
    MetresPerSecondSquared,
    Radians,
    RadiansPerSecond,
    check_fields_above_zero,
)
from ..idle import refuse_idle

Configuration = Literal["A", "B"]
Printed = Literal["accelerometer", "range"]
Floats = NDArray[np.float64]

_ATTITUDE_SD, _VELOCITY_SD, _HEIGHT_SD = 0.05, 0.1, 0.1
_GYROSCOPE_BIAS_SD, _ACCELEROMETER_BIAS_SD = 0.02, 0.2
_OF_A = ("largest_accelerometer", "lowest", "altitude", "arm", "flow_at")
_NOISE_OF_A = ("flow", "ranges", "accelerometer_gap")
_LOST = 20.0
"""Factor on the initial standard deviations of an agent that starts in the middle of a run."""


@dataclass(frozen=True)
class MheParameters:
    """Parameters of the estimating agent.

    sensors: node → its sensors, in the order of their numbers on the wire.
    configurations: `A`, with all sensors, `B`, with the inertial measurement unit alone, or both side by side.
    rate: points per second; the sensors' rates divide it.
    horizon: steps in a window.
    wait: delay of an estimate after its point, for samples to arrive.
    solver: of the quadratic program.
    gyroscope_bias, accelerometer_bias: whether these biases are states; in B only the first can be.
    largest_gyroscope, largest_accelerometer: bounds of the disturbances.
    lowest: lower bound of the altitude.
    as_printed: equations of the paper to use exactly as printed, (13) or (17).
    altitude, yaw: initial pose of the vehicle, level and at rest.
    arm, flow_at: positions of the sensors.
    noise: standard deviations in the models.

    Raises:
        BadInput: no sensor, or none that a configuration can use; one twice; a rate, horizon or wait out of bounds.
    """

    sensors: Mapping[str, tuple[str, ...]]
    configurations: tuple[Configuration, ...] = ("A",)
    rate: Hertz = 100.0
    horizon: int = 10
    wait: Duration = 5_000_000
    solver: Solver = "daqp"
    gyroscope_bias: bool = False
    accelerometer_bias: bool = False
    largest_gyroscope: RadiansPerSecond = 0.05
    largest_accelerometer: MetresPerSecondSquared = 1.0
    lowest: Metres = 0.0
    as_printed: tuple[Printed, ...] = ()
    altitude: Metres = 10.0
    yaw: Radians = 0.0
    arm: Metres = 0.7
    flow_at: tuple[Metres, Metres, Metres] = (0.1, 0.05, 0.0)
    noise: Deviations = field(default_factory=Deviations)

    def __post_init__(self) -> None:
        """Check the bounds, those of the models included."""
        check_fields_above_zero(self, "rate")
        if self.horizon < 1:
            raise BadInput(f"horizon is {self.horizon}, a window has at least 1 step")
        if self.wait < 0:
            raise BadInput(f"wait is {self.wait} ns, it must be at least 0")
        if not self.configurations or len(set(self.configurations)) < len(self.configurations):
            raise BadInput(f"configurations is {list(self.configurations)}: write A, B, or both, each once")
        if self.accelerometer_bias and "A" not in self.configurations:
            raise BadInput("accelerometer_bias is true, and configuration B has no such state: add A, or leave it out")
        self._refuse_idle()
        if self.altitude < self.lowest:
            raise BadInput(f"altitude is {self.altitude:g} m, and lowest {self.lowest:g} m: it starts out of its bound")
        self._check_sensors()
        for configuration in self.configurations:
            self.model(configuration)

    def _refuse_idle(self) -> None:
        if "A" not in self.configurations:
            because = "only configuration A reads it: add A, or leave it out"
            refuse_idle(self, _OF_A, because)
            refuse_idle(self.noise, _NOISE_OF_A, because, "noise.")
            if "range" in self.as_printed:
                raise BadInput(f"as_printed names range, and {because}")
        for sensor in ("gyroscope", "accelerometer"):
            if not getattr(self, f"{sensor}_bias"):
                because = f"{sensor}_bias is no state: leave it out, or write {sensor}_bias: true"
                refuse_idle(self.noise, (f"{sensor}_walk",), because, "noise.")

    def _check_sensors(self) -> None:
        names = [sensor for sensors in self.sensors.values() for sensor in sensors]
        for name in names:
            if name not in PLACES["A"]:
                raise BadInput(f"sensors: {name!r} is not known: use {', '.join(PLACES['A'])}")
            if names.count(name) > 1:
                raise BadInput(f"sensors: {name} is there {names.count(name)} times: name each once")
        for configuration in self.configurations:
            used = [name for name, (is_input, _) in PLACES[configuration].items() if not is_input]
            if not set(used) & set(names):
                raise BadInput(
                    f"sensors names none that configuration {configuration} measures with: add one of {', '.join(used)}"
                )

    def model(self, configuration: Configuration) -> QuadrotorModel | AttitudeModel:
        """Model of a configuration."""
        printed = "accelerometer" in self.as_printed
        if configuration == "B":
            return AttitudeModel(
                step_s=1.0 / self.rate,
                gyroscope_bias=self.gyroscope_bias,
                largest_gyroscope=self.largest_gyroscope,
                printed_accelerometer=printed,
                deviations=self.noise,
            )
        return QuadrotorModel(
            step_s=1.0 / self.rate,
            arm=self.arm,
            flow_at=self.flow_at,
            gyroscope_bias=self.gyroscope_bias,
            accelerometer_bias=self.accelerometer_bias,
            largest_gyroscope=self.largest_gyroscope,
            largest_accelerometer=self.largest_accelerometer,
            lowest=self.lowest,
            printed_accelerometer=printed,
            printed_range="range" in self.as_printed,
            deviations=self.noise,
        )

    def start(self, configuration: Configuration, *, lost: bool) -> tuple[Floats, Floats]:
        """Initial state and covariance of its error; `lost`: in the middle of a flight."""
        model = self.model(configuration)
        attitude, wider = euler_to_quaternion(0.0, 0.0, self.yaw), _LOST if lost else 1.0
        if isinstance(model, AttitudeModel):
            state, spread = model.start(attitude), [_ATTITUDE_SD * wider] * 3
        else:
            state = model.start(attitude, self.altitude)
            spread = [_ATTITUDE_SD * wider] * 3 + [_VELOCITY_SD * wider] * 3 + [_HEIGHT_SD * wider]
        spread += [_GYROSCOPE_BIAS_SD] * (3 * self.gyroscope_bias)
        spread += [_ACCELEROMETER_BIAS_SD] * (model.size - len(spread))
        return state, np.diag(np.square(spread))


_RANGES = ("range_centre", "range_front", "range_right", "range_back", "range_left")
PLACES: Mapping[Configuration, Mapping[str, tuple[bool, slice]]] = {
    "A": {
        "gyroscope": (True, slice(0, 3)),
        "accelerometer": (True, slice(3, 6)),
        "magnetometer": (False, slice(0, 3)),
        "flow": (False, slice(3, 5)),
        **{name: (False, slice(5 + k, 6 + k)) for k, name in enumerate(_RANGES)},
    },
    "B": {
        "gyroscope": (True, slice(0, 3)),
        "accelerometer": (False, slice(3, 6)),
        "magnetometer": (False, slice(0, 3)),
    },
}
"""Configuration → sensor → whether it is an input of the model, and where its values stand among inputs or outputs."""
