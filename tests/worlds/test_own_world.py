"""A world of a user's own class: read, run in the twin, measured in every way, and refused with its call named."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from volery.agents.agent import Agent, Received, Sample
from volery.agents.plan_codec import Opaque, decode_plan, encode_plan
from volery.errors import BadInput, RunFailed, VoleryError
from volery.experiments.evaluation.evaluation import Evaluation
from volery.experiments.record.evaluation_pass import evaluated
from volery.experiments.record.record import Record
from volery.experiments.scenario.load import LoadedScenario, load_scenario
from volery.experiments.scenario.schema import json_schema, resolved_yaml
from volery.experiments.twin import recorded
from volery.quantities import Quantity
from volery.randomness import Stream
from volery.units import Hertz, Metres
from volery.worlds.own_world import OwnWorld, OwnWorldSettings
from volery.worlds.world import World

MS, S = 1_000_000, 1_000_000_000


@dataclass(frozen=True)
class Size:
    """What a scenario may say of `Street`."""

    rate: Hertz = 10.0
    noise: Metres = 0.0
    speed: float = 1.0


class Street(World):
    """Agent n walks along x from n metres, at `speed` m/s; all see all others, and the range of whom they hear."""

    Parameters = Size

    def position(self, agent: str, time_ns: int) -> Sequence[float]:
        """Along x."""
        return [float(agent) + self.parameters.speed * time_ns / S, 0.0]

    def truth(self, agent: str, quantity: str, time_ns: int) -> Any:
        """Each its own place, and of all the time."""
        return {"place": self.position(agent, time_ns)[0], "time": time_ns / S}.get(quantity)

    def sensors(self, agent: str) -> Mapping[str, Any]:
        """Others at a rate, a bell at two instants of which NumPy made whole numbers."""
        return {"others": self.parameters.rate, "bell": np.array([150, 350]) * MS}

    def measure(self, agent: str, sensor: str, index: int, time_ns: int) -> Any:
        """Rows; or that the bell rang."""
        if sensor == "bell":
            return True
        noise = self.parameters.noise * self.random("others", agent).normal(index)
        apart = [float(other) - float(agent) + noise for other in self.agents]
        return [(number, far) for number, far in enumerate(apart) if self.agents[number] != agent]

    def measure_frame(self, source: str, target: str, time_ns: int, noise: Stream) -> Any:
        """Where the sender was, when that was, and some chance; nothing of agent 3."""
        return None if source == "3" else [self.position(source, time_ns)[0], time_ns / S, noise.normal(0)]


class WalkerEvaluation(Evaluation):
    """Keeps what was received."""

    needs_payloads = True
    heard: list[tuple[str, Received]]

    def received(self, agent: str, frame: Received) -> None:
        """Keep it, with all others of the class."""
        type(self).heard.append((agent, frame))


class Walker(Agent):
    """Reports and tells what it sees."""

    evaluation = WalkerEvaluation

    def on_sample(self, sample: Sample) -> None:
        """Report the instant, by its own clock, or what the others' numbers are."""
        if sample.sensor == "bell":
            self.context.note("bell", at=sample.time_ns)
            return
        assert sample.value is not None
        self.context.report("rows", sample.value, sample.index)
        self.context.report("time", sample.time_ns / S, sample.index)
        self.context.report("place", float(self.context.name), sample.index)
        self.context.broadcast(b"here I am")

    def on_frame(self, frame: Received) -> None:
        """Report what came with it."""
        value = [np.nan] * 3 if frame.measured is None else frame.measured
        self.context.report(f"from {frame.source}", value)


def scenario(of: type[World] = Street, agent: type[Agent] = Walker, **fields: Any) -> dict[str, Any]:
    """The fields of a scenario of three agents."""
    return {
        "name": "street",
        "duration": "500 ms",
        "topology": {"complete": 3},
        "agents": {"kind": f"{__name__}:{agent.__name__}"},
        "world": {"kind": f"{__name__}:{of.__name__}"},
        "links": {"latency": "5 ms"},
        **fields,
    }


