"""Modules of the flying array, run in the twin."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast
from unittest.mock import Mock

import networkx as nx
import numpy as np
import pytest
from numpy.typing import ArrayLike

from volery import topologies
from volery.agents import payloads
from volery.agents.agent import Context, Received, Sample, Timer
from volery.agents.dfa import estimators as dfa_estimators
from volery.agents.dfa.dfa_settings import DfaParameters
from volery.agents.dfa.module import DfaModule
from volery.agents.plan import AgentPlan, Plan
from volery.agents.sample_counts import COUNTS
from volery.errors import BadInput
from volery.experiments.record.record import Record
from volery.experiments.twin import recorded
from volery.randomness import Stream, stream
from volery.transport.faults import Fault, Kill, Pause
from volery.transport.latency_settings import Constant, Uniform
from volery.transport.links import LinkSettings
from volery.transport.loss_settings import Bernoulli
from volery.transport.media_settings import HalfDuplex, Tdma
from volery.worlds import signals as truth
from volery.worlds.plane.distance_sensors import GaussianDistance
from volery.worlds.plane.plane_world import PlaneWorld

MS = 1_000_000
NUMBERS = 9
"""Of a packed information pair."""
PLACES = {"1": (0.0, 0.0), "2": (0.25, 0.0), "3": (0.1, 0.2), "4": (-0.2, 0.15), "5": (0.05, -0.25)}


def array(graph: nx.Graph, places: Mapping[str, tuple[float, float]] | None = None) -> nx.Graph:
    """A graph with positions; its own, or these."""
    if places is not None:
        nx.set_node_attributes(graph, {name: places[name] for name in graph}, "position")
    return graph


COMPLETE = array(topologies.complete(5), PLACES)


def plan_of(
    graph: nx.Graph,
    settings: LinkSettings | Mapping[tuple[str, str], LinkSettings] | None = None,
    duration_ms: int = 500,
    faults: Sequence[Fault] = (),
    **parameters: Any,
) -> Plan:
    """A plan of modules over a tilted plane, with 5 mm of noise."""
    positions = topologies.positions(graph)
    world = PlaneWorld(
        truth.Constant(0.25), truth.Constant(0.05), truth.Constant(-0.04), positions, GaussianDistance(0.005), 5
    )
    default = LinkSettings(latency=Constant(2 * MS))
    names = topologies.agents(graph)
    pairs = [(a, b) for a in names for b in topologies.neighbours(graph, a)]
    given = default if settings is None else settings
    links = {pair: given if isinstance(given, LinkSettings) else given.get(pair, default) for pair in pairs}
    degrees = {name: int(graph.degree[name]) for name in names}
    agents = tuple(
        AgentPlan(
            name,
            "dfa-module",
            DfaParameters(**parameters),
            tuple(topologies.neighbours(graph, name)),
            degrees,
            positions[name],
        )
        for name in names
    )
    return Plan("array", 5, duration_ms * MS, agents, links, world, tuple(faults))


def run(plan: Plan) -> Record:
    """The record of a run in the twin."""
    return recorded(plan)


def errors(record: Record, quantity: str = "estimate") -> dict[str, np.ndarray]:
    """Agent → largest component of the difference to the centralised estimate, report by report."""
    central = record.central(quantity)
    return {
        agent: np.abs(series.value - central[agent]).max(axis=1) for agent, series in record.estimates(quantity).items()
    }


@pytest.mark.parametrize("model", ["linear", "exact"])
@pytest.mark.parametrize(
    "estimator", ["metropolis-least-squares", "running-sum", "neighbourhood-least-squares", "estimate-averaging"]
)
def test_one_round_on_the_complete_graph_is_the_centralised_estimate(estimator: str, model: str) -> None:
    """Everybody hears everybody: after one round all that is left is rounding, of a well-conditioned 3 by 3 system."""
    record = run(plan_of(COMPLETE, estimator=estimator, model=model, rounds=1, payload="float64"))
    reports = record.estimates("estimate")
    assert sorted(reports) == list("12345")
    assert all(series.sample.tolist() == list(range(9)) for series in reports.values())
    assert max(error.max() for error in errors(record).values()) < 1e-12


@pytest.mark.parametrize(
    "estimator",
    ["metropolis-least-squares", "running-sum", "flow-updating", "neighbourhood-least-squares", "estimate-averaging"],
)
def test_the_order_of_arrival_does_not_matter(estimator: str) -> None:
    """Other latencies bring the frames of a round in other orders; the estimates keep every bit."""
    graph = topologies.random_hexagonal(8, 3)
    shuffled = LinkSettings(latency=Uniform(1 * MS, 9 * MS))
    first, second = (
        run(plan_of(graph, settings, estimator=estimator, rounds=3)).estimates("estimate")
        for settings in (None, shuffled)
    )
    assert len(first) == 8
    for agent, series in first.items():
        assert (series.value == second[agent].value).all()


def test_frames_that_miss_their_round_are_not_used() -> None:
    """With a latency longer than a round every module stands alone, and one distance is not enough to tell anything."""
    record = run(plan_of(COMPLETE, LinkSettings(latency=Constant(30 * MS)), rounds=2))
    assert record.quantities() == ()
    assert all(batch.heard for batch in record.batches.values())


class ControlServer:
    """The context of a module 1 of the complete array, in a test's hands; see `Context`."""

    name = "1"
    neighbours = ("2", "3", "4", "5")
    degrees = dict.fromkeys("12345", 4)
    position = (0.0, 0.0)
    now_ns = 0

    def __init__(self) -> None:
        self.told: dict[str, bytes] = {}
        self.reports: list[tuple[str, int, list[float]]] = []

    def send(self, target: str, payload: bytes, stream: str = "") -> None:
        """Keep it."""
        self.told[target] = payload

    def set_timer(self, time_ns: int, name: str = "", index: int = 0) -> None:
        """The test rings by hand."""

    def report(self, quantity: str, value: ArrayLike, index: int = 0) -> None:
        """Keep it."""
        self.reports.append((quantity, index, np.asarray(value).tolist()))

    def random(self, purpose: str) -> Stream:
        """Any stream."""
        return stream(0, purpose)


