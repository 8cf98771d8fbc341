"""Kinds of worlds by name, and what their settings have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Protocol

from ..errors import BadInput
from ..kinds import Kinds
from ..names import did_you_mean
from ..overrides import check_overrides
from ..topologies import Position
from .world import World


class WorldSettings(Protocol):
    """Settings of a world."""

    needs_places: ClassVar[bool]
    """Whether agents need positions."""

    def build(self, positions: Mapping[str, Position], seed: int, agents: Sequence[str]) -> Any:
        """The world.

        Args:
            positions: agent → (r_X, r_Y) [m], where the topology has places.
            seed: of the run.
            agents: those of the topology, in natural order; none where it takes them from a world that moves.
        Raises:
            BadInput: with the place of what is wrong below these settings, and the remedy.
        """


def _check_class(kind: type[World], what: str) -> None:
    check_overrides(kind, World, what)


WORLDS = Kinds(
    "world kind",
    {
        "plane": "volery.worlds.plane.plane_settings:PlaneSettings",
        "moving": "volery.worlds.moving.moving_settings:MovingSettings",
        "altitude": "volery.worlds.altitude.altitude_settings:AltitudeSettings",
        "quadrotor": "volery.worlds.quadrotor.quadrotor_settings:QuadrotorSettings",
        "rigid-body": "volery.worlds.rigid_body.rigid_body_settings:RigidBodySettings",
        "formation": "volery.worlds.formation.formation_settings:FormationSettings",
        "target": "volery.worlds.target.target_settings:TargetSettings",
    },
    tag="kind",
    entry_points="volery.worlds",
    base=World,
    check=_check_class,
    own="volery.worlds.own_world:OwnWorldSettings",
)
AnyWorld = Annotated[WorldSettings, WORLDS]
"""A scenario's `world:`."""


def check_agent(name: str, agents: Sequence[str], *place: str) -> str:
    """The name, if there is such an agent.

    Raises:
        BadInput: there is none, with the nearest.
    """
    if name not in agents:
        raise BadInput(f"there is no agent {name!r}{did_you_mean(name, agents)}", place)
    return name
