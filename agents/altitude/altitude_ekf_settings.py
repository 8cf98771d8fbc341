"""Parameters of the agent that estimates the altitude."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ...errors import BadInput
from ...estimators.altitude.components import Barometer, Ground, Imu, RangeFinder, Robot, Sensor
from ...estimators.altitude.modular_filter import GroundJumps, ModularFilter, check_names
from ...units import Duration, Hertz, check_fields_above_zero
from ..idle import refuse_idle

_FLOOR = ("level", "floor_noise")


@dataclass(frozen=True)
class AltitudeEkfParameters:
    """Parameters of the estimating agent; the filter is put together from its components.

    rate: estimates per second.
    history: for how long measurements are kept, so that late ones can be inserted.
    imus, barometers, range_finders: name → component. The name is that of the node that sends the measurements; for
        a node with several sensors, those after the first are NODE.1, NODE.2 and so on.
    robot, ground: components that every filter has.
    jumps: how jumps of the ground are handled.
    """

    rate: Hertz = 20.0
    history: Duration = 500_000_000
    imus: Mapping[str, Imu] = field(default_factory=dict)
    barometers: Mapping[str, Barometer] = field(default_factory=dict)
    range_finders: Mapping[str, RangeFinder] = field(default_factory=dict)
    robot: Robot = field(default_factory=Robot)
    ground: Ground = field(default_factory=Ground)
    jumps: GroundJumps = field(default_factory=GroundJumps)

    def __post_init__(self) -> None:
        """Check the bounds and the names."""
        check_fields_above_zero(self, "rate")
        if self.history < 0:
            raise BadInput(f"history is {self.history} ns, it must be at least 0")
        check_names([name for name, _ in self.components()])
        if self.jumps.variant == "as_printed":
            because = "jumps.variant is as_printed, which trusts every innovation: leave it out, or choose gate"
            refuse_idle(self.jumps, ("gate", "jump", *_FLOOR), because, "jumps.")
        if self.jumps.variant == "gate":
            because = "jumps.variant is gate, which knows no floor: leave it out, or choose gate_and_floor"
            refuse_idle(self.jumps, _FLOOR, because, "jumps.")

    def components(self) -> list[tuple[str, Sensor]]:
        """Name and component of all sensors."""
        return [*self.imus.items(), *self.barometers.items(), *self.range_finders.items()]

    def filter(self) -> ModularFilter:
        """Filter with these components."""
        return ModularFilter(self.robot, self.ground, self.components(), self.jumps)
