"""Realtime pace by a clock that the test holds: whether a fault is armed in time, and when frames arrive."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace

import pytest

from volery.agents.journal import Arrived, Heard
from volery.agents.node import Node
from volery.agents.plan import AgentPlan, Plan
from volery.agents.realtime_pace import Realtime
from volery.agents.run_start import RunStart
from volery.kinds import NoParameters
from volery.transport.faults import LinkFault
from volery.transport.frames import Frame
from volery.transport.links import LinkSettings

MS = 1_000_000
CUT = LinkFault("f1", 0, None, (("1", "2"),), {"cut": True})


@pytest.fixture
def clock_ns(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The monotonic clock, to be set."""
    now_ns = [100 * MS]
    monkeypatch.setattr("time.monotonic_ns", lambda: now_ns[0])
    return now_ns


def at_speed(speed: float, check: Callable[[Realtime, Node], None]) -> None:
    """Check a pacer of agent 1, which has a neighbour 2 and does nothing; its epoch is 0 on the clock."""
    kind = "volery.agents.agent:Agent"
    agents = tuple(AgentPlan(a, kind, NoParameters(), (b,), {a: 1, b: 1}) for a, b in (("1", "2"), ("2", "1")))
    links = {("1", "2"): LinkSettings(), ("2", "1"): LinkSettings()}

    def unguarded(handle: Callable[[], None]) -> Callable[[], None]:
        return handle

    async def run() -> None:
        loop = asyncio.get_running_loop()
        pacer = Realtime(loop, lambda *_: None, lambda: None, unguarded, speed)
        node = Node(Plan("bench", 1, 10_000 * MS, agents, links), "1", [], pacer.put)
        pacer.begin(node, RunStart(0, 10_000 * MS))
        check(pacer, node)
        pacer.close()

    asyncio.run(run())


def arm_at(pacer: Realtime, at_ms: int) -> bool:
    """Arm the cut for an instant."""
    return pacer.arm([replace(CUT, at_ns=at_ms * MS)], at_ms * MS)


def test_a_fault_that_moves_is_late_once_its_first_instant_has_passed(clock_ns: list[int]) -> None:
    """A later instant mends nothing where the earlier one had its effect; before that it does. An end has its own."""

    def check(pacer: Realtime, _: Node) -> None:
        assert not arm_at(pacer, 50)
        assert not arm_at(pacer, 200)
        again = replace(CUT, id="f2")
        assert pacer.arm([replace(again, at_ns=200 * MS)], 200 * MS)
        assert pacer.arm([replace(again, at_ns=300 * MS)], 300 * MS)
        clock_ns[0] = 350 * MS
        assert not pacer.arm([replace(again, at_ns=400 * MS)], 400 * MS)
        assert pacer.arm([replace(again, at_ns=400 * MS, until_ns=500 * MS)], 500 * MS)

    at_speed(1.0, check)


def test_arrivals_are_journalled_by_the_wall_clock(clock_ns: list[int]) -> None:
    """At twice the speed 103 ms on the clock are 206 ms: a frame comes then, due at 202 ms, and is handed at 220 ms.

    Another that comes in time is handed over once it is due; one that the link lost has come all the same.
    """

    def frame(sequence: int, due_ms: int, verdict: str = "delivered") -> Frame:
        start_ns = (due_ms - 1) * MS
        return Frame(0, sequence, start_ns, 0, due_ms * MS, verdict, b"", sequence + 1, None, 0)

    def check(pacer: Realtime, node: Node) -> None:
        clock_ns[0] = 103 * MS
        pacer.arrived("2", frame(0, 202))
        pacer.arrived("2", frame(1, 230, "loss"))
        clock_ns[0] = 110 * MS
        pacer.advance()
        clock_ns[0] = 116 * MS
        pacer.advance()
        journal = node.take_journal()
        assert journal.arrived == [Arrived("2", 0, 0, 206 * MS, 220 * MS), Arrived("2", 0, 1, 206 * MS, 232 * MS)]
        assert journal.heard == [Heard("2", 0, 0, 202 * MS, "delivered"), Heard("2", 0, 1, 230 * MS, "loss")]

    at_speed(2.0, check)
