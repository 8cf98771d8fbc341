"""Graphs of a user's own in scenarios: functions, classes, and files whose edges say what their links are."""

from __future__ import annotations

import importlib
import json
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest
from ruamel.yaml import YAML

from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.scenario.load import load_scenario, resolved_yaml
from volery.experiments.sweeps.sweep_plan import plan_sweep
from volery.kinds import _added
from volery.transport.latency_settings import Constant, Normal
from volery.transport.loss_settings import Bernoulli

MODULE = '''
"""Graphs for the tests."""

import random
from dataclasses import dataclass

import networkx as nx

from volery.topologies import GraphSettings, TimedGraph, ring
from volery.units import Metres, Nanoseconds


def ladder(rungs: int, gap: Metres = 1.0, delay: Nanoseconds = 2_000_000, sides=[0, 1]):
    """A ladder.

    Args:
        rungs: number of rungs.
    """
    graph = nx.ladder_graph(rungs)
    for node, data in graph.nodes(data=True):
        data["pos"] = gap * (node % rungs), gap * (node // rungs)
    nx.set_edge_attributes(graph, f"{delay} ns", "latency")
    return graph


def drawn(count, seed):
    return nx.path_graph([*range(count), 1000 + seed % 1000])


def odd(count: int):
    return nx.random_regular_graph(3, count)


def with_rng(count: int, rng: random.Random):
    return nx.path_graph(count)


def listed(count: int):
    return list(range(count))


@dataclass(frozen=True)
class Blinking(GraphSettings):
    """A ring that is there in the first second."""

    count: int

    def build(self, seed: int) -> nx.Graph:
        return ring(self.count)

    def over_time(self, seed, until_ns, places=None):
        graph = self.topology(seed)
        return TimedGraph(graph, {("1", "2"): ((0, 10**9),)})
'''
SCENARIO = """\
duration: 3 s
seed: 5
topology: {topology}
agents: {{kind: tiny_agents:Talker}}
links: {{latency: 1 ms, only: [{{where: all, {only}}}]}}
"""
MS = 1_000_000


@pytest.fixture(autouse=True)
def _my_top(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_top.py").write_text(MODULE, "utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(__import__("sys").modules, "my_top", raising=False)


def plan_of(folder: Path, topology: str, *overrides: str, only: str = "duplication: 0.1") -> Plan:
    """The plan of a scenario with this topology; its resolved form gives the same."""
    path = folder / "s.yaml"
    path.write_text(SCENARIO.format(topology=topology, only=only), "utf-8")
    loaded = load_scenario(path, overrides)
    path.write_text(resolved_yaml(loaded.scenario), "utf-8")
    again = load_scenario(path)
    assert again.scenario == loaded.scenario
    assert (again.plan.agents, again.plan.links) == (loaded.plan.agents, loaded.plan.links)
    return loaded.plan


def refusal(folder: Path, topology: str, **fields: str) -> str:
    """Why it is refused, without the folder."""
    with pytest.raises(BadInput) as caught:
        plan_of(folder, topology, **fields)
    return str(caught.value).replace(f"{folder}/", "")


def test_a_function_makes_the_graph(tmp_path: Path) -> None:
    """Its parameters are fields with units; positions and settings of links come from its nodes and edges."""
    plan = plan_of(tmp_path, "{kind: my_top:ladder, rungs: 2, gap: 50 cm}")
    assert [agent.position for agent in plan.agents] == [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)]
    assert {settings.latency for settings in plan.links.values()} == {Constant(2 * MS)}
    wider = plan_of(tmp_path, "{kind: my_top:ladder, rungs: 2}", "topology.rungs=3", "topology.delay=4 ms")
    assert len(wider.agents) == 6
    assert wider.links["0", "1"].latency == Constant(4 * MS)
    assert len(plan_of(tmp_path, "networkx:petersen_graph").agents) == 10


def test_a_function_is_given_the_seed(tmp_path: Path) -> None:
    """One that follows from the run's and the function's name, or the one that is written."""
    first, again, other, written = (
        plan_of(tmp_path, f"{{kind: my_top:drawn, count: 2{seed}}}", *overrides).agents[-1].name
        for seed, overrides in (("", []), ("", []), ("", ["seed=6"]), (", seed: 7", ["seed=6"]))
    )
    assert first == again != other
    assert written == "1007"


