"""Kinds of agents by name."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral, Real

from ..errors import BadInput
from ..kinds import Kinds
from .agent import Agent, Offer
from .agent_class_checks import check_agent_class
from .plan import Plan

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


def offer_of(plan: Plan, name: str) -> Offer:
    """What an agent of a plan offers to each neighbour, as its class says.

    Raises:
        BadInput: what it says is no number of bytes, or no rate.
    """
    kind = plan.agent(name).kind
    found = find(kind).offers(plan, name)
    whole = found.largest_payload is None or isinstance(found.largest_payload, Integral)
    if not whole or (found.largest_payload or 0) < 0:
        raise BadInput(f"agent kind {kind!r}: largest_payload is {found.largest_payload!r}: give whole bytes, or None")
    if found.per_second is not None and not (isinstance(found.per_second, Real) and found.per_second >= 0):
        raise BadInput(f"agent kind {kind!r}: sends_per_second is {found.per_second!r}: give a number, or None")
    return found


def problems_of(kind: str, plan: Plan) -> Sequence[str]:
    """What makes a plan impossible for agents of a kind, a sentence each.

    Raises:
        BadInput: what the class returns are no sentences.
    """
    found = find(kind).problems(plan)
    if isinstance(found, str) or not all(isinstance(text, str) for text in found):
        raise BadInput(f"agent kind {kind!r}: problems returned {found!r}: give a list of sentences")
    return found
