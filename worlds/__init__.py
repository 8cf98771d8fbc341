"""Worlds: the truth that agents estimate, and the sensors that look at it, as pure functions of seed and time.

`plane` is a rigid body over flat ground with its nonlinear distances, `signals` the motions it can make, `sensors` what
measures a distance, `calibration` the infrared sensor's curve, `motions` a world in which agents move, and `scenario`
builds a world of any kind from a scenario's mapping.
"""

from .calibration import Calibration, calibrate
from .motions import Circle, Motion, MovingWorld, Paths, RandomWaypoint
from .plane import PlaneWorld, distances
from .scenario import MOVING, build, needs_places
from .sensors import DistanceSensor, GaussianDistance, Infrared
from .signals import Constant, Signal, Sine, Steps

__all__ = [
    "MOVING",
    "Calibration",
    "Circle",
    "Constant",
    "DistanceSensor",
    "GaussianDistance",
    "Infrared",
    "Motion",
    "MovingWorld",
    "Paths",
    "PlaneWorld",
    "RandomWaypoint",
    "Signal",
    "Sine",
    "Steps",
    "build",
    "calibrate",
    "distances",
    "needs_places",
]
