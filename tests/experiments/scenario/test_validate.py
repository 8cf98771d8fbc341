"""What a plan asks for, before it runs."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from volery.errors import BadInput
from volery.experiments.cli.scenario_tables import validation_table
from volery.experiments.scenario.compile import compile_plan
from volery.experiments.scenario.validate import validate_plan

from .conftest import Load

# 46 B payload and 4 B overhead at 10 bits a byte and 115.2 kbit/s: 500 / 115200 s
AIRTIME_NS = 4_340_278
FRAMES = 60.0


def test_a_tdma_direction_is_measured_against_its_own_slots(load: Load) -> None:
    """One frame fits a slot of 8.33 ms; 60 cycles a second carry just the 60 frames of three rounds at 20 Hz."""
    validation = validate_plan(compile_plan(load()))
    assert [row.medium for row in validation.rows] == ["1>2", "2>1", "2>3", "3>2"]
    assert {row.utilisation for row in validation.rows} == {1.0}
    assert {row.airtime_ns for row in validation.rows} == {AIRTIME_NS}
    assert validation.puts_per_second == 4 * FRAMES
    assert validation.largest_payload == 46


def test_directions_share_a_half_duplex_edge_and_not_a_full_duplex_one(load: Load) -> None:
    """Aloha counts the airtime of both ends on the edge, full duplex each direction on its own."""
    aloha = validate_plan(compile_plan(load("links.medium={kind: half-duplex, access: aloha}"))).rows
    assert [row.medium for row in aloha] == ["1-2", "2-3"]
    assert aloha[0].utilisation == pytest.approx(2 * FRAMES * AIRTIME_NS / 1e9)
    assert aloha[0].frames_per_second == 2 * FRAMES
    full = validate_plan(compile_plan(load("links.medium=full-duplex"))).rows
    assert [row.medium for row in full] == ["1>2", "2>1", "2>3", "3>2"]
    assert full[0].utilisation == pytest.approx(FRAMES * AIRTIME_NS / 1e9)


def test_slack_is_compute_shortest_airtime_and_shortest_latency(load: Load) -> None:
    """1 ms, 4 bytes at 86.8 µs, and 2 ms − 3 · 0.5 ms; the tightest link counts."""
    assert validate_plan(compile_plan(load())).slack_ns == 1_000_000 + 347_223 + 500_000
    tight = load("links.only=[{where: 1>2, latency: 0}]")
    assert validate_plan(compile_plan(tight)).slack_ns == 1_000_000 + 347_223


def test_too_much_airtime_is_an_error_unless_it_is_meant(load: Load) -> None:
    """Over 100 % names the media that are worst off; `overload` lets it pass."""
    plan = compile_plan(load("agents.rounds=4"))
    with pytest.raises(BadInput, match=r"above 100 % on 1>2 133%, 2>1 133%, 2>3 133%, 3>2 133%: send less"):
        validate_plan(plan)
    assert len(validate_plan(plan, overload=True).overloaded) == 4


def test_what_a_kind_does_not_tell_is_unknown(load: Load) -> None:
    """An agent that says nothing of its traffic has no utilisation, and none is invented."""
    kind = ("kind: tiny_agents:Talker\n  rate: 20 Hz", "kind: tiny_agents:Silent")
    validation = validate_plan(compile_plan(load(replacing=kind)))
    assert {row.utilisation for row in validation.rows} == {None}
    assert validation.puts_per_second is None
    assert validation.largest_payload is None


def test_the_table_has_a_row_per_medium_and_the_totals(load: Load) -> None:
    """It can be printed, and shows the numbers."""
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(validation_table(validate_plan(compile_plan(load()))))
    text = console.export_text()
    for words in ("1>2", "tdma", "4.340 ms", "100.0%", "240 puts/s", "largest payload 46 B", "slack 1.847 ms"):
        assert words in text


@pytest.mark.parametrize(
    ("edges", "said"),
    [
        ("{1-2: always, 2-3: [[0 s, 4 s], [6 s, 7 s], [9 s]]}", "is not connected for 4 s in 2 spans, the longest"),
        ("{1-2: always, 2-3: always, 1-3: [[2 s, 3 s]]}", "is connected all the time"),
        ("{1-2: [[0 s, 5 s]], 2-3: [[5 s]]}", "is not connected for 10 s in one span, from 0 s to 10 s"),
    ],
)
def test_a_graph_that_changes_is_told_apart(load: Load, edges: str, said: str) -> None:
    """When some agent cannot reach another, and λ₂ of the average, which is above zero all the same."""
    validation = validate_plan(compile_plan(load(f"topology.edges={edges}", "faults=[]")))
    assert validation.graph is not None
    assert said in str(validation.graph)
    assert validation.graph.mean_connectivity > 0.0
    console = Console(file=io.StringIO(), width=400)
    console.print(validation_table(validation))
    assert isinstance(console.file, io.StringIO)
    assert str(validation.graph) in " ".join(console.file.getvalue().split())


def test_of_a_graph_that_stays_nothing_is_said(load: Load) -> None:
    """There is no line for it."""
    assert validate_plan(compile_plan(load())).graph is None


def test_two_halves_that_take_turns_are_half_as_connected(load: Load) -> None:
    """Each edge is there for half of the time: λ₂ of the average is half that of the path of three, which is 1."""
    graph = validate_plan(compile_plan(load("topology.edges={1-2: [[0 s, 5 s]], 2-3: [[5 s]]}", "faults=[]"))).graph
    assert graph is not None
    assert (graph.instants, graph.apart) == (1, ((0, 10_000_000_000),))
    assert graph.mean_connectivity == pytest.approx(0.5)
    assert graph.union_connectivity == pytest.approx(1.0)
