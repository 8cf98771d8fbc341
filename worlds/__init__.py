"""Worlds: the truth that agents estimate, and the sensors that look at it, as pure functions of seed and time.

`plane` is a rigid body over flat ground with its nonlinear distances, `signals` the motions it can make, `sensors` what
measures a distance, `calibration` the infrared sensor's curve, `motions` a world in which agents move, `altitude` a
vehicle that goes over a `room` on a `tour` with `altitude_sensors`, `quadrotor` one in controlled flight,
`quadrotor_sensors` what it carries, `rigid_body` a body that turns, `measurement_units` the accelerometers and
magnetometers on it, `formation` vehicles that agents steer, made of `vehicles`, `air`, `camera` and `imu`, and
`scenario` builds a world of any kind from a scenario's mapping.
"""

from .altitude import AltitudeWorld
from .altitude_sensors import AltitudeSensor, BarometerSensor, ImuSensor, RangeSensor
from .calibration import Calibration, calibrate
from .measurement_units import ACCELEROMETER, DIRECTIONS, MAGNETOMETER, MeasurementUnit, RigidBodyWorld
from .motions import Circle, Motion, MovingWorld, Paths, RandomWaypoint
from .plane import PlaneWorld, distances
from .quadrotor import Airframe, Flight, FlightState, Manoeuvre
from .quadrotor_sensors import QuadrotorWorld
from .rigid_body import RigidBody, Turning
from .room import Obstacle, Room
from .scenario import MOVING, build, needs_places
from .sensors import DistanceSensor, GaussianDistance, Infrared
from .signals import Constant, Ramp, Signal, Sine, Steps
from .tour import Tour

__all__ = [
    "ACCELEROMETER",
    "DIRECTIONS",
    "MAGNETOMETER",
    "MOVING",
    "Airframe",
    "AltitudeSensor",
    "AltitudeWorld",
    "BarometerSensor",
    "Calibration",
    "Circle",
    "Constant",
    "DistanceSensor",
    "Flight",
    "FlightState",
    "GaussianDistance",
    "ImuSensor",
    "Infrared",
    "Manoeuvre",
    "MeasurementUnit",
    "Motion",
    "MovingWorld",
    "Obstacle",
    "Paths",
    "PlaneWorld",
    "QuadrotorWorld",
    "Ramp",
    "RandomWaypoint",
    "RangeSensor",
    "RigidBody",
    "RigidBodyWorld",
    "Room",
    "Signal",
    "Sine",
    "Steps",
    "Tour",
    "Turning",
    "build",
    "calibrate",
    "distances",
    "needs_places",
]
