"""Plans: what a scenario becomes for the engines."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from volery.agents.plan_codec import decode_plan, encode_plan
from volery.errors import BadInput
from volery.experiments.scenario.compile import compile_plan
from volery.experiments.scenario.consistency import settings_problems
from volery.topologies.over_time import GRAPHS
from volery.transport.faults import Kill, LinkFault
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings
from volery.transport.loss_settings import Bernoulli
from volery.transport.media_settings import HalfDuplex, Tdma
from volery.worlds.plane.plane_settings import PlaneSettings
from volery.worlds.signals import Constant as Always

from .conftest import Load, Refusal


def test_agents_come_in_natural_order_with_their_neighbourhood(load: Load) -> None:
    """2 stands before 10, and each agent knows the degrees of itself and its neighbours."""
    plan = compile_plan(load("topology.star=11", "faults=[]"))
    assert [agent.name for agent in plan.agents] == [str(number) for number in range(1, 12)]
    hub, leaf = plan.agents[0], plan.agents[9]
    assert hub.neighbours == tuple(str(number) for number in range(2, 12))
    assert leaf.degrees == {"1": 10, "10": 1}
    assert leaf.position is not None
    assert plan.links.keys() == {link for name in hub.neighbours for link in (("1", name), (name, "1"))}


def test_a_plan_can_be_encoded(load: Load) -> None:
    """It goes to other processes so."""
    plan = compile_plan(load("topology.hexagonal=4", "world={kind: plane, altitude: 0.2 m}"))
    assert decode_plan(encode_plan(plan)) == plan
    assert plan.world is not None
    assert plan.world.sensors("1") == {"distance": 20.0}


def test_later_overrides_of_links_lie_on_top(load: Load) -> None:
    """Each entry of `only` changes the links that it names, in one direction or both."""
    plan = compile_plan(load("links.only=[{where: 1, loss: 0.5}, {where: 2>1, loss: none, latency: 9 ms}]"))
    assert plan.links["1", "2"].loss == (Bernoulli(0.5),)
    assert (plan.links["2", "1"].loss, plan.links["2", "1"].latency) == ((), Constant(9_000_000))
    assert plan.links["2", "3"] == load().links.base


def test_an_entry_of_links_that_changes_nothing_is_refused(refusal: Refusal) -> None:
    """At its place, with an example of what could differ."""
    message = refusal("links.only=[{where: 1, loss: 0.5}, {where: 1-2}]")
    assert "links.only.1: says where, and nothing that differs there: write for example loss: 0.3" in message


def test_faults_get_ids_in_order_and_times(load: Load) -> None:
    """`for` is counted from `at`; a kill ends with a restart."""
    plan = compile_plan(load(replacing=("", "  - {at: 1 s, for: 2 s, kill: 3}\n")))
    cut, lossy, kill = plan.faults
    assert isinstance(cut, LinkFault)
    assert isinstance(lossy, LinkFault)
    assert (cut.id, cut.at_ns, cut.until_ns) == ("t1", 3_000_000_000, 4_000_000_000)
    assert (cut.links, cut.changes) == ((("1", "2"), ("2", "1")), {"cut": True})
    assert (lossy.until_ns, len(lossy.links)) == (7_000_000_000, 4)
    assert kill == Kill("t3", 1_000_000_000, 3_000_000_000, "3")


def test_parts_that_do_not_fit_are_refused_without_a_file_too(load: Load) -> None:
    """A scenario made in Python meets the same checks."""
    scenario = load()
    wrong = replace(scenario, topology=GRAPHS.find("complete")(count=3), world=PlaneSettings(Always(0.2)))
    with pytest.raises(BadInput, match=r"^world: agents of topology complete have no positions"):
        compile_plan(wrong)
    with pytest.raises(BadInput, match=r"^topology.line: count is 1"):
        compile_plan(replace(scenario, topology=GRAPHS.find("line")(count=1)))


@pytest.mark.parametrize(
    ("settings", "payload", "compute_ns", "fields"),
    [
        (LinkSettings(), 1500, 1, []),
        (LinkSettings(), 1501, 1, ["mtu"]),
        (LinkSettings(), None, 1, []),
        (LinkSettings(), 1, 0, ["latency"]),
        (LinkSettings(latency=Constant(1)), 1, 0, []),
        (LinkSettings(rate=1e6, overhead=1), 1, 0, []),
        (LinkSettings(medium=HalfDuplex("edge", Tdma(50.0)), rate=8000.0), 9, 1, []),
        (LinkSettings(medium=HalfDuplex("edge", Tdma(50.0)), rate=8000.0), 10, 1, ["medium"]),
        (LinkSettings(medium=HalfDuplex("edge", Tdma(50.0, 2_000_000)), rate=8000.0), 8, 1, ["medium"]),
    ],
)
def test_a_frame_must_fit_its_link(
    settings: LinkSettings, payload: int | None, compute_ns: int, fields: list[str]
) -> None:
    """MTU and slot are bounds that may be met but not passed.

    At 8 kbit/s a byte takes 1 ms; of two slots in 20 ms each is 10 ms, less 1 ns, less the guard.
    """
    assert [field for field, _ in settings_problems(settings, payload, compute_ns)] == fields


MOVING = "world={kind: moving, paths: {1: {0 s: [0, 0]}, 2: {0 s: [9, 0]}, 3: {0 s: [9, 5], 10 s: [9, 25]}}}"


def test_a_schedule_becomes_the_spans_of_its_links(load: Load) -> None:
    """Links are those of all graphs, and both directions of an edge are there at the same times."""
    plan = compile_plan(load("topology={schedule: [{from: 0 s, line: 3}, {from: 4 s, ring: 3}]}", "faults=[]"))
    assert len(plan.links) == 6
    assert plan.presence == dict.fromkeys((("1", "3"), ("3", "1")), ((4_000_000_000, 10_000_000_000),))
    assert plan.agents[0].neighbours == ("2", "3")
    assert plan.agents[0].position is not None


def test_agents_that_move_are_neighbours_while_they_are_near(load: Load) -> None:
    """Agent 3 goes away from 2 at 2 m/s, from 5 m: it is beyond 10 m at the first look after 2.5 s."""
    plan = compile_plan(load("topology={proximity: {radius: 10 m, every: 200 ms}}", MOVING, "faults=[]"))
    assert plan.presence == dict.fromkeys((("2", "3"), ("3", "2")), ((0, 2_600_000_000),))
    assert plan.distance_m("2", "3", 5_000_000_000) == 15.0
    assert [agent.position for agent in plan.agents] == [None, None, None]
    assert decode_plan(encode_plan(plan)) == plan


def test_a_world_may_move_the_agents_of_any_topology(load: Load) -> None:
    """The graph stays, its positions give way to the world's; other agents than the topology's are refused."""
    plan = compile_plan(load("topology={complete: 3}", MOVING))
    assert (plan.presence, plan.distance_m("1", "2", 0)) == ({}, 9.0)
    scenario = load()
    wrong = replace(scenario, topology=GRAPHS.find("line")(count=4), world=load(MOVING).world)
    with pytest.raises(BadInput, match=r"^world.paths: it moves agents 1, 2, 3, the topology has 1, 2, 3, 4"):
        compile_plan(wrong)


def test_a_file_in_a_schedule_is_found_beside_the_scenario(load: Load, tmp_path: Path) -> None:
    """As that of a graph that does not change."""
    (tmp_path / "pairs.edges").write_text("1 2\n2 3\n1 3\n", "utf-8")
    schedule = ("topology: {line: 3}", "topology: {schedule: [{from: 0 s, file: pairs.edges}, {from: 1 s, line: 3}]}")
    assert compile_plan(load(replacing=schedule)).presence.keys() == {("1", "3"), ("3", "1")}
