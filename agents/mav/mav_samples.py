"""Samples of a vehicle: rows of its camera, and the three parts of its inertial measurement unit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...estimators.formation.filter import Observation, sighting
from ...estimators.frames.inertial_frame import ImuModel, imu_model
from ...rotations import rotate
from .mav_settings import MavParameters

CAMERA, IMU = "camera", "imu"
_INERTIA_KG_M2 = np.diag((0.0022, 0.0029, 0.0048))
_READING = (0.01, 2.0, 0.02)
_WALK = (5.0, 0.05, 0.01)
"""The accelerometer has a time constant of 7 s only: it measures thrust as up, however far the vehicle leans."""


class Sight(NamedTuple):
    """One vehicle in view: its place [m] and its orientation ξ, (4,), in the camera's body."""

    place: NDArray[np.float64]
    orientation: NDArray[np.float64]


def read_camera(value: NDArray[np.float64] | None) -> Mapping[int, Sight]:
    """Seen vehicle → its sight; empty for None."""
    return {} if value is None else {int(row[0]): Sight(row[1:4], row[4:8]) for row in value}


def read_imu(value: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """The three readings under the names of their sensors."""
    return {"gyro": value[:3], "accelerometer": value[3:6], "magnetometer": value[6:9]}


@cache
def frame_model() -> ImuModel:
    """Model that vehicles have of their inertial measurement units."""
    return imu_model(_INERTIA_KG_M2, _READING, _WALK)


def sightings(
    parameters: MavParameters, observer: int, sights: Mapping[int, Sight], attitude: NDArray[np.float64]
) -> list[Observation]:
    """Sightings as relative positions in the inertial frame, p_observer − p_seen.

    Their noise is that of the camera, which grows with the range beyond 1 m, and that of the own attitude.

    Args:
        parameters: the noises.
        observer: number of the vehicle whose camera it is.
        sights: from `read_camera`.
        attitude: of the observer, (4,).
    """
    found = []
    for seen, sight in sights.items():
        range_m = math.sqrt(sight.place.dot(sight.place))
        noise = parameters.filtering.camera_noise * max(1.0, range_m)
        deviation = math.hypot(noise, parameters.frames.noise * range_m)
        found.append(sighting(observer, seen, -rotate(attitude, sight.place), deviation))
    return found