def street(**parameters: Any) -> dict[str, Any]:
    """A scenario's `world`."""
    return {"kind": f"{__name__}:Street", **parameters}


def loaded(**fields: Any) -> LoadedScenario:
    """The scenario."""
    return load_scenario(scenario(**fields))


def run(**fields: Any) -> Record:
    """The run of it in the twin, evaluated."""
    WalkerEvaluation.heard = []
    return recorded(loaded(**fields).plan)


# -- what a scenario says ---------------------------------------------------------------------------------------------


def test_a_scenario_names_the_class_and_its_parameters_with_units() -> None:
    """They are written as they were read; the plan names the class, and makes the world where it is needed."""
    found = loaded(world=street(rate="20 Hz", noise="5 cm"))
    assert found.scenario.world == OwnWorldSettings(f"{__name__}:Street", Size(20.0, 0.05))
    assert "noise: 0.05 m" in resolved_yaml(found.scenario)
    assert found.plan.world == OwnWorld(f"{__name__}:Street", Size(20.0, 0.05), ("1", "2", "3"), {}, 0)


def test_places_of_the_topology_reach_the_world_in_all_their_dimensions() -> None:
    """A ring has places; whose class does not override `position` leaves agents there."""
    plan = loaded(world={"kind": f"{__name__}:Still"}, agents={"kind": "beacon"}, topology={"ring": 4}).plan
    assert isinstance(plan.world, OwnWorld)
    assert plan.world.positions == {agent.name: agent.position for agent in plan.agents}
    assert tuple(plan.world.position("2", 0)) == plan.agent("2").position


