"""One node by itself: its events are taken off the heap by hand, as the shell of a process does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from volery.agents import receiver
from volery.agents.agent import (
    Agent,
    FrameTooLarge,
    NotANeighbour,
    Received,
    Sample,
    Timer,
)
from volery.agents.journal import Batch, Dropped, Estimate, Heard, Late, Sent
from volery.agents.node import Node
from volery.agents.plan import AgentPlan, Plan
from volery.errors import BadInput, RunFailed
from volery.kinds import NoParameters
from volery.transport import fabric
from volery.transport.events import Event
from volery.transport.faults import ClockFault, Fault, Kill, LinkFault, Pause
from volery.transport.frames import AirFrame, Frame, Message
from volery.transport.links import HALF_DUPLEX, LinkSettings, Queue
from volery.transport.media_settings import HalfDuplex
from volery.transport.propagation import Copy

MS = 1_000_000


class Listener(Agent):
    """Remembers what it was told, and when; acts only by what a test makes it do."""

    def start(self) -> None:
        """Begin with nothing."""
        self.heard: list[tuple[str, int, int]] = []
        self.react: Callable[[], None] = lambda: None

    def on_frame(self, frame: Received) -> None:
        """Remember and react."""
        self.heard.append((frame.payload.decode(), frame.time_ns, self.context.now_ns))
        self.react()

    def on_timer(self, timer: Timer) -> None:
        """Remember and react."""
        self.heard.append((timer.name, timer.time_ns, self.context.now_ns))
        self.react()


class Promising(Listener):
    """Says that it acts on timers and samples only."""

    timers_only = True


class Bench:
    """A node 1 with neighbours 2 and 3, its heap, and what it put."""

    def __init__(self, kind: type[Agent] = Listener, settings: LinkSettings | None = None, *faults: Fault) -> None:
        name = f"{kind.__module__}:{kind.__qualname__}"
        neighbours = {"1": ("2", "3"), "2": ("1",), "3": ("1",)}
        links = {(a, b): settings or LinkSettings() for a, others in neighbours.items() for b in others}
        agents = tuple(
            AgentPlan(agent, name, NoParameters(), others, {"1": 2, "2": 1, "3": 1}, (0.5, 0.0), MS)
            for agent, others in neighbours.items()
        )
        self.plan = Plan("bench", 3, 1000 * MS, agents, links, None, faults)
        self.heap: list[Event] = []
        self.put: list[tuple[str, Message]] = []
        self.node = Node(self.plan, "1", self.heap, lambda target, frame: self.put.append((target, frame)))
        assert isinstance(self.node.agent, Listener)
        self.agent = self.node.agent

    def until(self, time_ms: int) -> None:
        """Handle all that comes before an instant."""
        fabric.run(self.heap, time_ms * MS)

    def frame(self, due_ms: int, text: str = "x", source: str = "2", sequence: int = 0) -> None:
        """The network brings a frame that is due at an instant."""
        start_ns = (due_ms - 1) * MS
        frame = Frame(0, sequence, start_ns, 0, due_ms * MS, "delivered", text.encode(), sequence + 1, None)
        self.node.receiver.receive(source, frame)

    def timer(self, at_ms: int, react: Callable[[], None]) -> None:
        """Do something in a timer of the agent at an instant."""
        self.agent.react = react
        self.node.run_handler(self.agent.context.set_timer, at_ms * MS, "do")
        self.until(at_ms + 1)
        self.agent.react = lambda: None


def test_a_frame_waits_until_it_is_due() -> None:
    """However early the network brings it, it is handled at its instant, in the order of instants and names."""
    bench = Bench()
    for due, text, source in ((9, "later", "3"), (9, "late", "2"), (5, "soon", "3")):
        bench.frame(due, text, source)
    bench.until(8)
    assert bench.agent.heard == [("soon", 5 * MS, 5 * MS)]
    bench.until(10)
    assert [text for text, _, _ in bench.agent.heard] == ["soon", "late", "later"]
    assert bench.node.state.journal.late == []


def test_a_late_frame_is_handled_at_once_and_named() -> None:
    """It came after something later was handled: the agent gets it, time does not go back, and the journal tells."""
    bench = Bench()
    bench.frame(20, "first", sequence=0)
    bench.until(21)
    bench.frame(12, "late", sequence=1)
    assert bench.agent.heard == [("first", 20 * MS, 20 * MS), ("late", 12 * MS, 20 * MS)]
    assert bench.node.state.now_ns == 20 * MS
    assert bench.node.state.journal.late == [Late("2", 0, 1, 12 * MS, 8 * MS)]
    assert [entry.fate for entry in bench.node.state.journal.heard] == ["delivered", "delivered"]


@pytest.mark.parametrize(
    ("start_ms", "airtime_ms", "is_late"), [(8, 3, True), (13, 2, True), (7, 3, False), (14, 3, False)]
)
def test_a_transmission_heard_too_late_makes_the_frame_late_that_it_destroys(
    start_ms: int, airtime_ms: int, is_late: bool
) -> None:
    """A frame was on the air from 10 ms until 14 ms and has been handled; then another turns out to have overlapped."""
    bench = Bench(settings=LinkSettings(medium=HalfDuplex("node")))
    copies = {"1": (Copy("1", 0, 0, 15 * MS, "delivered"),)}
    bench.node.receiver.receive("2", AirFrame(0, 0, 10 * MS, 4 * MS, b"x", 1, None, copies, ()))
    bench.until(20)
    assert [text for text, *_ in bench.agent.heard] == ["x"]
    bench.node.receiver.receive("3", AirFrame(0, 0, start_ms * MS, airtime_ms * MS, b"", 1, None, {}, ()))
    late = Late("2", 0, 0, 15 * MS, 15 * MS - start_ms * MS)
    assert bench.node.state.journal.late == [late] * is_late


def test_what_a_late_frame_causes_comes_after_now() -> None:
    """A timer that it sets for an instant that is over rings at once, and an answer starts `compute` after now."""
    bench = Bench()
    bench.frame(20, sequence=0)
    bench.until(21)

    def react() -> None:
        bench.agent.react = lambda: None
        bench.agent.context.set_timer(15 * MS, "over")
        bench.agent.context.send("2", b"answer")

    bench.agent.react = react
    bench.frame(12, "late", sequence=1)
    bench.frame(20, "now", "3")
    bench.until(30)
    assert bench.agent.heard[-2:] == [("now", 20 * MS, 20 * MS), ("over", 15 * MS, 20 * MS)]
    assert [(target, frame.start_ns) for target, frame in bench.put] == [("2", 21 * MS)]


def test_frames_that_come_in_any_order_during_a_pause_are_sorted() -> None:
    """Who stands still has handled nothing: what comes out of order meanwhile is not late."""
    bench = Bench(Listener, None, Pause("t1", 5 * MS, 50 * MS, "1"))
    bench.until(6)
    for due in (20, 10, 15):
        bench.frame(due, str(due), sequence=due)
        bench.until(due + 1)
    assert bench.node.state.now_ns == 20 * MS
    bench.until(51)
    assert bench.agent.heard == [(str(due), due * MS, 50 * MS) for due in (10, 15, 20)]
    assert bench.node.state.journal.late == []


def test_what_waits_is_stamped_with_the_clock_of_its_arrival() -> None:
    """A clock that jumps while the processor stands still does not change when a frame has come."""
    faults = Pause("t1", 5 * MS, 50 * MS, "1"), ClockFault("t2", 20 * MS, None, "1", 300 * MS)
    bench = Bench(Listener, None, *faults)
    for due in (10, 30):
        bench.frame(due, str(due), sequence=due)
    bench.until(51)
    assert bench.agent.heard == [("10", 10 * MS, 350 * MS), ("30", 330 * MS, 350 * MS)]


def test_a_new_life_reads_its_own_clock_from_the_start() -> None:
    """A clock that is wrong already when an agent comes to life is what its first timers go by."""
    bench = Bench(Listener, None, ClockFault("t1", 5 * MS, None, "1", 300 * MS))
    heap: list[Event] = []
    node = Node(bench.plan, "1", heap, lambda *_: None, incarnation=1, start_ns=10 * MS)
    assert node.agent.context.now_ns == 310 * MS
    node.run_handler(node.agent.context.set_timer, 320 * MS, "soon")
    fabric.run(heap, 21 * MS)
    assert isinstance(node.agent, Listener)
    assert node.agent.heard == [("soon", 320 * MS, 320 * MS)]


def test_frames_are_released_after_the_faults_of_that_instant_and_in_order() -> None:
    """A hold that ends when a pause begins lets frames go into the pause, and those of one instant keep their order."""
    hold = LinkFault("t1", 0, 50 * MS, (("3", "1"), ("2", "1")), {"hold": True})
    bench = Bench(Listener, None, hold, Pause("t2", 50 * MS, 60 * MS, "1"))
    for source in "32":
        bench.frame(10, source, source)
    bench.until(61)
    assert bench.agent.heard == [("2", 50 * MS, 60 * MS), ("3", 50 * MS, 60 * MS)]


def test_a_link_that_always_holds_frames_back_does_so_without_a_fault() -> None:
    """What its own settings say counts from the start; a fault that says otherwise lets them go."""
    free = LinkFault("t1", 50 * MS, None, (("2", "1"),), {"hold": False})
    bench = Bench(Listener, LinkSettings(hold=True), free)
    for source in "23":
        bench.frame(10, source, source)
    bench.until(61)
    assert bench.agent.heard == [("2", 50 * MS, 50 * MS)]


def test_what_is_released_at_the_instant_of_a_death_was_held_to_the_last() -> None:
    """Nobody hears it any more, and the journal tells."""
    hold = LinkFault("t1", 0, 50 * MS, (("2", "1"),), {"hold": True})
    bench = Bench(Listener, None, hold, Kill("t2", 50 * MS, None, "1"))
    bench.frame(10)
    bench.until(61)
    held = {"event": "held", "source": "2", "incarnation": 0, "sequences": [(0, 0)]}
    assert bench.node.state.journal.events == [held, {"event": "killed", "time_ns": 50 * MS}]


def test_a_frame_from_before_its_life_is_not_heard() -> None:
    """A restarted node passes over frames that started before it came to life."""
    bench = Bench()
    node = Node(bench.plan, "1", [], lambda *_: None, incarnation=1, start_ns=10 * MS)
    for start_ns in (10 * MS - 1, 10 * MS):
        node.receiver.receive("2", Frame(0, 0, start_ns, 0, 20 * MS, "delivered", b"", 1, None))
    assert len(node.state.heap) == 1


@pytest.mark.parametrize("what", ["send", "timer"])
def test_acting_on_a_frame_against_ones_word_is_refused(what: str) -> None:
    """An agent that says timers_only may neither send nor set a timer because of a frame; on a timer it may."""
    bench = Bench(Promising)
    context = bench.agent.context

    def act() -> None:
        bench.agent.react = lambda: None
        if what == "send":
            context.send("2", b"x")
        else:
            context.set_timer(context.now_ns)

    bench.timer(2, act)
    bench.frame(10)
    bench.agent.react = act
    with pytest.raises(RunFailed, match="agent 1 failed in on_frame: it acts on a frame, but its class"):
        bench.until(11)


@pytest.mark.parametrize("stranger", ["1", "4"])
def test_only_neighbours_can_be_talked_to(stranger: str) -> None:
    """The message names the stranger and the neighbours; nothing is sent."""
    bench = Bench()
    with pytest.raises(NotANeighbour, match=f"send: there is no link to '{stranger}'; the neighbours are '2', '3'"):
        bench.agent.context.send(stranger, b"x")
    bench.until(100)
    assert bench.put == []


def test_no_timer_for_the_past() -> None:
    """An instant before that of the event in hand is an error; that very instant is fine."""
    bench = Bench()

    def react() -> None:
        bench.agent.react = lambda: None
        with pytest.raises(BadInput, match=r"set_timer: 'x' is set to 4999999 ns, and now is 5000000 ns"):
            bench.agent.context.set_timer(5 * MS - 1, "x")
        bench.agent.context.set_timer(5 * MS, "now")

    bench.timer(5, react)
    assert [name for name, _, _ in bench.agent.heard] == ["do", "now"]


def test_a_timer_that_the_own_clock_has_jumped_over_rings_at_once() -> None:
    """What an agent planned for is over when its clock jumps ahead, which is no error of the agent."""
    bench = Bench(Listener, None, ClockFault("t1", 4 * MS, 20 * MS, "1", offset_ns=10 * MS))

    def react() -> None:
        bench.agent.react = lambda: None
        bench.agent.context.set_timer(8 * MS, "planned")

    bench.agent.react = react
    bench.frame(5)
    bench.until(6)
    assert bench.agent.heard == [("x", 15 * MS, 15 * MS), ("planned", 8 * MS, 15 * MS)]


def test_a_payload_over_the_mtu_is_refused() -> None:
    """The message names both sizes; the frame counts as refused, and those after it go their way."""
    bench = Bench(Listener, LinkSettings(mtu=10))

    def react() -> None:
        with pytest.raises(FrameTooLarge, match="send: 11 B for 2, the link's MTU is 10 B"):
            bench.agent.context.send("2", b"x" * 11)
        bench.agent.context.send("2", b"x" * 10)

    bench.timer(5, react)
    bench.until(10)
    assert bench.node.state.journal.dropped == [Dropped("2", 0, 5 * MS, "refused")]
    assert [sent.sequence for sent in bench.node.state.journal.sent] == [1]


def test_frames_count_what_was_sent() -> None:
    """Each link counts for itself; numbers of dropped frames are missing from it, and the count has no gap."""
    bench = Bench(Listener, LinkSettings(rate=8000.0, queue=Queue(1)))

    def react() -> None:
        for target in "2223":
            bench.agent.context.send(target, b"x" * 5)

    bench.timer(5, react)
    bench.timer(20, react)
    bench.until(100)
    sent = [(target, frame.sequence, frame.sent) for target, frame in bench.put]
    assert sent == [("2", 0, 1), ("3", 0, 1), ("2", 1, 2), ("2", 3, 3), ("3", 1, 2), ("2", 4, 4)]


def test_an_agent_knows_its_place_and_nothing_more() -> None:
    """Name, neighbours, degrees, position, now, and random streams of its own that depend on its life."""
    bench = Bench()
    context = bench.agent.context
    assert (context.name, context.neighbours, context.position, context.now_ns) == ("1", ("2", "3"), (0.5, 0.0), 0)
    assert context.degrees == {"1": 2, "2": 1, "3": 1}
    reborn = Node(bench.plan, "1", [], lambda *_: None, incarnation=1)
    other = Node(replace(bench.plan, seed=4), "1", [], lambda *_: None)
    draws = [node.agent.context.random("phase").uniform(0) for node in (bench.node, reborn, other)]
    assert context.random("phase").uniform(0) == draws[0]
    assert len(set(draws)) == 3


def test_reports_are_flat_numbers() -> None:
    """Whatever is reported is written down as a list of numbers, with the instant and the sample."""
    bench = Bench()
    bench.node.run_handler(bench.agent.context.report, "x", [[1, 2], [3, 4]], 7)
    bench.node.run_handler(bench.agent.context.report, "y", 5)
    assert bench.node.state.journal.estimates == [Estimate(0, "x", 7, [1.0, 2.0, 3.0, 4.0]), Estimate(0, "y", 0, [5.0])]


def test_a_journal_is_taken_once() -> None:
    """What was taken is not told again; a batch survives being taken apart."""
    bench = Bench()
    bench.node.run_handler(bench.agent.context.report, "x", [1.0])
    batch = bench.node.take_journal()
    assert batch
    assert not bench.node.take_journal()
    batch.sent.append(Sent("2", 0, 1, 2, 3, 4, "loss"))
    batch.heard.append(Heard("2", 0, 1, 2, "cut"))
    batch.dropped.append(Dropped("2", 0, 1, "queue"))
    batch.late.append(Late("2", 0, 1, 2, 3))
    batch.events.append({"event": "killed", "time_ns": 5})
    plain = batch.to_dict()
    for name in ("estimates", "sent", "heard", "dropped", "late"):
        plain[name] = [list(entry) for entry in plain[name]]
    assert Batch.from_dict(plain) == batch


def test_an_agent_that_overrides_nothing_takes_everything() -> None:
    """The base class ignores what comes, and tells nothing beforehand."""
    agent = Agent(Bench().agent.context, NoParameters())
    agent.start()
    agent.on_sample(Sample("s", 0, 0, None))
    agent.on_frame(Received("2", b"", 0))
    agent.on_timer(Timer("", 0, 0))
    assert Agent.largest_payload(NoParameters()) is Agent.sends_per_second(NoParameters()) is None
    assert not Agent.problems(Bench().plan)


def test_what_may_be_asked_for_is_remembered_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the wall clock, where frames may be late: only the order of each neighbour's frames tells what cannot come."""
    monkeypatch.setattr(receiver, "TIDY_EVERY", 1)
    bench = Bench(Listener, LinkSettings(medium=HalfDuplex(), rate=8000.0))
    transceiver = bench.node.sender.outlets["2"].transceiver

    def send(at_ms: int) -> None:
        bench.timer(at_ms, lambda: bench.agent.context.send("2", b"5 ms"))
        bench.until(at_ms + 10)

    send(10)
    send(100)
    assert len(transceiver) == 2
    bench.frame(13, "late", "2", sequence=0)
    assert [entry.fate for entry in bench.node.state.journal.heard] == [HALF_DUPLEX]
    bench.frame(111, "in order", "2", sequence=1)
    bench.until(112)
    send(200)
    assert len(transceiver) == 3
    bench.frame(211, "in order", "3", sequence=0)
    bench.until(212)
    send(300)
    assert len(transceiver) == 2
