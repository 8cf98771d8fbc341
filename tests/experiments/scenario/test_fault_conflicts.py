"""Faults that contradict each other or change nothing, in the timeline: refused, or said by `ineffective_faults`."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from volery.errors import BadInput
from volery.experiments.cli.scenario_tables import validation_table
from volery.experiments.scenario.compile import compile_plan
from volery.experiments.scenario.fault_conflicts import ineffective_faults
from volery.experiments.scenario.validate import validate_plan
from volery.transport.faults import SensorFault

from .conftest import Load, Refusal


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (["at: 3.5 s, cut: 1-2"], "faults.2.cut: already cut: 1>2, 2>1; nothing would change"),
        (["at: 1 s, hold: 1-2", "at: 2 s, hold: 1>2"], "faults.3.hold: already held: 1>2"),
        (["at: 1 s, where: all, set: {overhead: 4 B}"], "faults.2.set: already so, overhead unchanged: 1>2"),
        (["at: 6 s, where: 1-2, set: {loss: 0.1}"], "faults.2.set: loss of 1>2, 2>1 becomes something else by t2"),
        (["at: 1 s, kill: 2", "at: 2 s, kill: [1, 2]"], "faults.3.kill: agent 2 is down then already, by fault t3"),
        (["at: 1 s, for: 2 s, kill: 2", "at: 2 s, for: 1 s, pause: 2"], "faults.3.pause: agent 2 is down then already"),
        (["at: 1 s, kill: 2", "at: 2 s, clock: 2, offset: 1 ms"], "faults.3.clock: agent 2 is down then already"),
        (["at: 1 s, pause: 2", "at: 2 s, pause: all"], "faults.3.pause: agent 2 is paused already, by fault t3"),
        (["at: 1 s, hog: 2", "at: 2 s, hog: 2, share: 0.5"], "faults.3.hog: agent 2 is hogged already, by fault t3"),
        (
            ["at: 1 s, where: all, set: {medium: {kind: half-duplex, per: node}}"],
            "faults.2.set: a fault cannot move 1>2, 2>1, 2>3 and 1 more between transceivers of edges and radios",
        ),
        (
            ["every: {mtbf: 2 s, mttr: 3 s}, kill: 2", "every: {mtbf: 2 s, mttr: 3 s}, kill: 2"],
            "agent 2 is down then already, by fault t3",
        ),
    ],
)
def test_contradictions_are_refused(refusal: Refusal, fields: list[str], message: str) -> None:
    """The later one of two is named with its place, and the one that it contradicts."""
    assert message in refusal(replacing=("", "".join(f"  - {{{field}}}\n" for field in fields)))


@pytest.mark.parametrize(
    "fields",
    [
        ["at: 4 s, cut: 1-2"],
        ["at: 3 s, cut: all"],
        ["at: 6 s, where: all, set: {duplication: 0.1}"],
        ["at: 1 s, for: 1 s, kill: 2", "at: 2 s, for: 1 s, kill: 2"],
        ["at: 1 s, for: 2 s, kill: 2", "at: 2 s, for: 3 s, pause: 2"],
        ["at: 1 s, pause: 2", "at: 2 s, kill: 2"],
        ["at: 1 s, clock: 2, offset: 1 ms", "at: 1 s, clock: 2, drift: 10 ppm"],
    ],
)
def test_what_only_meets_is_allowed(load: Load, fields: list[str]) -> None:
    """Ends are half-open, other links or fields are free, and what outlasts a death counts afterwards."""
    compile_plan(load(replacing=("", "".join(f"  - {{{field}}}\n" for field in fields))))


def test_random_faults_may_be_without_effect(load: Load) -> None:
    """A drawn failure of a link that is cut already is allowed, and noted."""
    scenario = load(replacing=("", "  - {every: {mtbf: 0.1 s, mttr: 50 ms}, from: 3 s, until: 4 s, cut: 1-2}\n"))
    (note,) = ineffective_faults(compile_plan(scenario))
    assert note.startswith("fault t3.1: already cut: 1>2, 2>1")


def test_faults_of_links_that_carry_nothing_are_told(load: Load) -> None:
    """A silent source, or an edge that is not there meanwhile; what carries frames is not named."""
    silent = load("agents={kind: beacon, talkers: [1]}", "links={latency: 1 ms}", "faults.1.where=2>1")
    assert list(ineffective_faults(compile_plan(silent))) == [
        "fault t1: 2>1 carries nothing: 2 never sends",
        "fault t2: 2>1 carries nothing: 2 never sends",
    ]
    edges = "topology={edges: {1-2: [[0 s, 3 s]], 2-3: always}}"
    absent = load("agents={kind: beacon}", "links={latency: 1 ms}", edges)
    assert list(ineffective_faults(compile_plan(absent))) == [
        "fault t1: 1>2, 2>1 carry nothing: the graph has no such edge then",
        "fault t2: 1>2, 2>1 carry nothing: the graph has no such edge then",
    ]
    assert list(ineffective_faults(compile_plan(load()))) == []


def test_validate_names_faults_without_effect(load: Load) -> None:
    """Below its table, a line for each entry."""
    plan = compile_plan(load("agents={kind: beacon, talkers: [1]}", "links={latency: 1 ms}", "faults.1.where=2>1"))
    console = Console(file=io.StringIO(), width=200)
    console.print(validation_table(validate_plan(plan)))
    assert isinstance(console.file, io.StringIO)
    assert "fault t2: 2>1 carries nothing: 2 never sends" in console.file.getvalue()


def test_groups_name_links_and_agents(load: Load, refusal: Refusal) -> None:
    """In faults and in `links.only`; names that cannot be are refused where they stand."""
    groups = "groups: {left: [1, 2], far: 3}\nfaults:\n"
    plan = compile_plan(
        load(
            "links.only=[{where: left-far, loss: 0.2}]",
            replacing=("faults:\n", f"{groups}  - {{at: 1 s, for: 1 s, pause: left}}\n"),
        )
    )
    assert [fault.id for fault in plan.faults[:2]] == ["t1.1", "t1.2"]
    changed = [link for link, settings in plan.links.items() if settings.loss != plan.links["1", "2"].loss]
    assert changed == [("2", "3"), ("3", "2")]
    for written, message in (
        ("{left: [1, 9]}", "groups.left: there is no agent 9; agents: 1, 2, 3"),
        ("{2: [1, 3]}", "groups.2: 2 is the name of an agent"),
        ("{all: [1]}", "groups: a group cannot be called all"),
        ("{left: []}", "groups: nothing is named"),
        ("{left: [1, 1]}", "groups: group left has agent 1 twice"),
        ("[1, 2]", "groups: should be a mapping"),
    ):
        assert message in refusal(replacing=("faults:\n", f"groups: {written}\nfaults:\n"))


def of_sensors(load: Load, fields: str) -> tuple[SensorFault, ...]:
    """The faults of an entry about sensors, in a world that has them."""
    scenario = load(
        "agents={kind: dfa-module}",
        "topology={hexagonal: 4}",
        "links.rate=1 Mbit/s",
        "world={kind: plane, altitude: 0.2 m}",
        "faults=[]",
        f"faults=[{{at: 1 s, {fields}}}]",
    )
    return tuple(fault for fault in compile_plan(scenario).faults if isinstance(fault, SensorFault))


def test_sensor_faults(load: Load) -> None:
    """One of five troubles, with the size and the probability that belong to it."""
    assert of_sensors(load, "for: 1 s, sensor: 2.distance, failed: true") == (
        SensorFault("t1", 10**9, 2 * 10**9, "2", "distance", "failed"),
    )
    assert of_sensors(load, "sensor: 2.distance, bias: -0.1")[0].size == (-0.1,)
    spikes = of_sensors(load, "sensor: 2.distance, spikes: {size: 0.5, probability: 0.1}")
    assert spikes == (SensorFault("t1", 10**9, None, "2", "distance", "spikes", (0.5,), 0.1),)
    every = of_sensors(load, "sensor: all.distance, noise: [0.1]")
    assert [(fault.id, fault.agent) for fault in every] == [(f"t1.{name}", name) for name in "1234"]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ("sensor: 2.camera, stuck: true", "faults.0.sensor: 2.camera: agent 2 has no sensor 'camera'; it has distance"),
        ("sensor: 9.distance, stuck: true", "faults.0.sensor: there is no agent '9'"),
        ("sensor: 2, stuck: true", "faults.0.sensor: '2' names no sensor: write an agent and its sensor"),
        (
            "sensor: 2.distance, noise: [1, 2]",
            "noise has 2 numbers and a sample of 2.distance has 1: write one for all",
        ),
    ],
)
def test_sensors_that_are_none(load: Load, fields: str, message: str) -> None:
    """The message says which sensors there are."""
    with pytest.raises(BadInput) as caught:
        of_sensors(load, fields)
    assert message in str(caught.value)
