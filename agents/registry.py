"""Kinds of agents by name: built in, from entry points of installed packages, or `package.module:Class`."""

from __future__ import annotations

from functools import cache
from importlib.metadata import entry_points

from ..errors import BadInput
from ..names import did_you_mean, imported_class
from .agent import Agent

ENTRY_POINTS = "volery.agents"
_BUILT_IN = {
    "altitude-ekf": "volery.agents.altitude.altitude_ekf:AltitudeEkf",
    "attitude-unit": "volery.agents.attitude.unit:AttitudeUnit",
    "beacon": "volery.agents.beacon:Beacon",
    "dfa-kalman": "volery.agents.dfa.kalman:DfaKalman",
    "dfa-module": "volery.agents.dfa.module:DfaModule",
    "mav": "volery.agents.mav.vehicle:Mav",
    "mhe": "volery.agents.mhe.estimator:Mhe",
    "tracker": "volery.agents.fusion.tracker:Tracker",
    "sensor-node": "volery.agents.sensor_node:SensorNode",
}
_WORLD_AGENTS = {"coupled-world": "volery.agents.coupled_world:CoupledWorld"}
"""Kinds that run beside the agents and that no scenario can name."""


def names() -> list[str]:
    """Every kind that has a name."""
    return sorted({*_BUILT_IN, *(point.name for point in entry_points(group=ENTRY_POINTS))})


@cache
def find(kind: str) -> type[Agent]:
    """The class of a kind.

    Raises:
        BadInput: no such name, module or class, or not a subclass of Agent.
    """
    target = kind if ":" in kind else {**_BUILT_IN, **_WORLD_AGENTS}.get(kind)
    if target is None:
        points = entry_points(group=ENTRY_POINTS, name=kind)
        if not points:
            raise BadInput(f"unknown agent kind {kind!r}{did_you_mean(kind, names())}, or write package.module:Class")
        target = next(iter(points)).value
    return imported_class(target, Agent, f"agent kind {kind!r}")
