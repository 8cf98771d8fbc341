"""Settings of a quadrotor and its sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

from ...errors import BadInput
from ...topologies import Position
from ...units import Hertz, Metres, OneOrMany
from ..signals import Angles, Constant, Lengths
from ..world_kinds import check_agent
from .flight import Airframe, Manoeuvre
from .quadrotor_sensors import DEVIATIONS, QuadrotorWorld

Sensor = Literal[
    "gyroscope",
    "accelerometer",
    "magnetometer",
    "flow",
    "range_centre",
    "range_front",
    "range_right",
    "range_back",
    "range_left",
]
Sensors = Annotated[tuple[Sensor, ...], OneOrMany()]
_LEVEL = Constant(0.0)


@dataclass(frozen=True)
class QuadrotorSettings:
    """A quadrotor in a manoeuvre, with its sensors on agents.

    sensors: agent → its sensors, as in {imu: [gyroscope, accelerometer, magnetometer], flow: flow}.
    roll: setpoint of the controller.
    pitch: setpoint of the controller.
    yaw: setpoint of the controller.
    altitude: setpoint of the controller.
    rate: of all sensors.
    rates: of single sensors.
    noise: factor on the noise of Bassolillo 2025, Table I.
    arm: from the centre to a rotor.
    flow_at: position of the optical-flow camera on the body.
    as_printed: sensors that follow the paper's equation exactly as printed.
    """

    needs_places: ClassVar[bool] = False

    sensors: Mapping[str, Sensors]
    roll: Angles = _LEVEL
    pitch: Angles = _LEVEL
    yaw: Angles = _LEVEL
    altitude: Lengths = Constant(10.0)  # noqa: RUF009 - frozen
    rate: Hertz = 100.0
    rates: Mapping[Sensor, Hertz] = field(default_factory=dict)
    noise: float = 1.0
    arm: Metres = 0.7
    flow_at: tuple[Metres, Metres, Metres] | None = None
    as_printed: Annotated[tuple[Literal["accelerometer", "range"], ...], OneOrMany()] = ()

    def __post_init__(self) -> None:
        """Reject rates and positions of sensors that no agent has."""
        if not self.sensors:
            text = "write at least one agent and what it carries, as in {flow: [flow]}"
            raise BadInput(text, ("sensors",))
        carried = {sensor for sensors in self.sensors.values() for sensor in sensors}
        named: list[tuple[str, tuple[str, ...]]] = [(sensor, ("rates", sensor)) for sensor in self.rates]
        for sensor, place in (*named, *((("flow", ("flow_at",)),) if self.flow_at is not None else ())):
            if sensor not in carried:
                text = f"is of a sensor that no agent carries: leave it out, or add {sensor} to sensors"
                raise BadInput(text, place)

    def build(self, positions: Mapping[str, Position], seed: int, agents: Sequence[str]) -> QuadrotorWorld:
        """The world."""
        return QuadrotorWorld(
            Manoeuvre(self.roll, self.pitch, self.yaw, self.altitude),
            {check_agent(agent, agents, "sensors", agent): carried for agent, carried in self.sensors.items()},
            seed,
            dict.fromkeys(DEVIATIONS, self.rate) | dict(self.rates.items()),
            Airframe(arm=self.arm),
            self.noise,
            QuadrotorWorld.flow_at if self.flow_at is None else self.flow_at,
            self.as_printed,
        )