def module(**parameters: Any) -> tuple[DfaModule, ControlServer]:
    """A module on a control_server."""
    control_server = ControlServer()
    return DfaModule(cast("Context", control_server), DfaParameters(**parameters)), control_server


def tell(agent: DfaModule, source: str, sample: int, number: int, distance: float) -> None:
    """A neighbour's position and distance arrive."""
    vector = np.array([*PLACES[source], distance])
    agent.on_frame(Received(source, payloads.encode([sample, number, vector], "float64"), 0))


def ring(agent: DfaModule, sample: int, number: int) -> None:
    """A round ends and the next begins."""
    agent.on_timer(Timer(str(number), sample, 0))


@pytest.mark.parametrize("later", [1, COUNTS - 1, COUNTS])
def test_what_comes_after_its_round_is_never_used(later: int) -> None:
    """Also not when the counts on the wire have gone round and the same tag is up again."""
    agent, control_server = module(estimator="neighbourhood-least-squares", rounds=1)
    agent.on_sample(Sample("distance", 0, 0, np.array([0.2])))
    ring(agent, 0, 0)
    ring(agent, 0, 1)
    for source in "2345":
        tell(agent, source, 0, 0, 0.3)
    ring(agent, later, 0)
    ring(agent, later, 1)
    assert control_server.reports == []


