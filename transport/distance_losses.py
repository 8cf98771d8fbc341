"""Loss as a function of distance: path loss, shadowing and the receiver's sensitivity."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import BadInput
from ..units import DecibelMilliwatts, Decibels, Metres, Nanoseconds, check_fields_above_zero
from .sojourns import Sojourns, check_mean
from .stages import LossStage, Memory, Surroundings


@dataclass(frozen=True)
class Distance:
    """Log-distance path loss with log-normal shadowing; the receiver loses half of the frames at its sensitivity.

    received = power − reference_loss − 10·exponent·log₁₀(d / reference_distance) − X,  X ~ N(0, shadowing²)
    P(lost) = 1 / (1 + exp((received − sensitivity) / width))
    Rappaport 2002, §4.9. Below the reference distance the path loss is constant. Both directions of a link have the
    same X. X is constant, or changes to a new random value after exponential times with mean `decorrelation`, so that
    its autocorrelation is exp(−t / decorrelation), the shape that Gudmundson 1991 measured.

    Letters: d distance of the ends at the start of transmission [m], X shadowing [dB].

    exponent: path loss exponent, 2 in free space, more indoors.
    sensitivity: received power at which half of the frames are lost.
    power: power of the transmitter.
    reference_loss: path loss at the reference distance; the default is that of free space over 1 m at 2.4 GHz.
    reference_distance: distance of the reference loss.
    width: width of the receiver's logistic curve; 0 makes it a threshold.
    shadowing: standard deviation of X.
    decorrelation: mean time between changes of X.
    """

    exponent: float
    sensitivity: DecibelMilliwatts
    power: DecibelMilliwatts = 0.0
    reference_loss: Decibels = 40.0
    reference_distance: Metres = 1.0
    width: Decibels = 1.0
    shadowing: Decibels = 0.0
    decorrelation: Nanoseconds | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        check_fields_above_zero(self, "exponent", "reference_distance")
        for name in ("width", "shadowing"):
            if not 0 <= getattr(self, name) < math.inf:
                raise BadInput(f"{name} is {getattr(self, name):g} dB, it must be at least 0 dB")
        for name in ("sensitivity", "power", "reference_loss"):
            if not math.isfinite(getattr(self, name)):
                raise BadInput(f"{name} is {getattr(self, name):g}, it must be a finite number")
        if self.decorrelation is not None:
            check_mean("decorrelation", self.decorrelation)
            if not self.shadowing:
                raise BadInput("decorrelation is of shadowing, and there is none: give shadowing a standard deviation")

    @property
    def mean(self) -> float:
        """NaN: the long-run loss depends on the positions of the ends."""
        return math.nan

    @property
    def memory(self) -> Memory:
        """No covariance, given the shadowing."""
        return Memory()

    def loss_at(self, distance_m: float, shadowing_db: float = 0.0) -> float:
        """Probability that a frame is lost at this distance and shadowing."""
        decades = math.log10(max(distance_m / self.reference_distance, 1.0))
        received = self.power - self.reference_loss - 10.0 * self.exponent * decades - shadowing_db
        margin = received - self.sensitivity
        if not self.width:
            return float(margin < 0.0)
        return 0.5 * (1.0 - math.tanh(0.5 * margin / self.width))

    def stage(self, around: Surroundings) -> LossStage:
        """A stage that computes the loss from the distance for each frame."""
        return _DistanceStage(self, around)


class _DistanceStage:
    __slots__ = ("_distance_m", "_draws", "_model", "_normals", "_sojourns")

    def __init__(self, model: Distance, around: Surroundings) -> None:
        self._model = model
        self._draws = around.stream("loss")
        self._distance_m = around.distance_m
        self._normals = around.path("shadowing")
        self._sojourns = (
            None if model.decorrelation is None else Sojourns(around.path("shadowing-sojourns"), model.decorrelation)
        )

    def lost(self, index: int, start_ns: int, bits: int) -> bool:
        return self._draws.uniform(index) < self.expected(index, start_ns, bits)

    def expected(self, index: int, start_ns: int, bits: int) -> float:
        model = self._model
        shadowing = 0.0
        if model.shadowing:
            number = 0 if self._sojourns is None else self._sojourns.number(start_ns)
            shadowing = model.shadowing * self._normals.normal(number)
        return model.loss_at(self._distance_m(start_ns), shadowing)
