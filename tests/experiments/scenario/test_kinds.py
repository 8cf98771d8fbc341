"""Kinds of agents: one for all, and under `only` others for some."""

from __future__ import annotations

from volery.experiments.scenario.compile import compile_plan

from .conftest import Load, Refusal

ONLY = "\n  only:\n    - {where: [2], kind: beacon, rate: 40 Hz, compute: 3 ms}\n"


def test_some_agents_are_of_another_kind(load: Load) -> None:
    """Kind, parameters and compute time are those of the entry; the others keep those of all."""
    plan = compile_plan(load(replacing=("\n  rate: 20 Hz", "\n  rate: 20 Hz" + ONLY)))
    first, second, third = plan.agents
    assert [agent.kind for agent in plan.agents] == ["tiny_agents:Talker", "beacon", "tiny_agents:Talker"]
    assert second.parameters.rate == 40.0
    assert first.parameters.rate == third.parameters.rate == 20.0
    assert [agent.compute_ns for agent in plan.agents] == [1_000_000, 3_000_000, 1_000_000]


def test_a_later_entry_lies_on_top(load: Load) -> None:
    """The last entry that names an agent says what it is; groups name agents too."""
    text = ONLY + "    - {where: ends, kind: beacon, size: 7 B}\n    - {where: 3, kind: beacon, size: 9 B}\n"
    groups = "groups: {ends: [1, 3]}\nlinks:"
    plan = compile_plan(load(replacing=("\n  rate: 20 Hz\nlinks:", "\n  rate: 20 Hz" + text + groups)))
    assert [agent.parameters.size for agent in plan.agents] == [7, 20, 9]


def test_what_is_wrong_with_some_is_said_at_its_place(refusal: Refusal) -> None:
    """An agent that does not exist, an unknown parameter, an unknown kind."""
    after = "\n  rate: 20 Hz"
    stranger = refusal(replacing=(after, after + ONLY.replace("[2]", "[9]")))
    assert "agents.only.0.where: there is no agent '9'; agents: 1, 2, 3" in stranger
    unknown = refusal(replacing=(after, after + ONLY.replace("rate", "raet")))
    assert "agents.only.0.raet: unknown field (did you mean 'rate'?)" in unknown
    stray = refusal(replacing=(after, after + ONLY.replace("rate", "zzzzzz")))
    assert "unknown field (known: " in stray
    assert "None" not in stray
    kind = refusal(replacing=(after, after + ONLY.replace("beacon", "becon")))
    assert "agents.only.0.kind: unknown agent kind 'becon' (did you mean 'beacon'?)" in kind