def test_what_comes_before_its_round_waits_for_it() -> None:
    """A neighbour whose phase is ahead has told its round before this module has begun it."""
    agent, control_server = module(estimator="neighbourhood-least-squares", rounds=1)
    agent.on_sample(Sample("distance", COUNTS, 0, np.array([0.2])))
    for source in "2345":
        tell(agent, source, 0, 0, 0.2)
    ring(agent, COUNTS, 0)
    ring(agent, COUNTS, 1)
    [(quantity, index, value)] = control_server.reports
    assert (quantity, index) == ("estimate", COUNTS)
    assert value == pytest.approx([0.2, 0.0, 0.0], abs=1e-12)
    assert set(control_server.told) == {"2", "3", "4", "5"}


def test_estimates_are_handed_on_to_who_cannot_solve() -> None:
    """A tail of modules hangs on a triangle: each round carries the estimate one module further out, unchanged."""
    graph = nx.Graph([("1", "2"), ("2", "3"), ("1", "3"), ("3", "4"), ("4", "5"), ("5", "6")])
    places = {"1": (0.0, 0.0), "2": (0.0, 0.2), "3": (0.2, 0.1), "4": (0.4, 0.1), "5": (0.6, 0.1), "6": (0.8, 0.1)}
    for rounds, reached in ((1, "123"), (2, "1234"), (3, "12345"), (4, "123456")):
        plan = plan_of(array(graph, places), estimator="neighbourhood-least-squares", rounds=rounds, payload="float64")
        reports = run(plan).estimates("estimate")
        assert sorted(reports) == list(reached)
        assert all((reports[name].value == reports["3"].value).all() for name in reached[3:])


@pytest.mark.parametrize(("precision", "size"), [("float64", 8), ("float32", 4), ("float16", 2)])
def test_payloads_have_the_size_of_their_precision(precision: payloads.Precision, size: int) -> None:
    """Nine numbers and a head; no frame is larger than was said beforehand; rounding shows as it should.

    The pair's entries are below 1, so a relative rounding of 2⁻ᵖ in each moves the solution by a small multiple of it:
    the condition of this array is below 10³.
    """
    plan = plan_of(COMPLETE, payload=precision, rounds=1)
    parameters: DfaParameters = plan.agents[0].parameters
    record = run(plan)
    sizes = {sent.size for batch in record.batches.values() for sent in batch.sent}
    assert max(sizes) <= DfaModule.largest_payload(parameters) == parameters.largest_payload
    assert NUMBERS * size < min(sizes) <= parameters.largest_payload <= NUMBERS * size + 9
    bound = {8: 2**-52, 4: 2**-24, 2: 2**-11}[size] * 1e3
    worst = max(error.max() for error in errors(record).values())
    assert worst < bound
    assert size == 8 or worst > bound / 1e6


@pytest.mark.parametrize(
    ("estimator", "keeps"), [("running-sum", True), ("flow-updating", True), ("metropolis-least-squares", False)]
)
def test_the_average_under_loss_in_one_direction(estimator: str, keeps: bool) -> None:
    """A measurement held, 30 % loss upwards in name, 300 asynchronous rounds of an 8-module array.

    Running sums and flows reach the centralised estimate; plain Metropolis agrees on something else, for good.
    """
    graph = topologies.random_hexagonal(8, 3)
    lossy = LinkSettings(latency=Constant(2 * MS), loss=(Bernoulli(0.3),))
    links = dict.fromkeys(topologies.edges(graph), lossy)
    plan = plan_of(graph, links, 5100, estimator=estimator, timing="asynchronous", payload="float64", hold=True)
    record = run(plan)
    assert all(series.sample[-1] >= 99 for series in record.estimates("estimate").values())
    last = max(error[-1] for error in errors(record).values())
    assert last < 1e-6 if keeps else last > 1e-4


def test_rounds_are_reported_on_request() -> None:
    """`estimate/round` counts all rounds, and the last of a sample's is its estimate."""
    record = run(plan_of(COMPLETE, rounds=3, report_rounds=True))
    rounds, samples = record.estimates("estimate/round")["1"], record.estimates("estimate")["1"]
    assert rounds.sample.tolist() == list(range(1, len(rounds.sample) + 1))
    assert (rounds.value[2::3] == samples.value[: len(rounds.value[2::3])]).all()
    assert max(error.max() for error in errors(record, "estimate/round").values()) < 1e-3


