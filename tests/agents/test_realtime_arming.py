"""Arming a live fault in realtime pace: whether there was time left, told by a clock that the test holds."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace

import pytest

from volery.agents.agent import NoParameters
from volery.agents.node import Node
from volery.agents.pacing import Realtime
from volery.agents.plan import AgentPlan, Plan
from volery.agents.run_start import RunStart
from volery.transport.faults import LinkFault
from volery.transport.links import LinkSettings

MS = 1_000_000
CUT = LinkFault("f1", 0, None, (("1", "2"),), {"cut": True})


def arm_at(pacer: Realtime, at_ms: int) -> bool:
    """Arm the cut for an instant."""
    return pacer.arm([replace(CUT, at_ns=at_ms * MS)], at_ms * MS)


def test_a_fault_that_moves_is_late_once_its_first_instant_has_passed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A later instant mends nothing where the earlier one had its effect; before that it does. An end has its own."""
    now_ns = [100 * MS]
    monkeypatch.setattr("volery.agents.pacing.time.monotonic_ns", lambda: now_ns[0])
    kind = "volery.agents.agent:Agent"
    agents = tuple(AgentPlan(a, kind, NoParameters(), (b,), {a: 1, b: 1}) for a, b in (("1", "2"), ("2", "1")))
    links = {("1", "2"): LinkSettings(), ("2", "1"): LinkSettings()}

    def as_it_is(handle: Callable[[], None]) -> Callable[[], None]:
        return handle

    async def check() -> None:
        loop = asyncio.get_running_loop()
        pacer = Realtime(loop, lambda *_: None, lambda: None, as_it_is, 1.0)
        node = Node(Plan("bench", 1, 10_000 * MS, agents, links), "1", [], pacer.put)
        pacer.begin(node, RunStart(0, 10_000 * MS))
        assert not arm_at(pacer, 50)
        assert not arm_at(pacer, 200)
        again = replace(CUT, id="f2")
        assert pacer.arm([replace(again, at_ns=200 * MS)], 200 * MS)
        assert pacer.arm([replace(again, at_ns=300 * MS)], 300 * MS)
        now_ns[0] = 350 * MS
        assert not pacer.arm([replace(again, at_ns=400 * MS)], 400 * MS)
        assert pacer.arm([replace(again, at_ns=400 * MS, until_ns=500 * MS)], 500 * MS)
        pacer.close()

    asyncio.run(check())
