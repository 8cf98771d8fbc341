"""Measurements on the wire: what a sensor's node tells, and how many bytes that takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import payloads
from .payloads import DamagedPayload, Precision

_LONGEST_STAMP_NS = 2**63 - 1


@dataclass(frozen=True, slots=True)
class Measurement:
    """One sample of a sensor of some node.

    stamp_ns: when it was taken, by the node's own clock.
    sensor: number of the sensor on that node.
    values: shape (n,), in the units of the world.
    """

    stamp_ns: int
    sensor: int
    values: NDArray[np.float64]


def encode(measurement: Measurement, precision: Precision) -> bytes:
    """A payload of stamp, number and values, the values in a precision."""
    content = [measurement.stamp_ns, measurement.sensor, measurement.values]
    return payloads.encode(content, precision)


def decode(payload: bytes) -> Measurement:
    """What `encode` was given, up to the precision of the values.

    Raises:
        DamagedPayload: no such payload.
    """
    match payloads.decode(payload):
        case [int(stamp_ns), int(sensor), np.ndarray() as values]:
            return Measurement(stamp_ns, sensor, values)
        case _:
            raise DamagedPayload(f"{len(payload)} bytes that are no measurement: stamp, number of the sensor, values")


def largest_size(sensor: int, count: int, precision: Precision) -> int:
    """Bytes of a payload of so many values, with the longest stamp."""
    return len(encode(Measurement(_LONGEST_STAMP_NS, sensor, np.zeros(count)), precision))
