"""Runs in the twin: repeatable, undisturbed by what does not concern them, and exact about instants."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import pytest

from volery.agents.agent import Agent, Received, Sample, Timer
from volery.agents.plan import AgentPlan, Plan, World
from volery.experiments.analysis.accounting import account
from volery.experiments.record.record import Collector, Record
from volery.experiments.twin import Twin
from volery.transport.faults import Fault, Kill, LinkFault, LinkName, Pause
from volery.transport.latency_settings import Constant, Normal
from volery.transport.links import LinkSettings, Queue
from volery.transport.loss_settings import Bernoulli
from volery.transport.media_settings import Aloha, HalfDuplex, Tdma

MS = 1_000_000
QUICK = LinkSettings(latency=Constant(5 * MS))
PlanOf = Callable[..., Plan]
Run = Callable[[Plan], Record]


@dataclass(frozen=True)
class Script:
    """What a scripted agent sends, as (instant in ms, target, payload), and what it answers a frame with, if at all."""

    sends: tuple[tuple[float, str, bytes], ...] = ()
    answer: bytes = b""


class Scripted(Agent):
    """Sends by its script, and writes down what happens to it, with the instant at which it is told."""

    Parameters = Script
    parameters: Script

    def start(self) -> None:
        """Set a timer for every line of the script that is still to come."""
        self.log: list[tuple[str, str, int]] = []
        for number, (at_ms, target, _) in enumerate(self.parameters.sends):
            if at_ms * MS >= self.context.now_ns:
                self.context.set_timer(round(at_ms * MS), target, number)

    def _note(self, what: str, name: str) -> None:
        self.log.append((what, name, self.context.now_ns))
        self.context.report(what, 0.0, len(self.log))

    def on_timer(self, timer: Timer) -> None:
        """Send the line."""
        self._note("timer", str(timer.index))
        if timer.name:
            self.context.send(timer.name, self.parameters.sends[timer.index][2])

    def on_frame(self, frame: Received) -> None:
        """Write it down, and answer."""
        self._note("frame", frame.payload.decode())
        if self.parameters.answer:
            self.context.send(frame.source, self.parameters.answer)

    def on_sample(self, sample: Sample) -> None:
        """Write it down."""
        self._note("sample", sample.sensor)


def play(plan: Plan) -> tuple[dict[str, list[tuple[str, str, int]]], Record]:
    """Run a plan of scripted agents: what each wrote down in its last life, and the record."""
    collector = Collector()
    twin = Twin(plan, collector)
    twin.run()
    logs = {}
    for name, node in twin.nodes.items():
        assert isinstance(node.agent, Scripted)
        logs[name] = node.agent.log
    return logs, collector.record(plan)


@pytest.fixture(name="script_of")
def script_of_fixture(plan_of: PlanOf) -> PlanOf:
    """Make a plan of two scripted agents: `script_of({"1": Script(…)}, settings, faults, compute_ns=…, world=…)`."""

    def make(
        scripts: dict[str, Script],
        settings: LinkSettings | dict[LinkName, LinkSettings] = QUICK,
        faults: Sequence[Fault] = (),
        compute_ns: int = 0,
        world: World | None = None,
    ) -> Plan:
        parameters = {"1": Script(), "2": Script()} | scripts
        plan: Plan = plan_of(
            [("1", "2")], Scripted, settings, faults, 100, parameters=parameters, compute_ns=compute_ns, world=world
        )
        return plan

    return make


def frames_heard(log: Sequence[tuple[str, str, int]]) -> list[tuple[str, float]]:
    """The payloads that came, with their instants in ms."""
    return [(name, time_ns / MS) for what, name, time_ns in log if what == "frame"]


def fates(record: Record, agent: str, incarnation: int = 0) -> list[str]:
    """What became of the frames that one agent heard."""
    return [heard.fate for heard in record.batches[agent, incarnation].heard]


# -- the same seed, and what does not concern a link -----------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_the_same_seed_gives_the_same_trace(
    seed: int, drawn_plan: PlanOf, mortal: PlanOf, answerer: type[Agent], twin_run: Run
) -> None:
    """Two runs of one plan write down the same entries, in the same order."""
    plan = mortal(drawn_plan(answerer, seed), seed)
    assert twin_run(plan).batches == twin_run(plan).batches


def test_another_seed_gives_another_trace(plan_of: PlanOf, talker: type[Agent], twin_run: Run) -> None:
    """Losses are drawn from the seed of the run."""
    plans = [plan_of([("1", "2")], talker, LinkSettings(loss=(Bernoulli(0.5),)), seed=seed) for seed in (1, 2)]
    first, second = ([fates(twin_run(plan), name) for name in "12"] for plan in plans)
    assert first != second


NOISY = LinkSettings(loss=(Bernoulli(0.4),), latency=Normal(5 * MS, MS), rate=1e6)


def draws(record: Record, link: LinkName) -> list[tuple[int, int]]:
    """Sequence number and travel time, which is drawn for every frame, of what a link carried."""
    sent = [entry for entry in record.batches[link[0], 0].sent if entry.target == link[1]]
    return [(entry.sequence, entry.due_ns - entry.start_ns - entry.airtime_ns) for entry in sent]


def test_one_agent_more_shifts_nobodys_draws(plan_of: PlanOf, talker: type[Agent], twin_run: Run) -> None:
    """With a new neighbour of agent 3, every other link sends and draws as before; 3's own links draw as before."""
    small, large = (
        twin_run(plan_of(edges, talker, NOISY))
        for edges in ([("1", "2"), ("2", "3")], [("1", "2"), ("2", "3"), ("3", "4")])
    )
    assert small.batches["1", 0].sent == large.batches["1", 0].sent
    assert small.batches["2", 0].sent == large.batches["2", 0].sent
    assert draws(small, ("3", "2")) == draws(large, ("3", "2"))
    assert len(draws(small, ("3", "2"))) > 10


