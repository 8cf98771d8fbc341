"""Worlds: the truth that agents estimate, and the sensors that look at it, as pure functions of seed and time.

`plane` is a rigid body over flat ground with its nonlinear distances, `signals` the motions it can make, `sensors` what
measures a distance, `calibration` the infrared sensor's curve, `motions` a world in which agents move, `quadrotor` a
vehicle in controlled flight, `quadrotor_sensors` what it carries, `rigid_body` a body that turns, `measurement_units`
the accelerometers and magnetometers on it, `formation` vehicles that agents steer, made of `vehicles`, `air`, `camera`
and `imu`, and `scenario` builds a world of any kind from a scenario's mapping.
"""

from .calibration import Calibration, calibrate
from .measurement_units import ACCELEROMETER, DIRECTIONS, MAGNETOMETER, MeasurementUnit, RigidBodyWorld
from .motions import Circle, Motion, MovingWorld, Paths, RandomWaypoint
from .plane import PlaneWorld, distances
from .quadrotor import Airframe, Flight, FlightState, Manoeuvre
from .quadrotor_sensors import QuadrotorWorld
from .rigid_body import RigidBody, Turning
from .scenario import MOVING, build, needs_places
from .sensors import DistanceSensor, GaussianDistance, Infrared
from .signals import Constant, Ramp, Signal, Sine, Steps

__all__ = [
    "ACCELEROMETER",
    "DIRECTIONS",
    "MAGNETOMETER",
    "MOVING",
    "Airframe",
    "Calibration",
    "Circle",
    "Constant",
    "DistanceSensor",
    "Flight",
    "FlightState",
    "GaussianDistance",
    "Infrared",
    "Manoeuvre",
    "MeasurementUnit",
    "Motion",
    "MovingWorld",
    "Paths",
    "PlaneWorld",
    "QuadrotorWorld",
    "Ramp",
    "RandomWaypoint",
    "RigidBody",
    "RigidBodyWorld",
    "Signal",
    "Sine",
    "Steps",
    "Turning",
    "build",
    "calibrate",
    "distances",
    "needs_places",
]
