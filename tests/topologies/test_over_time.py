"""The `topology:` mapping of graphs that change."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from volery import topologies
from volery.errors import BadInput
from volery.topologies.over_time import Proximity

from ..surroundings import build_graph, build_over_time, edges_at

S = 1_000_000_000
END = 10 * S


def test_a_schedule_of_graphs() -> None:
    """Edges that both graphs have stay; the others go or come when the second begins."""
    graph = build_over_time({"schedule": [{"from": "0 s", "ring": 4}, {"from": "4 s", "line": 4}]}, 1, END)
    assert topologies.edges(graph.union) == [("1", "2"), ("1", "4"), ("2", "3"), ("3", "4")]
    assert graph.presence == {("1", "4"): ((0, 4 * S),)}
    assert topologies.positions(graph.union) == topologies.positions(topologies.ring(4))
    assert topologies.disconnected(graph, END) == ()


def test_a_schedule_of_edges_need_not_be_connected_at_an_instant() -> None:
    """Two halves, then a bridge; positions of a first epoch of edges are none."""
    spec = {
        "schedule": [
            {"from": 0, "edges": ["1-2", "3-4"]},
            {"from": "2 s", "edges": ["3-2"]},
            {"from": "3 s", "line": 4},
        ]
    }
    graph = build_over_time(spec, 1, END)
    assert graph.presence[("2", "3")] == ((2 * S, END),)
    assert graph.presence[("1", "2")] == graph.presence[("3", "4")] == ((0, 2 * S), (3 * S, END))
    assert topologies.positions(graph.union) == {}
    assert topologies.disconnected(graph, END) == ((0, 3 * S),)


def test_random_graphs_of_a_schedule_use_the_seed_of_the_run() -> None:
    """Unless they have one of their own."""
    kind = {"erdos-renyi": {"count": 8, "probability": 0.4}}
    own = {"erdos-renyi": {"count": 8, "probability": 0.4, "seed": 5}}
    graph = build_over_time({"schedule": [{"from": "0 s", **kind}, {"from": "5 s", **own}]}, 9, END)
    assert edges_at(graph, 0) == topologies.edges(build_graph(kind, 9))
    assert edges_at(graph, 5 * S) == topologies.edges(build_graph(own, 9))


def test_spans_of_edges() -> None:
    """`always`, several spans in any order, and one without an end."""
    spec = {"edges": {"1-2": "always", "3-2": [["6 s", "8 s"], ["0 s", "2 s"], ["9 s"]], "a-1": [["0 s", "99 s"]]}}
    graph = build_over_time(spec, 1, END)
    assert graph.presence == {("2", "3"): ((0, 2 * S), (6 * S, 8 * S), (9 * S, END))}
    assert edges_at(graph, 3 * S) == [("1", "2"), ("1", "a")]


def test_edges_that_never_go() -> None:
    """A list of edges is a graph as any other."""
    assert topologies.edges(build_graph({"edges": ["2-1", "2-3"]}, 1)) == [("1", "2"), ("2", "3")]


def to_and_fro(time_ns: int) -> dict[str, NDArray[np.float64]]:
    """Agent 2 stands 10 m from 1, agent 3 goes away from it at 1 m/s, from 5 m, and comes back from 15 m on."""
    distance = 15.0 - abs(10.0 - time_ns / S)
    return {"1": np.array([0.0, 0.0]), "2": np.array([0.0, 10.0]), "3": np.array([distance, 0.0])}


@pytest.mark.parametrize(("hysteresis", "gone_s", "back_s"), [(0.0, 4.25, 16.0), (2.0, 6.25, 16.0), (6.0, 0.0, None)])
def test_two_are_near_up_to_the_radius_and_stay_so_up_to_the_hysteresis(
    hysteresis: float, gone_s: float, back_s: float | None
) -> None:
    """Looked at four times a second: an edge goes at the first look beyond, and comes at the first look within."""
    spans = Proximity(9.0, S // 4, hysteresis).near(to_and_fro, 20 * S)[1]
    if back_s is None:
        assert spans == {("1", "3"): [(0, 20 * S)]}
    else:
        assert spans == {("1", "3"): [(0, round(gone_s * S)), (round(back_s * S), 20 * S)]}


def test_agents_that_move_are_linked_where_they_are_near() -> None:
    """Agents 1 and 2 always, 3 while it is near; a plain value is the radius."""
    graph = build_over_time({"proximity": {"radius": "10 m", "every": "1 s"}}, 1, 20 * S, to_and_fro)
    assert topologies.edges(graph.union) == [("1", "2"), ("1", "3")]
    assert graph.presence == {("1", "3"): ((0, 6 * S), (15 * S, 20 * S))}
    assert build_over_time({"proximity": "10 m"}, 1, 20 * S, to_and_fro).presence == {
        ("1", "3"): ((0, 5_100_000_000), (15 * S, 20 * S))
    }


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({"schedule": []}, r"topology.schedule: write a list"),
        ({"schedule": [{"ring": 4}]}, "topology.schedule.0.from: is missing"),
        ({"schedule": [{"from": "1 s", "ring": 4}]}, r"topology.schedule.0.from: the first graph begins at 0 s"),
        (
            {"schedule": [{"from": 0, "ring": 4}, {"from": 5, "line": 4}]},
            "topology.schedule.1.from: 5 has no unit: write it with one of ns, us, µs, ms, s, min, h",
        ),
        ({"schedule": [{"from": 0, "ring": 4}, {"from": "10 s", "line": 4}]}, r"schedule.1.from: 10 s is not within"),
        ({"schedule": [{"from": 0, "ring": 4}, {"from": "0 s", "line": 4}]}, r"schedule.1.from: begins must ascend"),
        ({"schedule": [{"from": 0, "ring": 4}, {"from": "1 s", "line": 5}]}, r"schedule.0: agents 5 of other epochs"),
        ({"schedule": [{"from": 0, "ring": 2}]}, r"topology.schedule.0.ring: count is 2"),
        (
            {"schedule": [{"from": 0, "rnig": 4}]},
            r"topology.schedule.0.rnig: unknown kind 'rnig' \(did you mean 'ring'\?\)",
        ),
        (
            {"schedule": [{"from": 0, "schedule": []}]},
            r"topology.schedule.0.schedule: unknown kind 'schedule' \(known: cells, complete, edges, erdo",
        ),
        ({"schedule": [{"from": 0, "edges": ["12"]}]}, r"topology.schedule.0.edges: '12' is not an edge"),
        ({"schedule": [{"from": 0, "edges": "1-2"}]}, "topology.schedule.0.edges: should be a list, not '1-2'"),
        ({"schedule": [{"from": 0, "edges": ["1-2", "3-4"]}]}, r"schedule: over the whole run, .* not connected"),
        ({"schedule": [{"from": 0, "ring": 4}], "spacing": 1}, r"topology.spacing: unknown field \(known: schedule\)"),
        ({"edges": {"1-2": []}}, r"topology.edges.1-2: no spans: write always, or as in \[\[0 s, 2 s\], \[5 s\]\]"),
        ({"edges": {"1-2": "sometimes"}}, "topology.edges.1-2: 'sometimes' is none of always"),
        (
            {"edges": {"1-2": [["1 s", "2 s", "3 s"]]}},
            r"topology.edges.1-2.0: should have at most 2 items, not \['1 s', '2 s', '3 s'\]",
        ),
        ({"edges": {"1-2": [["2 s", "1 s"]]}}, r"the span from 2 s ends at 1 s"),
        ({"edges": {"1-2": [["10 s"]]}}, "topology.edges.1-2.0: 10 s is not within the run, which lasts 10 s"),
        ({"edges": {"1-2": [["-1 s"]]}}, r"-1 s is not within"),
        ({"edges": {"1-2": [["0 s", "3 s"], ["2 s"]]}}, r"the spans from 0 s and 2 s overlap"),
        (
            {"edges": {"1-2": "always", "2-1": "always"}},
            "topology.edges.2-1: '2-1' is written twice: keep one, it carries both directions",
        ),
        ({"edges": {"1>2": "always"}}, r"topology.edges: '1>2' is not an edge"),
        ({"edges": {"1-2": "always", "1-1": "always"}}, r"agent 1 has an edge to itself"),
        ({"proximity": {"radius": "5 m"}}, r"topology.proximity: over the whole run, .* no path from 1 to 2"),
        ({"proximity": {"radius": "0 m"}}, "topology.proximity: radius is 0 m, it must be above 0 and finite"),
        ({"proximity": {"radius": 5}}, r"topology.proximity.radius: 5 has no unit"),
        (
            {"proximity": {"radius": "5 m", "hysteresis": "-1 m"}},
            "topology.proximity: hysteresis is -1 m, it must be at least 0",
        ),
        ({"proximity": {"radius": "5 m", "every": "1 us"}}, r"topology.proximity.every: .* more than a million"),
        ({"proximity": {"radius": "5 m", "every": 0}}, "topology.proximity.every: every is 0 ns, it must be above 0"),
        ({"proximity": {"every": "1 s"}}, "topology.proximity.radius: is missing"),
        (
            {"proximity": {"radius": "5 m", "range": 1}},
            r"topology.proximity.range: unknown field \(known: every, hysteresis, radius\)",
        ),
    ],
)
def test_what_is_wrong_is_named_with_its_place_and_remedy(spec: dict[str, Any], message: str) -> None:
    """Times, spans, agents, names."""
    with pytest.raises(BadInput, match=message):
        build_over_time(spec, 1, END, to_and_fro)


def test_proximity_needs_agents_that_move() -> None:
    """The remedy is a world in which they do."""
    with pytest.raises(BadInput, match=r"topology.proximity: nobody moves: add a world"):
        build_over_time({"proximity": "30 m"}, 1, END)
