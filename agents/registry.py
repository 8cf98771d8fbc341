"""Kinds of agents by name: built in, from entry points of installed packages, or `package.module:Class`."""

from __future__ import annotations

import difflib
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points

from ..errors import BadInput
from .agent import Agent

ENTRY_POINTS = "volery.agents"
_BUILT_IN = {
    "altitude-ekf": "volery.agents.altitude.ekf:AltitudeEkf",
    "attitude-unit": "volery.agents.attitude.unit:AttitudeUnit",
    "beacon": "volery.agents.beacon:Beacon",
    "dfa-kalman": "volery.agents.dfa.kalman:DfaKalman",
    "dfa-module": "volery.agents.dfa.module:DfaModule",
    "mav": "volery.agents.mav.vehicle:Mav",
    "mhe": "volery.agents.mhe.estimator:Mhe",
    "tracker": "volery.agents.fusion.tracker:Tracker",
    "sensor-node": "volery.agents.sensor_node:SensorNode",
}
_BESIDE = {"coupled-world": "volery.agents.coupled_world:CoupledWorld"}
"""What runs beside agents and is none that a scenario could ask for."""


def names() -> list[str]:
    """Every kind that has a name."""
    return sorted({*_BUILT_IN, *(point.name for point in entry_points(group=ENTRY_POINTS))})


@cache
def find(kind: str) -> type[Agent]:
    """The class of a kind.

    Raises:
        BadInput: no such name, module or class, or not a subclass of Agent.
    """
    target = kind if ":" in kind else {**_BUILT_IN, **_BESIDE}.get(kind)
    if target is None:
        points = entry_points(group=ENTRY_POINTS, name=kind)
        if not points:
            near = difflib.get_close_matches(kind, names(), 1)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names())}, or package.module:Class"
            raise BadInput(f"unknown agent kind {kind!r}; {hint}")
        target = next(iter(points)).value
    module, _, attribute = target.partition(":")
    try:
        found = getattr(import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise BadInput(f"agent kind {kind!r} cannot be loaded: {error}") from error
    if not (isinstance(found, type) and issubclass(found, Agent)):
        raise BadInput(f"agent kind {kind!r} is {found!r}, not a subclass of volery.agents.Agent")
    return found
