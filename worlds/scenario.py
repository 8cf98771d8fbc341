"""Worlds from the `world:` mapping of a scenario, by their kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..topologies import Position
from .altitude.scenario import build_altitude
from .formation.scenario import build_formation
from .moving.scenario import build_moving
from .plane.scenario import build_plane
from .quadrotor.scenario import build_quadrotor
from .rigid_body.scenario import build_rigid_body
from .target.scenario import build_target
from .written import choice, required

MOVING = "moving"


@dataclass(frozen=True)
class _Kind:
    """How a world is built, and whether it needs agents that have places."""

    build: Callable[[Mapping[str, Any], Mapping[str, Position], int, Sequence[str]], Any]
    needs_places: bool = False


_KINDS: Mapping[str, _Kind] = {
    "plane": _Kind(build_plane, needs_places=True),
    MOVING: _Kind(build_moving),
    "altitude": _Kind(build_altitude),
    "quadrotor": _Kind(build_quadrotor),
    "rigid-body": _Kind(build_rigid_body),
    "formation": _Kind(build_formation),
    "target": _Kind(build_target),
}


def build(spec: Mapping[str, Any], positions: Mapping[str, Position], seed: int, agents: Sequence[str] = ()) -> Any:
    """The world that a scenario asks for, of the `kind` that it names.

    Args:
        spec: the mapping, quantities as text with units.
        positions: agent → (r_X, r_Y) [m], where the topology has places.
        seed: of the run.
        agents: those of the topology, in natural order; none where it takes them from a world that moves.
    Raises:
        BadInput: with the place of the first thing that is wrong, and the remedy.
    """
    return _KINDS[_kind(spec)].build(spec, positions, seed, agents)


def needs_places(spec: Mapping[str, Any]) -> bool:
    """Whether a world of this kind needs agents that have places.

    Raises:
        BadInput: no kind, or one that is not known.
    """
    return _KINDS[_kind(spec)].needs_places


def _kind(spec: Mapping[str, Any]) -> str:
    kind = required(spec, "kind", "world")
    choice(kind, _KINDS, "world.kind")
    return str(kind)