def test_a_generator_of_networkx_is_one(tmp_path: Path) -> None:
    """Nothing else need be written for it."""
    plan = plan_of(tmp_path, "{kind: networkx:random_regular_graph, d: 3, n: 8}")
    assert {len(agent.neighbours) for agent in plan.agents} == {3}
    assert len(plan.agents) == 8


def test_a_class_may_change_its_graph_over_time(tmp_path: Path) -> None:
    """It says which edges there are when."""
    plan = plan_of(tmp_path, "{kind: my_top:Blinking, count: 4}")
    assert plan.presence == {("1", "2"): ((0, 10**9),), ("2", "1"): ((0, 10**9),)}


@pytest.mark.parametrize(
    ("topology", "message"),
    [
        ("{kind: my_top:ladder, rugs: 3}", "s.yaml:3:33: topology.rugs: unknown field (did you mean 'rungs'?)"),
        ("{kind: my_top:ladder, rungs: 3, gap: 5 s}", "s.yaml:3:48: topology.gap: '5 s' is not a quantity here: "),
        ("{kind: my_top:ladre}", "s.yaml:3:18: topology.kind: kind 'my_top:ladre' cannot be loaded: module 'my_top'"),
        ("{my_top:ladder: 3}", "topology.my_top:ladder: write kind: my_top:ladder, and its parameters beside"),
        ("{kind: line, count: 3}", "topology.kind: kind is for code of your own: write line itself, as in {line: …}"),
        ("{kind: my_top:odd, count: 3}", "my_top:odd failed in line 31 of my_top.py: NetworkXError: n * d must be"),
        ("{kind: my_top:with_rng, count: 3, rng: 1}", "has a parameter of type <class 'random.Random'>: a scenario"),
        ("{kind: my_top:listed, count: 3}", "my_top:listed returned [0, 1, 2]: return a networkx graph"),
        ("{kind: networkx:star_graph, n: 0}", "a topology of 1 agents is not a network"),
        ("{kind: networkx:grid_2d_graph, m: 3, n: 2}", "(0, 0) cannot be an agent's name: "),
        ("{kind: 'my_top:GraphSettings'}", "s.yaml:3:11: "),
    ],
)
def test_what_a_function_cannot_do_is_refused(tmp_path: Path, topology: str, message: str) -> None:
    """At its place, by its name, with the line of the user's module."""
    assert message in refusal(tmp_path, topology)


def test_edges_of_a_file_are_settings_of_links(tmp_path: Path) -> None:
    """They change what `links:` says of all, and `links: only:` changes them; in GraphML text is read as YAML."""
    graph = nx.Graph()
    graph.add_edge("1", "2", latency="50 ms", loss=0.5)
    graph.add_edge("2", "3", latency="{normal: {mean: 5 ms, sd: 1 ms}}", medium="half-duplex")
    graph.add_edge("3", "4", preset="irda-115k")
    nx.write_graphml(graph, tmp_path / "net.graphml")
    plan = plan_of(tmp_path, "{file: net.graphml}")
    one, two, three = plan.links["1", "2"], plan.links["2", "3"], plan.links["3", "4"]
    assert (one.latency, one.loss, one.duplication) == (Constant(50 * MS), (Bernoulli(0.5),), 0.1)
    assert plan.links["2", "1"] == one
    assert two.latency == Normal(5 * MS, 1 * MS)
    assert three.rate == 115_200.0
    assert plan_of(tmp_path, "{file: net.graphml}", only="loss: none").links["1", "2"].loss == ()