@pytest.mark.parametrize(
    ("world", "message"),
    [
        (street(nose="5 cm"), r"world.nose: unknown field \(did you mean 'noise'\?\)"),
        (street(noise="5 s"), "world.noise: '5 s' is not a quantity here"),
        ({"kind": f"{__name__}:Streets"}, "world.kind: world kind '.*:Streets' cannot be loaded"),
        ({"kind": f"{__name__}:Walker"}, "world.kind: .*is not a subclass of volery.worlds.world.World|not a subclass"),
        ({"kind": "street"}, "unknown world kind 'street'.*or write package.module:Class"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(world: dict[str, Any], message: str) -> None:
    """As of built-in kinds."""
    with pytest.raises(BadInput, match=message):
        loaded(world=world)


def test_editors_accept_a_world_of_ones_own() -> None:
    """With any fields, since its class is not known; but not a misspelt built-in kind."""
    schema = json_schema()
    jsonschema.validate(scenario(world=street(rate="20 Hz")), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(scenario(world={"kind": "plain"}), schema)


def test_a_plan_is_read_where_the_class_is_not() -> None:
    """The class is a name in it; readers get parameters as opaque fields, whoever runs it an equal world."""
    plan = loaded(world=street(noise="5 cm")).plan
    read = decode_plan(encode_plan(plan), only_read=True).world
    assert isinstance(read, OwnWorld)
    assert (read.kind, type(read.parameters)) == (f"{__name__}:Street", Opaque)
    assert plan.world is not None
    plan.world.measure("1", "others", 3)
    assert json.loads(encode_plan(plan)) == json.loads(encode_plan(loaded(world=street(noise="5 cm")).plan))
    assert decode_plan(encode_plan(plan)) == plan


# -- what is measured and true ----------------------------------------------------------------------------------------


def test_samples_come_at_rates_and_at_instants() -> None:
    """Of the bell at its two instants only; a restarted agent goes on with those that are yet to come."""
    record = run(faults=[{"at": "200 ms", "kill": "2", "for": "100 ms"}])
    bells = [(note["agent"], note["at"]) for note in record.notes if note["what"] == "bell"]
    assert sorted(bells) == [(agent, at * MS) for agent in "123" for at in (150, 350)]
    assert [entry.index for entry in _samples(record, "1", "others")] == [0, 1, 2, 3, 4]


def _samples(record: Record, agent: str, sensor: str) -> list[Sample]:
    taken = [one for life, batch in record.batches.items() if life[0] == agent for one in batch.samples]
    return [
        Sample(one.sensor, one.sample, one.time_ns, np.array(one.value).reshape(one.shape))
        for one in taken
        if one.sensor == sensor
    ]


def test_the_truth_is_told_whose_and_when() -> None:
    """Of each agent its own place, a shared time without a thought of the agent, and of rows nothing."""
    record = run()
    for agent in "123":
        expected = float(agent) + np.arange(5) / 10
        np.testing.assert_allclose(record.truth("place")[agent][:, 0], expected, rtol=1e-12)
        np.testing.assert_allclose(record.truth("time")[agent][:, 0], np.arange(5) / 10, rtol=1e-12)
        assert np.isnan(record.truth("rows")[agent]).all()


def test_stamps_are_by_the_agents_own_clock() -> None:
    """What is measured is of nominal time."""
    record = run(faults=[{"at": 0, "clock": "2", "offset": "1 s"}])
    assert record.estimates("time")["2"].value[3, 0] == 1.3
    assert _samples(record, "2", "others")[3].time_ns == 300 * MS


def test_sensor_faults_leave_the_first_column_alone() -> None:
    """A bias is added to the ranges, not to the numbers of whom they belong to."""
    record = run(faults=[{"at": "150 ms", "sensor": "2.others", "bias": 10}])
    before, after = (_samples(record, "2", "others")[index].value for index in (1, 2))
    np.testing.assert_array_equal(before, [[0, -1], [2, 1]])
    np.testing.assert_array_equal(after, [[0, 9], [2, 11]])


def test_a_frame_brings_what_was_measured_from_it() -> None:
    """Geometry at the start of its transmission, chance of its own; nothing where the world measures nothing."""
    record = run(links={"latency": "5 ms", "duplication": 1.0, "loss": {"bernoulli": 0.4}}, seed=3)
    heard = [(agent, frame) for agent, frame in WalkerEvaluation.heard if frame.source == "1"]
    rows = [row for name in "23" for row in record.batches[name, 0].measured if row.source == "1"]
    sent = {(one.target, one.sequence): one.start_ns for one in record.batches["1", 0].sent}
    delivered = [
        (name, one.source, one.sequence, one.copy)
        for name in "23"
        for one in record.batches[name, 0].heard
        if one.source == "1" and one.fate == "delivered"
    ]
    assert 0 < len(rows) == len(delivered) == len(heard) < 20
    draws = set()
    for name in "23":
        for row in record.batches[name, 0].measured:
            if row.source == "1":
                assert row.value is not None
                start_s = sent[name, row.sequence] / S
                assert row.value[:2] == pytest.approx([1 + start_s, start_s], abs=1e-12)
                draws.add(row.value[2])
    assert len(draws) == len(rows)
    assert sorted(frame.measured[2] for _, frame in heard if frame.measured is not None) == sorted(draws)
    assert all(row.value is None for row in record.batches["1", 0].measured if row.source == "3")


def test_a_frame_that_was_held_back_was_measured_when_it_was_sent() -> None:
    """The hold delays it, and the geometry is that of its start."""
    record = run(faults=[{"at": "90 ms", "until": "250 ms", "hold": "1>2"}])
    held = [row for row in record.batches["2", 0].measured if row.source == "1" and row.time_ns == 250 * MS]
    assert [row.value[1] for row in held if row.value is not None] == [0.101, 0.201]


def test_distances_and_pictures_follow_where_agents_move() -> None:
    """Losses by distance too, and graphs by proximity, for which the world says who the agents are."""
    record = run(world=street(speed=0.0))
    assert record.plan.distance_m("1", "3", 0) == 2.0
    assert record.evaluated.places is not None
    np.testing.assert_array_equal(record.evaluated.places.places[0], [[1, 0], [2, 0], [3, 0]])
    near = load_scenario(scenario(Crowd, topology={"proximity": {"radius": "1.5 m"}}))
    assert sorted(near.plan.links) == [("1", "2"), ("2", "1"), ("2", "3"), ("3", "2"), ("3", "4"), ("4", "3")]
    with pytest.raises(BadInput, match="agents are none, and this topology asks the world for them"):
        loaded(topology={"proximity": {"radius": "1.5 m"}})


# -- what is refused --------------------------------------------------------------------------------------------------


class Still(World):
    """Nothing happens."""


class Crowd(Street):
    """Who says itself who is in it."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.agents = ("1", "2", "3", "4")


class Odd(Street):
    """Returns what a test wants of one method."""

    returned: Any = None
    method = ""

    def sensors(self, agent: str) -> Mapping[str, Any]:
        """Odd, or as in the street."""
        found: Mapping[str, Any] = self._odd("sensors", super().sensors(agent))
        return found

    def measure(self, agent: str, sensor: str, index: int, time_ns: int) -> Any:
        """Odd, or as in the street; not odd at first, so that the scenario is not refused."""
        right = super().measure(agent, sensor, index, time_ns)
        return right if sensor == "bell" or index < 3 else self._odd("measure", right)

    def measure_frame(self, source: str, target: str, time_ns: int, noise: Stream) -> Any:
        """Odd, or nothing."""
        return self._odd("measure_frame", None)

    def truth(self, agent: str, quantity: str, time_ns: int) -> Any:
        """Odd, or not known."""
        return self._odd("truth", None)

    def position(self, agent: str, time_ns: int) -> Any:
        """Odd, or as in the street."""
        return self._odd("position", super().position(agent, time_ns))

    def _odd(self, method: str, right: Any) -> Any:
        if method != type(self).method:
            return right
        returned = type(self).returned
        return returned() if callable(returned) else returned


def _raise(error: BaseException) -> Callable[[], Any]:
    def fail() -> Any:
        raise error

    return fail


SENSORS = r"world .*:Odd: sensors\('1'\) returned .*: "
MEASURE = r"world .*:Odd: measure\('1', 'others', 3, 300000000\) "


@pytest.mark.parametrize(
    ("method", "returned", "message"),
    [
        ("sensors", ["others"], SENSORS + "return a mapping"),
        ("sensors", {"a.b": 1.0}, SENSORS + "'a.b' cannot name a sensor"),
        ("sensors", {"a": -1.0}, SENSORS + r"-1.0 is neither a rate in Hz, above 0, nor instants"),
        ("sensors", {"a": float("nan")}, SENSORS + "nan is neither"),
        ("sensors", {"a": "20 Hz"}, SENSORS + "'20 Hz' is neither"),
        ("sensors", {"a": True}, SENSORS + "True is neither"),
        ("sensors", {"a": [0.5]}, SENSORS + "0.5 is no instant"),
        ("sensors", {"a": [5, 3]}, SENSORS + "instants must ascend from 0 ns on, and 3 ns comes after 5 ns"),
        ("sensors", {"a": [-1]}, SENSORS + "instants must ascend from 0 ns on"),
        ("sensors", _raise(KeyError("1")), r"world .*:Odd: sensors\('1'\) failed: KeyError: '1'"),
        ("measure", [1.0, float("nan")], MEASURE + r"returned \[1.0, nan\], which is not finite: return None"),
        ("measure", [[1.0], [2.0]], MEASURE + r"returned an array of shape \(2, 1\): return a number, a vector"),
        ("measure", np.zeros((2, 2, 2)), MEASURE + r"returned an array of shape \(2, 2, 2\)"),
        ("measure", [[1.0, 2.0], [3.0]], MEASURE + ".*whose rows differ in length"),
        ("measure", "far", MEASURE + "returned 'far': return numbers"),
        ("measure", 1j, MEASURE + "returned 1j: return numbers"),
        ("measure", _raise(SystemExit(3)), MEASURE + "failed: SystemExit: 3"),
        ("measure", _raise(BadInput("no light")), MEASURE + "failed: no light"),
        ("measure_frame", [[1.0, 2.0]], r"world .*: measure_frame\('1', '2', 1000000.*shape \(1, 2\): return a number"),
        ("measure_frame", float("inf"), r"world .*: measure_frame\('1', '2', .*returned inf, which is not finite"),
        ("position", [1.0], r"world .*:Odd: position\('1', 0\) returned 1 numbers: return x and y"),
        ("position", None, r"world .*:Odd: position\('1', 0\) returned 0 numbers: return x and y"),
        ("truth", [float("nan")], r"world .*:Odd: truth\('1', '.*', 0\) returned \[nan\], which is not finite"),
    ],
)
def test_what_a_world_returns_is_checked_at_the_call(
    method: str, returned: Any, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With world, method and arguments named."""
    monkeypatch.setattr(Odd, "method", method)
    monkeypatch.setattr(Odd, "returned", staticmethod(returned) if callable(returned) else returned)
    with pytest.raises(VoleryError, match=message):
        evaluated(recorded(loaded(world={"kind": f"{__name__}:Odd"}).plan))


def test_an_error_in_a_world_comes_with_the_lines_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    """And, in a run, with the agent whose sensor it is."""
    monkeypatch.setattr(Odd, "method", "measure")
    monkeypatch.setattr(Odd, "returned", staticmethod(_raise(KeyError("lamp"))))
    plan = loaded(world={"kind": f"{__name__}:Odd"}).plan
    with pytest.raises(RunFailed) as raised:
        recorded(plan)
    sentence, *frames = str(raised.value).splitlines()
    assert re.fullmatch(
        r"agent 1: world .*:Odd: measure\('1', 'others', 3, 300000000\) failed: KeyError: 'lamp'", sentence
    )
    files = [line for line in frames if line.startswith('  File "')]
    assert files
    assert all(Path(__file__).name in line for line in files)


def test_where_agents_are_is_checked_before_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though nothing is measured there yet."""
    monkeypatch.setattr(Odd, "method", "position")
    monkeypatch.setattr(Odd, "returned", 3.0)
    with pytest.raises(BadInput, match=r"world .*:Odd: position\('1', 0\) returned 1 numbers"):
        loaded(world={"kind": f"{__name__}:Odd"})


class Unnamed(Street):
    """Declares quantities by their names alone."""

    quantities = ("place",)  # type: ignore[assignment]


class Twice(Street):
    """Declares a quantity twice."""

    quantities = 2 * (Quantity("place"),)


class Later(Street):
    """Takes its samples without their index."""

    def measure(self, agent: str, sensor: str, time_ns: int) -> Any:  # type: ignore[override]
        """Never called."""


@pytest.mark.parametrize(
    ("world", "message"),
    [
        (Unnamed, r"world .*:Unnamed: quantities is \('place',\): write a list, as in quantities = \[Quantity"),
        (Twice, "world .*:Twice: quantities has 'place' twice: declare it once"),
        (Later, r"world kind .*:Later': measure takes other arguments than \(self, agent, sensor, index, time_ns\)"),
    ],
)
def test_a_world_that_cannot_work_is_refused(world: type[World], message: str) -> None:
    """Before anything runs."""
    with pytest.raises(BadInput, match=message):
        loaded(world={"kind": f"{__name__}:{world.__name__}"})


class Moody(Street):
    """Draws from the global generator."""

    def measure(self, agent: str, sensor: str, index: int, time_ns: int) -> Any:
        """Nobody knows."""
        return np.random.default_rng().normal()


class Counting(Street):
    """Keeps a state that its calls change."""

    count = 0

    def measure(self, agent: str, sensor: str, index: int, time_ns: int) -> Any:
        """How often it was asked."""
        self.count += 1
        return self.count


class Strict(Street):
    """Refuses parameters, and has nothing to measure."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        if self.parameters.speed > 1:
            raise BadInput("nobody walks that fast", ("speed",))


@pytest.mark.parametrize("world", [Moody, Counting])
def test_a_world_that_is_no_function_of_seed_and_time_is_refused(world: type[World]) -> None:
    """Its first samples are asked for in two orders."""
    with pytest.raises(BadInput, match=r"measure\('1', 'others', 0\) returns .*, and another time .*self.random by"):
        load_scenario(scenario(world))


def test_a_world_may_refuse_its_parameters() -> None:
    """At their place."""
    with pytest.raises(BadInput, match=r"world\.speed: nobody walks that fast"):
        load_scenario(scenario(Strict, world={"kind": f"{__name__}:Strict", "speed": 2.0}))
