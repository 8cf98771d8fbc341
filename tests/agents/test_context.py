"""What an agent can reach: what a robot would know, and nothing of the truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import FunctionType, MethodType
from typing import Any

import pytest

from volery.agents.agent import Agent, Context, Report
from volery.agents.node import Node
from volery.agents.node_state import NodeState
from volery.agents.plan import AgentPlan, Plan, PublicPlan
from volery.agents.receiver import Receiver
from volery.agents.sender import Sender
from volery.errors import BadInput, RunFailed
from volery.experiments.scenario.load import load_scenario


class Cheating(Agent):
    """Would be told the true state at the start."""

    @classmethod
    def briefing(cls, plan: PublicPlan, name: str) -> object:
        """The truth."""
        return plan.world.truth(0)  # type: ignore[attr-defined]


FORBIDDEN = (Plan, AgentPlan, Node, NodeState, Sender, Receiver, Agent)


def agent_of(scenario: str) -> Agent:
    """The first agent of a scenario, come to life."""
    plan = load_scenario(scenario).plan
    return Node(plan, plan.agents[0].name, [], lambda *_: None).agent


def attributes(thing: object) -> Iterator[object]:
    """What can be reached from a thing in one step: attributes, slots, elements, closures and bound objects."""
    yield from getattr(thing, "__dict__", {}).values()
    for kind in type(thing).__mro__:
        slots = kind.__dict__.get("__slots__", ())
        for slot in (slots,) if isinstance(slots, str) else slots:
            if hasattr(thing, slot):
                yield getattr(thing, slot)
    if isinstance(thing, dict):
        yield from (*thing.keys(), *thing.values())
    elif isinstance(thing, list | tuple | set | frozenset):
        yield from thing
    elif isinstance(thing, MethodType):
        yield from (thing.__self__, thing.__func__)
    elif isinstance(thing, FunctionType):
        yield from (cell.cell_contents for cell in thing.__closure__ or ())


def reachable(start: object) -> dict[int, Any]:
    """All that can be reached from a thing, classes and modules left out."""
    found: dict[int, Any] = {}
    waiting = [start]
    while waiting:
        thing = waiting.pop()
        if id(thing) not in found and not isinstance(thing, type):
            found[id(thing)] = thing
            waiting.extend(attributes(thing))
    return found


@pytest.mark.parametrize(
    "scenario", ["dfa4", "dfa-kalman", "tracker", "mav3-delay", "attitude3", "altitude-lossy", "mhe-lossy"]
)
def test_nothing_in_a_context_leads_to_the_truth(scenario: str) -> None:
    """Neither the plan nor its worlds nor what runs the agent can be reached, through private attributes either."""
    plan = load_scenario(scenario).plan
    worlds = tuple(type(world) for world in (plan.world, plan.coupled) if world is not None)
    assert worlds
    found = reachable(agent_of(scenario).context)
    assert [thing for thing in found.values() if isinstance(thing, (*FORBIDDEN, *worlds))] == []


@pytest.mark.parametrize("name", ["plan", "world", "truth", "node", "faults", "wire", "seed", "_node", "_plan"])
def test_a_context_has_nothing_more_to_ask_for(name: str) -> None:
    """An attempt at the plan, the world or the faults is an AttributeError."""
    with pytest.raises(AttributeError):
        getattr(agent_of("mav3-delay").context, name)


@pytest.mark.parametrize("name", ["world", "coupled", "faults", "distance_m"])
def test_a_public_plan_has_no_world_and_no_faults(name: str) -> None:
    """What a class works its briefings out from."""
    plan = load_scenario("dfa16-kill").plan
    assert hasattr(plan, name)
    assert not hasattr(plan.public, name)


def test_a_briefing_cannot_look_at_the_world() -> None:
    """An attempt to hand the truth to an agent before the start ends in a sentence that names it."""
    plan = load_scenario("dfa4").plan
    first, *others = plan.agents
    cheating = replace(plan, agents=(replace(first, kind=f"{__name__}:Cheating"), *others))
    with pytest.raises(
        RunFailed, match="agent 1 failed in briefing: AttributeError: 'PublicPlan' object has no attribute 'world'"
    ):
        Node(cheating, first.name, [], lambda *_: None)


@pytest.mark.parametrize("name", [name for name in dir(Context) if isinstance(getattr(Context, name), property)])
def test_what_a_context_tells_cannot_be_changed(name: str) -> None:
    """An agent cannot give itself other neighbours, or another time."""
    with pytest.raises(AttributeError):
        setattr(agent_of("dfa4").context, name, None)


def test_a_covariance_is_reported_beside_the_estimate() -> None:
    """Its upper triangle by rows, under the same index; a variance of one number is a matrix too."""
    context = agent_of("dfa4").context
    context.report("pose", [1.0, 2.0], 7, covariance=[[4.0, 1.0], [1.0, 9.0]])
    context.report("bias", 3.0, covariance=0.25)
    assert context._state.effects[-4:] == [
        Report("pose", 7, [1.0, 2.0]),
        Report("pose/covariance", 7, [4.0, 1.0, 9.0]),
        Report("bias", 0, [3.0]),
        Report("bias/covariance", 0, [0.25]),
    ]
    with pytest.raises(BadInput, match=r"report: covariance of pose has the shape \(1, 2\): give a square matrix"):
        context.report("pose", [1.0, 2.0], covariance=[1.0, 2.0])
