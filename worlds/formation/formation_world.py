"""A formation of micro aerial vehicles as a coupled world."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .air import Scripted
from .formation_description import FormationDescription
from .formation_flight import RunningFormation


@dataclass(frozen=True)
class FormationWorld(FormationDescription):
    """Vehicles that the agents control."""

    def begin(self) -> RunningFormation:
        """The world at instant 0."""
        return RunningFormation(self)

    def undisturbed(self) -> FormationWorld:
        """The same world without noise, biases, misses, turbulence and gusts; occlusions stay."""
        return replace(
            self,
            camera=None if self.camera is None else self.camera.exact(),
            imu=None if self.imu is None else self.imu.exact(),
            turbulence=replace(self.turbulence, acceleration=0.0),
            gusts=Scripted(),
        )


def headings_to(places: NDArray[np.float64], targets: NDArray[np.float64]) -> tuple[float, ...]:
    """The headings [rad] from places (N, 3) to targets (N, 3) [m]."""
    apart = targets - places
    return tuple(np.arctan2(apart[:, 1], apart[:, 0]).tolist())