def test_a_fault_shifts_nobodys_draws(plan_of: PlanOf, talker: type[Agent], twin_run: Run) -> None:
    """A cut link goes on counting: it draws for later frames what it would have drawn; other links do not notice."""
    edges, cut = [("1", "2"), ("2", "3")], LinkFault("t1", 80 * MS, 160 * MS, (("2", "3"),), {"cut": True})
    whole, faulty = (twin_run(plan_of(edges, talker, NOISY, faults)) for faults in ([], [cut]))
    assert whole.batches["1", 0].sent == faulty.batches["1", 0].sent
    assert draws(whole, ("2", "3")) == draws(faulty, ("2", "3"))
    pairs = list(zip(whole.batches["2", 0].sent, faulty.batches["2", 0].sent, strict=True))
    for before, after in pairs:
        inside = after.target == "3" and 80 * MS <= after.start_ns < 160 * MS
        assert after == (before._replace(verdict="cut") if inside else before)
    assert {after.verdict for _, after in pairs} == {"cut", "loss", "delivered"}


# -- instants --------------------------------------------------------------------------------------------------------


def test_faults_hold_from_their_start_until_before_their_end(script_of: PlanOf) -> None:
    """A frame that starts at the start of a cut is cut; one that starts at its end is not."""
    sends = tuple((at, "2", str(at).encode()) for at in (9, 10, 19, 20))
    cut = LinkFault("t1", 10 * MS, 20 * MS, (("1", "2"),), {"cut": True})
    logs, record = play(script_of({"1": Script(sends)}, faults=[cut]))
    assert frames_heard(logs["2"]) == [("9", 14.0), ("20", 25.0)]
    assert fates(record, "2") == ["delivered", "cut", "cut", "delivered"]