def counted(monkeypatch: pytest.MonkeyPatch, owner: object, name: str) -> Mock:
    """Count the calls of a function from now on."""
    counter = Mock(wraps=getattr(owner, name))
    monkeypatch.setattr(owner, name, counter)
    return counter


@pytest.mark.parametrize("each_round", [False, True])
def test_only_reported_estimates_are_computed(monkeypatch: pytest.MonkeyPatch, each_round: bool) -> None:
    """Of three rounds a module solves for the last one only, unless each is reported."""
    solved = counted(monkeypatch, dfa_estimators, "estimate")
    record = run(plan_of(COMPLETE, rounds=3, report_rounds=each_round))
    reports = record.estimates("estimate/round" if each_round else "estimate").values()
    assert solved.call_count == sum(len(series.sample) for series in reports) > 0


@pytest.mark.parametrize(("estimator", "copies"), [("metropolis-least-squares", 4), ("flow-updating", 1)])
def test_a_message_to_all_neighbours_is_encoded_once(
    monkeypatch: pytest.MonkeyPatch, estimator: str, copies: int
) -> None:
    """Averages are the same for all four neighbours; flows differ from neighbour to neighbour."""
    encoded = counted(monkeypatch, payloads, "encode")
    record = run(plan_of(COMPLETE, estimator=estimator))
    assert encoded.call_count * copies == sum(len(batch.sent) for batch in record.batches.values()) > 0


def test_a_module_survives_a_pause() -> None:
    """It catches up on its rounds at once, and goes on as before."""
    plan = plan_of(COMPLETE, rounds=2, faults=[Pause("t1", 120 * MS, 270 * MS, "2")])
    reports = run(plan).estimates("estimate")
    assert reports["1"].sample.tolist() == list(range(9))
    assert set(reports["2"].sample[-3:]) == {6, 7, 8}


def test_a_sensor_that_sees_nothing_leaves_the_others_their_estimate() -> None:
    """A module without a measurement takes part with nothing, and learns what the others know."""
    for estimator in ("metropolis-least-squares", "neighbourhood-least-squares"):
        plan = plan_of(COMPLETE, estimator=estimator, rounds=1, payload="float64")
        assert plan.world is not None
        record = run(replace(plan, world=Blind(plan.world)))
        assert sorted(record.estimates("estimate")) == list("12345")
        assert max(error.max() for error in errors(record).values()) < 1e-12


class Blind:
    """A world in which module 1 sees nothing."""

    def __init__(self, world: Any) -> None:
        self.sensors, self.truth, self._world = world.sensors, world.truth, world

    def measure(self, agent: str, sensor: str, index: int) -> Any:
        """Nothing for module 1."""
        return None if agent == "1" else self._world.measure(agent, sensor, index)


def test_a_plan_that_fits_has_no_problems() -> None:
    """Three float32 rounds at 20 Hz fit the slots of an infrared link."""
    infrared = LinkSettings(
        HalfDuplex(access=Tdma(60.0, 200_000)), 115_200.0, overhead=4, bits_per_byte=10, latency=Constant(2 * MS)
    )
    assert DfaModule.problems(plan_of(topologies.sixteen_module_array(), infrared)) == []
    assert DfaModule.sends_per_second(DfaParameters()) == 60.0


LINE = array(topologies.line(3), {"1": (0.0, 0.0), "2": (0.1, 0.1), "3": (0.2, 0.2)})
FITTING = plan_of(COMPLETE)