def test_directions_and_parallel_edges(tmp_path: Path) -> None:
    """A directed file sets each direction; the settings of edges that are joined are put together."""
    links = [
        {"source": 1, "target": 2, "latency": "5 ms"}, {"source": 2, "target": 1, "latency": "7 ms"},
        {"source": 2, "target": 3, "rate": "1 Mbit/s"}, {"source": 2, "target": 3, "loss": {"bernoulli": 0.2}},
        {"source": 3, "target": 2, "latency": "0.005 s"}, {"source": 3, "target": 2, "latency": "5 ms"},
    ]  # fmt: skip
    text = {"directed": True, "nodes": [{"id": name} for name in (1, 2, 3)], "links": links}
    (tmp_path / "net.json").write_text(json.dumps(text), "utf-8")
    plan = plan_of(tmp_path, "{file: net.json, merge: true}")
    assert plan.links["1", "2"].latency == Constant(5 * MS)
    assert plan.links["2", "1"].latency == Constant(7 * MS)
    assert (plan.links["2", "3"].rate, plan.links["2", "3"].loss) == (1e6, (Bernoulli(0.2),))
    assert plan.links["3", "2"].latency == Constant(5 * MS)


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"delay": 5}, "net.json: the edge 1-2 has the attribute 'delay', no setting of links"),
        (
            {"weight": 1, "colour": "red"},
            "name it under the file's `attributes:` or `ignore:` (all such: colour, weight)",
        ),
        (
            {"latency": 50},
            "net.json: the edge 1-2: latency: 50 has no unit: write it with one of ns",
        ),
        ({"latency": "50"}, "net.json: the edge 1-2: latency: "),
        ({"rate": 5e6}, "the edge 1-2: rate: 5000000.0 has no unit: write it with one of bit/s"),
        ({"loss": 1.5}, "the edge 1-2: loss: loss probability is 1.5"),
        ({"loss": {"bernouli": 0.5}}, "loss: unknown loss model 'bernouli' (did you mean 'bernoulli'?)"),
        ({"where": "all"}, "the edge 1-2 has the attribute 'where', no setting of links"),
        ({"queue": "{limit"}, "the edge 1-2: queue:1:"),
    ],
)
def test_what_edges_cannot_say_is_refused(tmp_path: Path, attributes: dict[str, Any], message: str) -> None:
    """With the file, the edge and the remedy; nothing is dropped in silence."""
    (tmp_path / "net.json").write_text(json.dumps({"edges": [[1, 2, attributes], [2, 3]]}), "utf-8")
    assert message in refusal(tmp_path, "{file: net.json}")


def test_joined_edges_that_differ_are_refused(tmp_path: Path) -> None:
    """Which of them would count is not for volery to say; a medium for one direction only is none."""
    (tmp_path / "net.json").write_text('{"edges": [[1, 2, {"loss": 0.1}], [1, 2, {"loss": 0.2}]]}', "utf-8")
    assert "net.json: edges 1-2 that are joined differ in loss" in refusal(tmp_path, "{file: net.json, merge: true}")
    graph = nx.DiGraph([("1", "2", {"medium": "half-duplex"}), ("2", "1", {})])
    nx.write_graphml(graph, tmp_path / "net.graphml")
    assert "an edge has one medium, 1>2 is half of one" in refusal(tmp_path, "{file: net.graphml}")


def test_attributes_have_other_names(tmp_path: Path) -> None:
    """A mapping gives the setting and the unit of plain numbers; others are ignored by name."""
    (tmp_path / "net.json").write_text('{"edges": [[1, 2, {"delay": 5, "speed": 2.5, "colour": "red"}]]}', "utf-8")
    mapped = "{file: net.json, attributes: {delay: latency ms, speed: rate Mbit/s}, ignore: colour}"
    settings = plan_of(tmp_path, mapped).links["1", "2"]
    assert (settings.latency, settings.rate) == (Constant(5 * MS), 2.5e6)


def test_graphs_of_a_schedule_set_links_too(tmp_path: Path) -> None:
    """A link has one set of settings for the whole run: graphs that differ are refused."""
    for name, latency in (("a", "5 ms"), ("b", "5 ms"), ("c", "6 ms")):
        text = json.dumps({"edges": [[1, 2, {"latency": latency}], [2, 3]]})
        (tmp_path / f"{name}.json").write_text(text, "utf-8")
    schedule = "{{schedule: [{{from: 0 s, file: a.json}}, {{from: 1 s, file: {}.json}}]}}"
    assert plan_of(tmp_path, schedule.format("b")).links["1", "2"].latency == Constant(5 * MS)
    assert "edges 1-2 that are joined differ in latency" in refusal(tmp_path, schedule.format("c"))


def test_graphs_of_a_schedule_are_of_any_kind(tmp_path: Path) -> None:
    """A function's too, with its parameters beside the instant."""
    plan = plan_of(
        tmp_path, "{schedule: [{from: 0 s, edges: [0-1, 1-2]}, {from: 1 s, kind: my_top:drawn, count: 3, seed: 0}]}"
    )
    assert [agent.name for agent in plan.agents] == ["0", "1", "2", "1000"]