def test_settings_are_read_at_the_start_of_a_transmission(script_of: PlanOf) -> None:
    """What is under way when the latency changes keeps its own: it may even be overtaken."""
    slow = LinkFault("t1", 0, 20 * MS, (("1", "2"),), {"latency": Constant(30 * MS)})
    logs, _ = play(script_of({"1": Script(((19, "2", b"old"), (20, "2", b"new")))}, faults=[slow]))
    assert frames_heard(logs["2"]) == [("new", 25.0), ("old", 49.0)]


def test_events_of_one_instant_have_an_order(script_of: PlanOf, probe: World) -> None:
    """First the frame, then the sensor, which sorts behind by name, then timers in the order in which they were set."""
    sends = ((15.0, "2", b"from 1"),)
    plan = script_of({"1": Script(sends), "2": Script(((20.0, "", b""), (20.0, "", b"")))}, world=probe)
    logs, _ = play(plan)
    assert [entry[:2] for entry in logs["2"] if entry[2] == 20 * MS] == [
        ("frame", "from 1"),
        ("sample", "probe"),
        ("timer", "0"),
        ("timer", "1"),
    ]


def test_a_fault_comes_before_everything_else_of_its_instant(script_of: PlanOf) -> None:
    """A frame due when its receiver dies is not heard; one that was due a nanosecond before is."""
    kill = Kill("t1", 20 * MS, None, "2")
    for at_ns, expected in ((15 * MS, []), (15 * MS - 1, ["delivered"])):
        _, record = play(script_of({"1": Script(((at_ns / MS, "2", b"x"),))}, faults=[kill]))
        assert fates(record, "2") == expected


def test_compute_passes_before_anything_is_offered(script_of: PlanOf) -> None:
    """What an agent sends because of a timer or a frame starts `compute` later."""
    scripts = {"1": Script(((10, "2", b"ping"),)), "2": Script(answer=b"pong")}
    logs, record = play(script_of(scripts, compute_ns=2 * MS))
    assert [sent.start_ns / MS for name in "12" for sent in record.batches[name, 0].sent] == [12.0, 19.0]
    assert frames_heard(logs["1"]) == [("pong", 24.0)]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [({}, "half-duplex"), ({"loss": (Bernoulli(1.0),)}, "half-duplex"), ({"cut": True}, "cut")],
)
def test_the_first_of_causes_that_overlap_counts(script_of: PlanOf, changes: dict[str, Any], expected: str) -> None:
    """Both ends of an edge talk at once: both frames are gone, whatever else may have befallen them but a cut."""
    settings = LinkSettings(medium=HalfDuplex(access=Aloha()), rate=8000.0, latency=Constant(MS), **changes)
    logs, record = play(script_of({"1": Script(((10, "2", b"abc"),)), "2": Script(((12, "1", b"d"),))}, settings))
    assert [fates(record, name) for name in "12"] == [[expected], [expected]]
    assert frames_heard(logs["1"]) == frames_heard(logs["2"]) == []


def test_frames_that_only_touch_do_not_disturb_each_other(script_of: PlanOf) -> None:
    """Three bytes at 1 byte/ms from 10 ms on are off the air at 13 ms; a frame that starts then is heard, like them."""
    settings = LinkSettings(medium=HalfDuplex(access=Aloha()), rate=8000.0, latency=Constant(MS))
    _, record = play(script_of({"1": Script(((10, "2", b"abc"),)), "2": Script(((13, "1", b"d"),))}, settings))
    assert [fates(record, name) for name in "12"] == [["delivered"], ["delivered"]]


# -- pauses, kills, restarts -----------------------------------------------------------------------------------------


