"""Kinds of agents by name."""

from __future__ import annotations

from ..kinds import Kinds
from .agent import Agent
from .agent_class_checks import check_agent_class

AGENTS = Kinds(
    "agent kind",
    {
        "altitude-ekf": "volery.agents.altitude.altitude_ekf:AltitudeEkf",
        "attitude-unit": "volery.agents.attitude.unit:AttitudeUnit",
        "beacon": "volery.agents.beacon:Beacon",
        "dfa-kalman": "volery.agents.dfa.kalman:DfaKalman",
        "dfa-module": "volery.agents.dfa.module:DfaModule",
        "mav": "volery.agents.mav.vehicle:Mav",
        "mhe": "volery.agents.mhe.estimator:Mhe",
        "tracker": "volery.agents.fusion.tracker:Tracker",
        "sensor-node": "volery.agents.sensor_node:SensorNode",
    },
    tag="kind",
    entry_points="volery.agents",
    base=Agent,
    check=check_agent_class,
)
_WORLD_AGENTS = {"coupled-world": "volery.agents.coupled_world:CoupledWorld"}
"""Kinds that run beside the agents and that no scenario can name."""


def find(kind: str) -> type[Agent]:
    """The class of a kind, that of a world agent included.

    Raises:
        BadInput: no such name, module or class, or not a subclass of Agent.
    """
    found: type[Agent] = AGENTS.find(_WORLD_AGENTS.get(kind, kind))
    return found
