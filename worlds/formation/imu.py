"""Inertial measurement units of vehicles: gyroscope, accelerometer and magnetometer with errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import BadInput
from ...randomness import stream
from ...rotations import exp_so3
from ...units import Hertz, MetresPerSecondSquared, Radians, RadiansPerSecond, check_above_zero

Floats = NDArray[np.float64]
VALUES = 9


@dataclass(frozen=True)
class Imu:
    """Rate and errors of an inertial measurement unit.

    Noise and biases are normal and independent on each axis: standard deviations of the gyroscope [rad/s], the
    accelerometer [m/s²] and the magnetometer, which gives the field as a share of its strength.

    Attributes:
        rate: samples per second [Hz].
        gyro_noise, accelerometer_noise, magnetometer_noise: drawn anew for each sample.
        gyro_bias, accelerometer_bias, magnetometer_bias: drawn once for each vehicle.
        miscalibration: standard deviation on each axis [rad] of the rotation, drawn once for each vehicle, between the
            unit's axes and the body's.
        inclination: of the magnetic field below the horizon [rad].

    Raises:
        BadInput: one of them is out of its bounds.
    """

    rate: Hertz = 30.0
    gyro_noise: RadiansPerSecond = 0.01
    accelerometer_noise: MetresPerSecondSquared = 0.1
    magnetometer_noise: float = 0.01
    gyro_bias: RadiansPerSecond = 0.005
    accelerometer_bias: MetresPerSecondSquared = 0.05
    magnetometer_bias: float = 0.005
    miscalibration: Radians = math.radians(1.0)
    inclination: Radians = math.radians(63.0)

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_above_zero("imu.rate", self.rate, "Hz")
        for name in (*(f"{sensor}_{kind}" for sensor in _SENSORS for kind in ("noise", "bias")), "miscalibration"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise BadInput(f"imu.{name} is {getattr(self, name):g}, it must be at least 0")
        if not abs(self.inclination) < math.pi / 2:
            degrees = math.degrees(self.inclination)
            raise BadInput(f"imu.inclination is {degrees:g} deg, it must be within 90 deg: else there is no north")

    def exact(self) -> Imu:
        """The same unit without noise, biases and miscalibration."""
        return replace(
            self,
            gyro_noise=0.0,
            accelerometer_noise=0.0,
            magnetometer_noise=0.0,
            gyro_bias=0.0,
            accelerometer_bias=0.0,
            magnetometer_bias=0.0,
            miscalibration=0.0,
        )

    @property
    def field(self) -> Floats:
        """The magnetic field in inertial coordinates, x north, y west, z up, (3,), of length 1."""
        return np.array((math.cos(self.inclination), 0.0, -math.sin(self.inclination)))

    def spread(self, kind: str) -> Floats:
        """Standard deviations of "noise" or "bias", in the order of a sample, (9,)."""
        return np.repeat([getattr(self, f"{sensor}_{kind}") for sensor in _SENSORS], 3)


_SENSORS = ("gyro", "accelerometer", "magnetometer")


class Units:
    """The inertial measurement units of all vehicles, each with its own biases and miscalibration."""

    def __init__(self, imu: Imu, seed: int, agents: Sequence[str]) -> None:
        once = [stream(seed, "imu calibration", agent) for agent in agents]
        self.axes: Floats = np.array([exp_so3(imu.miscalibration * np.array(each.normals(0, 3))) for each in once])
        self.bias: Floats = np.array([imu.spread("bias") * each.normals(3, VALUES) for each in once])
        self._noise = imu.spread("noise")
        self._draws = [stream(seed, "imu noise", agent) for agent in agents]

    def samples(self, rates: Floats, forces: Floats, fields: Floats, index: int) -> Floats:
        """The index-th sample of each: body rates [rad/s], specific force [m/s²] and field (1), (N, 9).

        Each is s = Aᵀ s_B + bias + noise, where A turns the unit's axes into the body's.

        Args:
            rates: true ones in body coordinates, (3, N).
            forces: likewise.
            fields: likewise.
            index: of the sample; noise is a function of it.
        """
        true = np.array((rates, forces, fields)).transpose(2, 0, 1) @ self.axes
        noise = np.array([each.normals(VALUES * index, VALUES) for each in self._draws])
        return np.asarray(true.reshape(-1, VALUES) + self.bias + self._noise * noise)
