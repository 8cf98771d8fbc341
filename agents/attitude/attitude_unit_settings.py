"""Parameters of a measurement unit, and the messages between units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...errors import BadInput
from ...estimators.attitude.dynamic_consensus import AttitudeMessage
from ...units import Hertz, Nanoseconds, Radians, check_fields_above_zero, period_ns
from .. import payloads
from ..idle import refuse_idle
from ..payloads import DamagedPayload, Precision
from ..sample_counts import COUNTS

_SPREAD = 8
_MOST_DIRECTIONS = 2

Angles = tuple[Radians, Radians, Radians]
"""Roll, pitch and yaw [rad]."""


@dataclass(frozen=True)
class AttitudeParameters:
    """Parameters of a measurement unit; the lists of units by name are the same for all of them.

    rate: samples and rounds per second, the rate of the world's sensors.
    mountings: unit → attitude of its frame in that of the body; every unit with a sensor has one.
    gain: κ of the dynamic consensus.
    alpha: α of the projections, gamma: γ.
    initial: first estimate of the attitude.
    alone: units outside of the network: they exchange no messages, and their prior is their own estimate.
    max_age: age in samples up to which a message is used; each is used at most once.
    trust: root mean square residual up to which a sensor is trusted; if not given, all are always trusted.
    forget: time constant of that mean.
    payload: precision of the numbers in a frame.
    phase: rounds of all units at the same instants, or shifted by a phase drawn from the seed.
    report_own: report the own estimate besides, as `own-attitude`.
    """

    rate: Hertz = 10.0
    mountings: Mapping[str | int, Angles] = field(default_factory=dict)
    gain: float = 1.0
    alpha: float = 0.2
    gamma: float = 1.0
    initial: Angles = (0.0, 0.0, 0.0)
    alone: tuple[str | int, ...] = ()
    max_age: int = 1
    trust: Radians | None = None
    forget: Nanoseconds = 1_000_000_000
    payload: Precision = "float32"
    phase: Literal["aligned", "drawn"] = "drawn"
    report_own: bool = False

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(self, "rate", "gain", "alpha")
        if not 0.0 < self.gamma < 2.0:
            raise BadInput(f"gamma is {self.gamma:g}, it must be above 0 and below 2")
        if not 1 <= self.max_age < COUNTS // 2:
            raise BadInput(f"max_age is {self.max_age}, it must be from 1 to {COUNTS // 2 - 1} samples")
        if self.trust is not None and not 0.0 < self.trust <= math.pi:
            raise BadInput(f"trust is {math.degrees(self.trust):g} deg, it must be above 0 and at most 180 deg")
        if self.forget * self.rate < 1e9:
            raise BadInput(
                f"forget is {self.forget / 1e9:g} s, shorter than from one sample to the next: make it longer"
            )
        if self.trust is None:
            refuse_idle(self, ("forget",), "without trust no residual is looked at: leave it out, or write trust too")

    def mounting(self, name: str) -> Angles | None:
        """Mounting of a unit; None if not known."""
        return next((angles for unit, angles in self.mountings.items() if str(unit) == name), None)

    def is_alone(self, name: str) -> bool:
        """Whether a unit is outside of the network."""
        return name in map(str, self.alone)

    @property
    def step(self) -> float:
        """κ dt of the dynamic consensus."""
        return self.gain / self.rate

    @property
    def share(self) -> float:
        """Weight of the newest residual in the mean of a sensor's residuals."""
        return 1e9 / (self.rate * self.forget)

    @property
    def largest_payload(self) -> int:
        """Bytes of the longest message."""
        zeros = AttitudeMessage(np.zeros(4), np.zeros(4))
        return len(UnitMessage(COUNTS - 1, _MOST_DIRECTIONS, zeros).encode(self.payload))

    def spread_ns(self) -> int:
        """Largest phase of a unit's rounds [ns]."""
        return 0 if self.phase == "aligned" else period_ns(self.rate, 1) // _SPREAD


@dataclass(frozen=True)
class UnitMessage:
    """Message of a unit to its neighbours after a sample.

    count: index of the sample, modulo COUNTS. directions: number of directions in its own estimate.
    """

    count: int
    directions: int
    attitude: AttitudeMessage

    def encode(self, precision: Precision) -> bytes:
        """The payload."""
        numbers = np.concatenate([self.attitude.estimate, self.attitude.average])
        return payloads.encode([self.count, self.directions, numbers], precision)

    @classmethod
    def decode(cls, payload: bytes) -> UnitMessage:
        """What was encoded, up to the precision.

        Raises:
            DamagedPayload: no such payload.
        """
        match payloads.decode(payload):
            case [int(count), int(directions), np.ndarray(shape=(8,)) as numbers]:
                return cls(count, directions, AttitudeMessage(numbers[:4].copy(), numbers[4:].copy()))
            case _:
                raise DamagedPayload(f"{len(payload)} bytes that are no attitude: count, directions, 8 numbers")