def test_an_installed_package_declares_kinds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are named as the built-in ones, with the first parameter as the value."""
    found = [EntryPoint("ladder", "my_top:ladder", "volery.topologies")]
    monkeypatch.setattr("volery.kinds.entry_points", lambda group: found if group == "volery.topologies" else [])
    _added.cache_clear()
    try:
        assert len(plan_of(tmp_path, "{ladder: 3, gap: 2 m}").agents) == 6
    finally:
        _added.cache_clear()


def test_a_sweep_knows_its_graphs(tmp_path: Path) -> None:
    """Results with another file are results of another sweep."""
    path = tmp_path / "net.edges"
    made = []
    for edges in ("1 2\n2 3\n", "1 2\n2 3\n3 1\n"):
        path.write_text(edges)
        made.append(plan_sweep({**FIELDS, "topology": {"file": str(path)}}).made_with["files"])
    assert made[0] != made[1]


def test_edges_have_positions(tmp_path: Path) -> None:
    """Those that are written beside them, in metres."""
    plan = plan_of(tmp_path, "{edges: [a-b, b-c], positions: {a: [0 m, 0 m], b: [1 m, 0 m], c: [1, 50 cm]}}")
    assert [agent.position for agent in plan.agents] == [(0.0, 0.0), (1.0, 0.0), (1.0, 0.5)]


FIELDS = {
    "duration": "3 s",
    "agents": {"kind": "beacon"},
    "links": {"latency": "1 ms", "only": [{"where": "1-2", "loss": 0.2}]},
}


def test_an_object_is_data_in_the_resolved_scenario() -> None:
    """Edges, positions and what edges say of links, before the scenario's own entries; read back it is equal."""
    graph = nx.Graph()
    graph.add_edge(1, 2, latency="5 ms", loss=np.float64(0.5))
    graph.add_edge(2, 3, latency="5 ms")
    nx.set_node_attributes(graph, {1: np.array([0.0, 0.1]), 2: (1, 0), 3: (2, 0)}, "pos")
    for scenario, given in ((FIELDS, {"topology": graph}), ({**FIELDS, "topology": graph}, {})):
        loaded = load_scenario(scenario, ("duration=2 s",), given)
        links = loaded.plan.links
        assert links["2", "1"].latency == links["2", "3"].latency == Constant(5 * MS)
        assert (links["1", "2"].loss, links["2", "3"].loss) == ((Bernoulli(0.2),), ())
        assert loaded.plan.agents[0].position == (0.0, 0.1)
        again = load_scenario(YAML(typ="safe").load(resolved_yaml(loaded.scenario)))
        assert again.scenario == loaded.scenario
        assert again.plan.links == links
    assert "latency" in graph.edges[1, 2]


@pytest.mark.parametrize(
    ("graph", "message"),
    [
        (
            nx.grid_2d_graph(2, 2),
            "topology: (0, 0) cannot be an agent's name: .* networkx.relabel_nodes renames agents",
        ),
        (nx.MultiGraph([(1, 2), (1, 2)]), "topology: the edge 1-2 is there more than once: .* networkx.Graph"),
        (nx.DiGraph([(1, 2)]), "topology: 1>2 has no 2>1, and links go both ways: .* graph.to_undirected"),
        (nx.Graph([(1, 2), (3, 4)]), "topology: the topology is not connected, .* networkx.connected_components"),
        (nx.Graph([(1, 2, {"weight": 3})]), "topology: the edge 1-2 has the attribute 'weight', no setting of links"),
        (nx.Graph([(1, 2, {"latency": object()})]), "topology: the edge 1-2: latency: <object object at"),
    ],
)
def test_objects_that_are_no_topology_are_refused(graph: nx.Graph, message: str) -> None:
    """With what networkx has for it."""
    with pytest.raises(BadInput, match=message.replace("(0, 0)", r"\(0, 0\)")):
        load_scenario(FIELDS, (), {"topology": graph})


def test_an_override_cannot_change_an_object() -> None:
    """It would have no effect, or one on half of it."""
    with pytest.raises(BadInput, match=r"--set topology\.ring: topology is a networkx graph here: change that"):
        load_scenario(FIELDS, ("topology.ring=4",), {"topology": nx.path_graph([1, 2, 3])})


def test_a_scenario_in_python_takes_the_function_itself() -> None:
    """As it takes classes of agents."""
    my_top = importlib.import_module("my_top")
    plan = load_scenario({**FIELDS, "links": {}}, (), {"topology": {"kind": my_top.ladder, "rungs": 2}}).plan
    assert len(plan.agents) == 4