def test_who_stands_still_catches_up_in_order(script_of: PlanOf) -> None:
    """All that came in [at, until) is handled at `until`, in order, before what comes then; answers start then."""
    sends = tuple((at, "2", str(at).encode()) for at in (9, 12, 15, 20))
    plan = script_of(
        {"1": Script(sends), "2": Script(((18, "1", b"mine"),))}, faults=[Pause("t1", 14 * MS, 25 * MS, "2")]
    )
    logs, record = play(plan)
    assert logs["2"] == [
        ("frame", "9", 25 * MS),
        ("frame", "12", 25 * MS),
        ("timer", "0", 25 * MS),
        ("frame", "15", 25 * MS),
        ("frame", "20", 25 * MS),
    ]
    assert [sent.start_ns for sent in record.batches["2", 0].sent] == [25 * MS]
    assert [heard.due_ns / MS for heard in record.batches["2", 0].heard] == [14.0, 17.0, 20.0, 25.0]


def test_pauses_that_overlap_last_until_the_later_end(script_of: PlanOf) -> None:
    """Standing still ends when no pause is in force any more."""
    pauses = [
        Pause("t1", 10 * MS, 30 * MS, "2"),
        Pause("t2", 20 * MS, 40 * MS, "2"),
        Pause("t3", 40 * MS, 41 * MS, "2"),
    ]
    logs, _ = play(script_of({"1": Script(((8, "2", b"x"),))}, faults=pauses))
    assert frames_heard(logs["2"]) == [("x", 41.0)]


def test_a_periodic_agent_survives_a_pause(plan_of: PlanOf, talker: type[Agent], twin_run: Run) -> None:
    """Timers that it sets while catching up, for instants that are over, ring at once: no period is left out."""
    record = twin_run(plan_of([("1", "2")], talker, faults=[Pause("t1", 60 * MS, 180 * MS, "2")]))
    reports = record.estimates("sum")
    assert reports["2"].sample.tolist() == reports["1"].sample.tolist() == list(range(1, 12))
    assert reports["2"].time_ns.tolist() == [
        max(time, 180 * MS) if time >= 60 * MS else time for time in reports["1"].time_ns
    ]


def test_the_dead_do_nothing(script_of: PlanOf) -> None:
    """Nothing is heard, sent or rung from the kill on; what waited for the transmitter is told."""
    slow = LinkSettings(rate=8000.0)
    sends = ((10, "2", b"x" * 8), (11, "2", b"waits"), (30, "2", b"never"))
    _, record = play(
        script_of({"1": Script(sends), "2": Script(((13, "1", b"y"),))}, slow, [Kill("t1", 14 * MS, None, "1")])
    )
    one = record.batches["1", 0]
    assert [sent.start_ns for sent in one.sent] == [10 * MS]
    assert one.events == [
        {"event": "queued", "target": "2", "sequences": [1]},
        {"event": "killed", "time_ns": 14 * MS},
    ]
    assert one.heard == []
    assert fates(record, "2") == ["delivered"]
    assert {link: dict(counts.lost) for link, counts in account(record).items()} == {
        ("1", "2"): {"sender-down": 1},
        ("2", "1"): {"receiver-down": 1},
    }


@pytest.mark.parametrize(("at", "heard"), [(36.0, False), (40 - 1e-6, False), (40.0, True)])
def test_a_restarted_agent_hears_what_starts_from_then_on(script_of: PlanOf, at: float, heard: bool) -> None:
    """A frame that started before the restart is lost on its receiver, even if it is due after it."""
    sends = ((12, "2", b"before"), (at, "2", b"x"))
    logs, record = play(script_of({"1": Script(sends)}, faults=[Kill("t1", 20 * MS, 40 * MS, "2")]))
    assert frames_heard(logs["2"]) == ([("x", 45.0)] if heard else [])
    assert fates(record, "2") == ["delivered"]
    assert [event for event in record.events if event["event"] == "restarted"] == [
        {"event": "restarted", "agent": "2", "incarnation": 1, "time_ns": 40 * MS}
    ]
    assert dict(account(record)["1", "2"].lost) == ({} if heard else {"receiver-down": 1})


