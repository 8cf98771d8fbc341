"""Settings of a target in the plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from ...errors import BadInput
from ...topologies import Position
from ...units import Hertz, Metres, MetresPerSecond, MetresPerSecondPerRootSecond
from ..world_kinds import check_agent
from .target_world import TargetWorld

Seen = Literal["x", "y", "nothing"]


@dataclass(frozen=True)
class TargetSettings:
    """A target in the plane.

    rate: of all sensors.
    manoeuvre: random walk of the velocity: its standard deviation after one second.
    noise: standard deviation of a measurement.
    position: standard deviation of the initial position.
    velocity: standard deviation of the initial velocity.
    sees: coordinates measured by the first, second, third agent and so on, cyclically, as in [x, y, nothing]; or by
        name, as in {1: x, 4: y}, where all others measure nothing.
    """

    needs_places: ClassVar[bool] = False

    rate: Hertz = 2.0
    manoeuvre: MetresPerSecondPerRootSecond = 0.7
    noise: Metres = 2.0
    position: Metres = 10.0
    velocity: MetresPerSecond = 2.0
    sees: tuple[Seen, ...] | Mapping[str, Seen] = ("x", "y", "nothing")

    def __post_init__(self) -> None:
        """Check that some agent measures something."""
        if not self.sees:
            raise BadInput("write a list, as in [x, y, nothing], or a mapping, as in {1: x, 4: y}", ("sees",))

    def build(self, positions: Mapping[str, Position], seed: int, agents: Sequence[str]) -> TargetWorld:
        """The world."""
        sees = self.sees
        if isinstance(sees, Mapping):
            named = {check_agent(agent, agents, "sees", agent): what for agent, what in sees.items()}
        else:
            named = {agent: sees[number % len(sees)] for number, agent in enumerate(agents)}
        seen = {agent: what for agent, what in named.items() if what != "nothing"}
        return TargetWorld(seen, seed, self.rate, self.manoeuvre, self.noise, self.position, self.velocity)