@pytest.mark.parametrize(
    ("plan", "message"),
    [
        (plan_of(LINE), "on one line, so roll and pitch cannot be told apart: add a cell off the line"),
        (plan_of(COMPLETE, rate=25.0), "agents.rate is 25 Hz, but the world's sensors run at 20 Hz"),
        (
            plan_of(COMPLETE, LinkSettings(latency=Constant(17 * MS))),
            "synchronous rounds do not fit: .* use fewer rounds",
        ),
        (replace(FITTING, world=None), "needs a world to look at"),
        (
            replace(FITTING, agents=tuple(replace(agent, position=None) for agent in FITTING.agents)),
            "needs positions: use a topology that has them",
        ),
    ],
)
def test_plans_that_cannot_work_have_a_problem(plan: Plan, message: str) -> None:
    """One sentence, with the remedy."""
    [problem] = DfaModule.problems(plan)
    assert re.search(message, problem)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"rate": 0.0}, "rate is 0 Hz"),
        ({"rounds": 0}, "rounds is 0, at least 1"),
        ({"timing": "asynchronous", "estimator": "estimate-averaging"}, "needs timing: synchronous"),
    ],
)
def test_impossible_parameters_are_refused(parameters: dict[str, Any], message: str) -> None:
    """The message gives the value and the bound."""
    with pytest.raises(BadInput, match=message):
        DfaParameters(**parameters)


def test_phases_are_spread_or_aligned() -> None:
    """Rounds that wait for each other spread over an eighth of a round, the others over all of it, aligned ones not."""
    spreads = [
        DfaParameters(rounds=2, phase="aligned").spread_ns(),
        DfaParameters(rounds=2).spread_ns(),
        DfaParameters(rounds=2, estimator="running-sum", timing="asynchronous").spread_ns(),
    ]
    assert spreads == [0, 25 * MS // 8, 25 * MS]
    record = run(plan_of(COMPLETE, rounds=2))
    offsets = {batch.agent: batch.sent[0].start_ns % (25 * MS) for batch in record.batches.values()}
    assert len(set(offsets.values())) == 5
    assert all(MS <= offset < MS + 25 * MS // 8 for offset in offsets.values())


@pytest.mark.parametrize("keep", [True, False])
@pytest.mark.parametrize("estimator", ["metropolis-least-squares", "running-sum", "flow-updating"])
def test_a_kept_state_is_gone_on_with(estimator: str, keep: bool) -> None:
    """After 300 rounds all agree but for rounding: one that comes back with its state still does, and else it does not.

    One that begins with its own measurement alone is off by its noise, of 5 mm, shared with few others at first.
    """
    faults = [Kill("k", 1510 * MS, 1700 * MS, "3", keep)]
    asynchronous = {"estimator": estimator, "timing": "asynchronous", "rounds": 10, "payload": "float64"}
    record = run(plan_of(topologies.random_hexagonal(6, 2), None, 2000, faults, hold=True, **asynchronous))
    before, after = (np.array(record.batches["3", life].estimates[-1 + life].value) for life in (0, 1))
    assert bool(np.abs(before - after).max() < 1e-9) is keep


def test_each_sample_has_the_neighbours_of_its_first_round() -> None:
    """The edge 1-2 of a complete graph is gone from 110 to 405 ms: samples that begin meanwhile miss the average."""
    here = ((0, 110 * MS), (405 * MS, 600 * MS))
    plan = plan_of(COMPLETE, duration_ms=600, rounds=1, payload="float64")
    steady = dict.fromkeys([("1", "2"), ("2", "1")], here)
    off = errors(run(replace(plan, presence=steady)))
    for agent in "12":
        assert [sample for sample, error in enumerate(off[agent]) if error > 1e-12] == [3, 4, 5, 6, 7, 8]


def test_an_asynchronous_estimator_needs_a_steady_graph() -> None:
    """What a neighbour was told would be missing, or counted twice, when it comes back."""
    plan = plan_of(COMPLETE, estimator="running-sum", timing="asynchronous")
    assert list(DfaModule.problems(plan)) == []
    (problem,) = DfaModule.problems(replace(plan, presence={("1", "2"): ((0, 110 * MS),)}))
    assert "use timing: synchronous" in problem