def test_a_restart_meets_the_faults_in_force(script_of: PlanOf) -> None:
    """Cuts and pauses that began while it was down hold for the new incarnation too; its frames count from 0."""
    faults = [
        Kill("t1", 10 * MS, 40 * MS, "1"),
        LinkFault("t2", 20 * MS, 50 * MS, (("1", "2"),), {"cut": True}),
        Pause("t3", 30 * MS, 60 * MS, "1"),
    ]
    sends = ((5, "2", b"a"), (45, "2", b"b"))
    _, record = play(script_of({"1": Script(sends)}, faults=faults))
    first, second = record.batches["1", 0].sent, record.batches["1", 1].sent
    assert [(sent.sequence, sent.start_ns / MS, sent.verdict) for sent in (*first, *second)] == [
        (0, 5.0, "delivered"),
        (0, 60.0, "delivered"),
    ]
    _, record = play(script_of({"1": Script(sends)}, faults=faults[:2]))
    assert [sent.verdict for sent in record.batches["1", 1].sent] == ["cut"]


def test_a_frame_at_the_instant_of_a_restart_is_heard(script_of: PlanOf) -> None:
    """The end of a fault lets a waiting frame go at the very instant of a restart: it starts then, so it is heard."""
    both = (("1", "2"), ("2", "1"))
    slots = LinkFault("a", 0, 40 * MS, both, {"medium": HalfDuplex(access=Tdma(10.0))})
    logs, _ = play(script_of({"2": Script(((30, "1", b"x"),))}, faults=[slots, Kill("z", 20 * MS, 40 * MS, "1")]))
    assert frames_heard(logs["1"]) == [("x", 45.0)]


# -- accounts --------------------------------------------------------------------------------------------------------


def test_drops_are_told(script_of: PlanOf) -> None:
    """One frame fits into the queue and one is on the air: what a policy throws out is told, with its instant."""
    settings = LinkSettings(rate=8000.0, queue=Queue(1, "drop-head"))
    sends = tuple((10 + number, "2", b"x" * 20) for number in range(4))
    _, record = play(script_of({"1": Script(sends)}, settings))
    assert [(drop.sequence, drop.time_ns / MS, drop.cause) for drop in record.batches["1", 0].dropped] == [
        (1, 12.0, "queue"),
        (2, 13.0, "queue"),
    ]
    link = account(record)["1", "2"]
    assert (link.offered, link.queue, link.delivered, link.in_flight, link.closes) == (4, 2, 2, 0, True)


def test_frames_that_wait_leave_one_after_the_other(script_of: PlanOf) -> None:
    """Three frames offered at once, of 2 ms on the air each: as soon as one is off the air, the next starts."""
    sends = tuple((10, "2", b"xx") for _ in range(3))
    _, record = play(script_of({"1": Script(sends)}, LinkSettings(rate=8000.0)))
    assert [sent.start_ns / MS for sent in record.batches["1", 0].sent] == [10.0, 12.0, 14.0]


@pytest.mark.parametrize("seed", range(40))
def test_every_frame_has_one_story(
    seed: int, drawn_plan: PlanOf, mortal: PlanOf, answerer: type[Agent], twin_run: Run
) -> None:
    """Whatever links, faults, kills and restarts do, each link's account closes, and nothing is ever late."""
    record = twin_run(mortal(drawn_plan(answerer, seed), seed))
    assert {link: counts.closes for link, counts in account(record).items()} == dict.fromkeys(record.links(), True)
    assert not any(batch.late for batch in record.batches.values())


def test_agents_are_listed_by_name(plan_of: PlanOf, talker: type[Agent]) -> None:
    """A plan finds its agents and their kills, in the order of their times."""
    kills = [Kill("t2", 9, 10, "2"), Kill("t1", 3, 4, "2"), Kill("t3", 5, None, "1")]
    plan = plan_of([("1", "2")], talker, faults=kills)
    found: AgentPlan = plan.agent("2")
    assert found.neighbours == ("1",)
    assert [kill.id for kill in plan.kills("2")] == ["t1", "t2"]
