"""The evaluation of a run: what it is told, what it leaves in the folder, and what readers make of that."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from volery.agents.agent import Agent, Received, Sample, Timer
from volery.agents.journal import Commanded, Taken
from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.analysis.metrics import compute_metrics
from volery.experiments.evaluation.evaluation import Evaluation, Finding, Series, View, evaluation_class
from volery.experiments.evaluation.evaluation_result import EvaluationResult, load_evaluation, save_evaluation
from volery.experiments.record.evaluation_pass import evaluate_run, evaluated
from volery.experiments.record.plan_file import write_plan
from volery.experiments.record.record import Record, load
from volery.experiments.record.recorder import Recorder
from volery.experiments.scenario.load import load_scenario
from volery.experiments.twin import Twin, recorded
from volery.quantities import Quantity
from volery.transport.faults import ClockFault, Kill, Pause, SensorFault
from volery.transport.latency_settings import Constant
from volery.transport.links import LinkSettings
from volery.worlds.moving.motions import MovingWorld, Paths

MS = 1_000_000
Floats = NDArray[np.float64]
PlanOf = Callable[..., Plan]
Events = list[tuple[str, int, str, object]]
Told = Callable[..., tuple[Record, Events]]


class Ramp:
    """A world whose one sensor counts up from 0 at 10 Hz; the truth is the time in seconds."""

    def sensors(self, agent: str) -> Mapping[str, float]:
        """The counter."""
        return {"count": 10.0}

    def measure(self, agent: str, sensor: str, index: int) -> Floats | None:
        """Nothing at the third sample."""
        return None if index == 2 else np.array([float(index)])

    def truth(self, time_ns: int) -> Floats:
        """Seconds."""
        return np.array([time_ns / 1e9])


class SurveyedRamp(Ramp):
    """The same, and each agent has a count of its own."""

    quantities = (Quantity("count", is_shared=False),)


class Ledger(Evaluation):
    """Keeps what it is told, in order."""

    needs_payloads = True
    told: ClassVar[Events] = []

    def __init__(self, plan: Plan, world_reports: Mapping[str, Series]) -> None:
        super().__init__(plan, world_reports)
        self.told.clear()

    def sampled(self, agent: str, sample: Sample) -> None:
        """A sample."""
        value = None if sample.value is None else sample.value.tolist()
        self.told.append(("sampled", sample.time_ns, agent, value))

    def received(self, agent: str, frame: Received) -> None:
        """A frame."""
        self.told.append(("received", frame.time_ns, agent, (frame.source, frame.payload)))

    def commanded(self, agent: str, command: str, value: Floats, time_ns: int) -> None:
        """A command."""
        self.told.append(("commanded", time_ns, agent, (command, value.tolist())))

    def instant(self, agent: str, quantity: str, index: int, time_ns: int) -> int:
        """That of the sample."""
        return index * 100 * MS

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> Floats:
        """The number of samples so far."""
        self.told.append(("asked", time_ns, agent, index))
        return np.array([sum(what == "sampled" for what, *_ in self.told)])


class Teller(Agent):
    """Tells its neighbours each sample, and reports it 20 ms late."""

    evaluation = Ledger

    def on_sample(self, sample: Sample) -> None:
        """Send it; the report is due later."""
        self.context.broadcast(bytes([sample.index]))
        self.context.set_timer(self.context.now_ns + 20 * MS, index=sample.index)

    def on_timer(self, timer: object) -> None:
        """Report."""
        self.context.report("count", [0.0], timer.index)  # type: ignore[attr-defined]


@pytest.fixture
def told(plan_of: PlanOf) -> Told:
    """`told(faults)`: the record of two tellers for 450 ms, and what their evaluation was told."""

    def run(*faults: object) -> tuple[Record, Events]:
        plan = replace(plan_of([("1", "2")], 450, kind=Teller, faults=faults), world=Ramp(), keeps_payloads=True)
        record = recorded(plan)
        return record, list(Ledger.told)

    return run


def test_everything_is_told_in_the_order_of_events(
    told: Told,
) -> None:
    """Samples of an instant, then questions about it, though reports come later; frames 6 ms after their samples."""
    _, events = told()
    assert [time_ns for _, time_ns, *_ in events] == sorted(time_ns for _, time_ns, *_ in events)
    of_third = [event for event in events if 200 * MS <= event[1] < 300 * MS]
    assert of_third == [
        ("sampled", 200 * MS, "1", None),
        ("sampled", 200 * MS, "2", None),
        ("asked", 200 * MS, "1", 2),
        ("asked", 200 * MS, "2", 2),
        ("received", 206 * MS, "1", ("2", b"\x02")),
        ("received", 206 * MS, "2", ("1", b"\x02")),
    ]


def test_of_one_instant_commands_come_first_then_frames_samples_and_questions(plan_of: PlanOf) -> None:
    """Frames are 100 ms under way from sample to sample, and a command takes effect at one of these instants."""
    plan = plan_of([("1", "2")], 450, kind=Teller, settings=LinkSettings(latency=Constant(99 * MS)))
    record = recorded(replace(plan, world=Ramp(), keeps_payloads=True))
    record.batches["1", 0].commands.append(Commanded(200 * MS, "2", "thrust", [0.5]))
    evaluated(record)
    assert [event for event in Ledger.told if event[1] == 200 * MS] == [
        ("commanded", 200 * MS, "2", ("thrust", [0.5])),
        ("received", 200 * MS, "1", ("2", b"\x01")),
        ("received", 200 * MS, "2", ("1", b"\x01")),
        ("sampled", 200 * MS, "1", None),
        ("sampled", 200 * MS, "2", None),
        ("asked", 200 * MS, "1", 2),
        ("asked", 200 * MS, "2", 2),
    ]


def test_a_world_may_declare_what_its_agents_estimate(plan_of: PlanOf) -> None:
    """What the evaluation declares comes first; a quantity that neither names is a plain one."""
    plan = replace(plan_of([("1", "2")]), world=SurveyedRamp())
    judge = Evaluation(plan, {})
    assert judge.declared("count") is SurveyedRamp.quantities[0]
    assert judge.declared("speed") == Quantity("speed")
    judge.quantities = (Quantity("count"),)
    assert judge.declared("count").is_shared


def test_payloads_are_recorded_on_request_only(plan_of: PlanOf) -> None:
    """They make a record larger."""
    plan = replace(plan_of([("1", "2")], 450, kind=Teller), world=Ramp())
    assert all(not batch.payloads for batch in recorded(plan).batches.values())


def test_an_evaluation_sees_sensor_faults_and_nothing_of_the_dead(
    told: Told,
) -> None:
    """Agent 2 is dead from 150 to 350 ms; the counter of 1 is 10 too high from 300 ms on."""
    record, events = told(
        Kill(id="k", at_ns=150 * MS, until_ns=350 * MS, agent="2"),
        SensorFault("b", 300 * MS, None, "1", "count", "bias", (10.0,)),
    )
    samples = {(agent, time_ns // MS): value for what, time_ns, agent, value in events if what == "sampled"}
    assert [time for agent, time in samples if agent == "2"] == [0, 100, 400]
    assert samples["1", 300] == [13.0]
    assert record.central("count")["1"].ravel().tolist() == [2, 4, 5, 6, 8]


def test_samples_are_recorded_in_nominal_time(
    told: Told,
) -> None:
    """Whatever the agent's own clock shows, and however long it stood still."""
    record, _ = told(ClockFault("c", 50 * MS, None, "1", 30 * MS), Pause("p", 150 * MS, 350 * MS, "2"))
    for life in (("1", 0), ("2", 0)):
        assert [taken.time_ns // MS for taken in record.batches[life].samples] == [0, 100, 200, 300, 400]
    assert record.batches["1", 0].samples[2] == Taken("count", 2, 200 * MS, None, None)


def test_the_truth_of_a_coupled_world_is_found_by_its_index(plan_of: PlanOf) -> None:
    """Under the name of the agent first; of an index that the world has not written nothing is known."""
    times, index = np.array([0, 30, 60]), np.array([0, 2, 4])
    written = {
        "x": Series(times, index, np.array([[1.0], [2.0], [3.0]])),
        "x@2": Series(times, index, np.array([[-1.0], [-2.0], [-3.0]])),
    }
    of = Evaluation(plan_of([("1", "2")]), written)
    assert [of.truth(agent, "x", 2, 0) for agent in "12"] == [np.array([2.0]), np.array([-2.0])]
    assert [of.truth("1", "x", index, 0) for index in (1, 5)] == [None, None]
    assert [of.instant("1", "x", index, 99) for index in (2, 3)] == [30, 99]
    assert of.truth("1", "y", 2, 0) is None


class Walk(Evaluation):
    """Views of one place, which walks."""

    def view(self, agent: str, reports: Mapping[str, Floats]) -> View:
        """Where it is, with as much as it has walked."""
        return View({"here": np.array([reports["place"][0], 0.0])})


class Walker(Agent):
    """Reports each millisecond until 100 ms how many have gone by, and once more at 205 ms."""

    evaluation = Walk

    def start(self) -> None:
        """Set all timers."""
        for index in (*range(100), 205):
            self.context.set_timer(index * MS, index=index)

    def on_timer(self, timer: Timer) -> None:
        """Report."""
        self.context.report("place", timer.index, timer.index)


def test_views_are_kept_fifty_times_a_second_and_where_anything_changes(plan_of: PlanOf) -> None:
    """The last of each 20 ms, at its own instant; nothing while nothing is reported."""
    views = recorded(plan_of([("1", "2")], 300, kind=Walker)).evaluated.views["1"]
    assert [time_ns // MS for time_ns in views.time_ns.tolist()] == [0, 20, 40, 60, 80, 99, 205]
    assert views.places[:, 0, 0].tolist() == [0, 20, 40, 60, 80, 99, 205]
    assert [views.row(ms * MS) for ms in (0, 19, 20, 204, 205)] == [0, 0, 1, 5, 6]


def test_places_of_agents_that_move_are_kept_at_the_same_rate(plan_of: PlanOf) -> None:
    """Each 20 ms, and at the end."""
    world = MovingWorld(Paths(dict.fromkeys("12", ((0, (0.0, 0.0)), (100 * MS, (1.0, 0.0))))), 7)
    places = recorded(replace(plan_of([("1", "2")], 50), world=world)).evaluated.places
    assert places is not None
    assert [time_ns // MS for time_ns in places.time_ns.tolist()] == [0, 20, 40, 50]
    np.testing.assert_allclose(places.places[:, 1, 0], [0.0, 0.2, 0.4, 0.5])


def assert_same(found: EvaluationResult, expected: EvaluationResult) -> None:
    """All arrays and texts, NaN included."""
    np.testing.assert_equal(_plain(found), _plain(expected))


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if hasattr(value, "__dict__"):
        return _plain(vars(value))
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("tracker", ("duration=3 s",)),
        ("mav3", ("duration=1 s", "agents.report_covariance=5 Hz")),
        ("dfa4", ("duration=1 s", "agents.report_rounds=true")),
    ],
)
def test_an_evaluation_comes_back_from_its_file_as_it_was(name: str, changes: tuple[str, ...], tmp_path: Path) -> None:
    """To the bit, with what is not known, and names of quantities with slashes."""
    result = recorded(load_scenario(name, changes).plan).evaluated
    save_evaluation(result, tmp_path / "evaluation.npz")
    found = load_evaluation(tmp_path / "evaluation.npz")
    assert found is not None
    assert_same(found, result)
    assert load_evaluation(tmp_path / "elsewhere.npz") is None


def test_a_damaged_evaluation_is_named(tmp_path: Path) -> None:
    """The message says what to do."""
    (tmp_path / "evaluation.npz").write_bytes(b"PK\x03\x04 and no more")
    with pytest.raises(BadInput, match=r"evaluation.npz is damaged .*`volery evaluate` makes it again"):
        load_evaluation(tmp_path / "evaluation.npz")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A second of the four-module array in the twin, evaluated."""
    loaded = load_scenario("dfa4", ["duration=1 s"])
    write_plan(tmp_path, loaded.plan)
    with Recorder(tmp_path) as recorder:
        Twin(loaded.plan, recorder).run()
    evaluate_run(load(tmp_path, loaded.plan, evaluated=False), tmp_path)
    return tmp_path


def test_a_run_is_judged_by_what_was_true_when_it_ran(folder: Path) -> None:
    """Another altitude written into its plan afterwards changes none of its errors."""
    before = compute_metrics(load(folder)).quantities["estimate"]
    plan = folder / "plan.json"
    text = plan.read_text("utf-8")
    levels = '"levels": {"$tuple": [0.1, 0.2]}'
    assert levels in text
    plan.write_text(text.replace(levels, levels.replace("0.1", "0.4")), "utf-8")
    assert compute_metrics(load(folder)).quantities["estimate"] == before


def test_without_an_evaluation_frames_are_counted_and_the_rest_is_said_to_be_missing(folder: Path) -> None:
    """What reads estimates refuses with the remedy."""
    whole = compute_metrics(load(folder))
    (folder / "evaluation.npz").unlink()
    record = load(folder)
    metrics = compute_metrics(record)
    assert metrics.links == whole.links
    assert not metrics.quantities
    assert "`volery evaluate RUN`" in metrics.not_evaluated
    assert not whole.not_evaluated
    with pytest.raises(BadInput, match="this run is not evaluated"):
        record.truth("estimate")
    assert_same(evaluated(record).evaluated, recorded(load_scenario("dfa4", ["duration=1 s"]).plan).evaluated)


class Misjudged(Agent):
    """Names a class that is no evaluation."""

    evaluation: ClassVar[str | type] = Agent


class Former(Evaluation):
    """As evaluations were written before."""

    def truth(self, plan: Plan, quantity: str, index: int, time_ns: int, more: int) -> None:  # type: ignore[override]
        """Takes a plan."""


class OfFormer(Agent):
    """Names an evaluation that cannot be asked."""

    evaluation = Former


class Stranger(Evaluation):
    """Declares a single quantity."""

    quantities = Quantity("count")  # type: ignore[assignment]


class OfStranger(Agent):
    """Names that."""

    evaluation = Stranger


class Nowhere(Agent):
    """Names a class that is not there."""

    evaluation = "volery.experiments.evaluation.evaluation:Evaluator"


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        (Misjudged, "not a subclass of .*Evaluation"),
        (Nowhere, "cannot be loaded: .*Evaluator"),
        (OfStranger, r"quantities is Quantity\(.*\): write a list, as in quantities = \[Quantity\(…\)\]"),
        (OfFormer, r"truth takes other arguments than \(self, agent, quantity, index, time_ns\)"),
    ],
)
def test_a_class_that_is_no_evaluation_is_refused(kind: type[Agent], reason: str) -> None:
    """The message names the kind."""
    with pytest.raises(BadInput, match=rf"evaluation of agent kind .*{kind.__name__}.*?:? {reason}"):
        evaluation_class(f"{kind.__module__}:{kind.__qualname__}")


class Careless(Evaluation):
    """Answers as a test asks."""

    answers: ClassVar[Mapping[str, Any]] = {}
    calls_base: ClassVar[bool] = True

    def __init__(self, *given: Any) -> None:
        if self.calls_base:
            super().__init__(*given)

    def central_estimate(self, agent: str, quantity: str, index: int, time_ns: int) -> Any:
        """Of the counts of 1 alone."""
        return self.answers.get(quantity) if agent == "1" else None


class Surveyor(Agent):
    """Reports a count and its variance."""

    evaluation = Careless

    def on_sample(self, sample: Sample) -> None:
        """Twice the same."""
        self.context.report("count", [1.0, 2.0], sample.index, covariance=np.eye(2))


@pytest.mark.parametrize(
    ("answers", "quantity", "message"),
    [
        (
            {"count": "many"},
            Quantity("count"),
            "agent 1: the central estimate of 'count' is 'many', and not real numbers",
        ),
        ({"count": 1.0}, Quantity("count"), "agent 1: the central estimate of 'count' has 1 components, .* report 2"),
        (
            {"count/covariance": -np.eye(2)},
            Quantity("count"),
            "agent 1: the central estimate of 'count/covariance' has the variance -1",
        ),
        (
            {},
            Quantity("count", difference=lambda one, _: one.sum()),
            r"'count': its difference of arrays \(5, 2\) has the shape \(\), and must be \(…, m\)",
        ),
        (None, Quantity("count"), r"evaluation Careless: __init__ must call super\(\).__init__\(plan, world_reports\)"),
    ],
)
def test_what_an_evaluation_says_is_checked(
    answers: Mapping[str, Any] | None,
    quantity: Quantity,
    message: str,
    plan_of: PlanOf,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In one sentence, with agent and quantity named."""
    monkeypatch.setattr(Careless, "answers", answers or {})
    monkeypatch.setattr(Careless, "calls_base", answers is not None)
    monkeypatch.setattr(Careless, "quantities", (quantity,))
    plan = replace(plan_of([("1", "2")], 450, kind=Surveyor), world=Ramp())
    with pytest.raises(BadInput, match=f"^{message}"):
        recorded(plan)


@pytest.mark.parametrize(
    ("method", "answer", "message"),
    [
        ("findings", ["good"], r"evaluation Careless: findings has 'good': return a list of Finding\(…\)"),
        ("view", {"1": [0.0, 0.0]}, r"evaluation Careless: view returned {'1': \[0.0, 0.0\]}: return a View, or None"),
        ("instant", 1.5, "agent 1: the instant of 'count' is 1.5, of type float, and not a whole number"),
    ],
)
def test_what_a_method_of_an_evaluation_returns_is_checked(
    method: str, answer: Any, message: str, plan_of: PlanOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In one sentence, with the class or the agent named."""
    monkeypatch.setattr(Careless, method, lambda *_: answer)
    plan = replace(plan_of([("1", "2")], 450, kind=Surveyor), world=Ramp())
    with pytest.raises(BadInput, match=f"^{message}"):
        recorded(plan)


def test_findings_and_views_that_are_none_are_refused_where_they_are_made() -> None:
    """So that the error comes with the user's line."""
    with pytest.raises(BadInput, match="finding 'x': value is 'warm', and no number: words go into text="):
        Finding("x", "warm")  # type: ignore[arg-type]
    with pytest.raises(BadInput, match="finding 'x': name, unit and text must be texts"):
        Finding("x", text=3)  # type: ignore[arg-type]
    with pytest.raises(BadInput, match=r"view: the place of '1' has the shape \(1,\): give x and y in metres"):
        View({"1": np.zeros(1)})
    with pytest.raises(BadInput, match=r"view: the covariance of '1' has the shape \(3, 3\): give that of x"):
        View({"1": np.zeros(2)}, {"1": np.eye(3)})
