"""Clearing live faults in a run that is further than what its supervisor knows of it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from volery.agents.plan import Plan
from volery.agents.plan_codec import decode_value
from volery.experiments.swarm.live_faults import Injector
from volery.transport.faults import Fault, LinkFault

MS = 1_000_000


def cut(name: str, at_ms: int, until_ms: int | None) -> LinkFault:
    """A cut of one link."""
    return LinkFault(name, at_ms * MS, None if until_ms is None else until_ms * MS, (("1", "2"),), {"cut": True})


class Frozen:
    """A swarm that was last heard of at 200 ms, and whose agents have come to 500 ms when they are frozen."""

    pace, end_ns = "lockstep", 1000 * MS

    def __init__(self, plan: Plan, *faults: Fault) -> None:
        self.interventions: list[int] = []
        self.plan, self.live_faults = plan, {fault.id: fault for fault in faults}
        self.intervening, self.over = asyncio.Lock(), asyncio.Event()
        self.status = SimpleNamespace(alive={"1", "2"}, used=set())
        self.events: list[dict[str, Any]] = []
        self.armed: list[Fault] = []
        self.sink = SimpleNamespace(event=self.events.append)

    def now_ns(self) -> int:
        """What is known."""
        return 200 * MS

    async def order(self, order: dict[str, Any]) -> dict[tuple[str, int], Any]:
        """Answers of both agents."""
        self.armed += map(decode_value, order.get("faults", ()))
        return {(name, 0): {"freeze": 500 * MS}.get(order["do"], True) for name in "12"}


def test_what_is_over_when_the_agents_are_frozen_is_not_prolonged(plan_of: Callable[..., Plan]) -> None:
    """Of four cuts of a link one has ended at 300 ms and one at 400 ms, where agents have put it back already."""
    faults = (cut("f1.1", 100, 300), cut("f1.2", 350, 400), cut("f1.3", 450, 700), cut("f1.4", 900, 950))
    swarm = Frozen(plan_of([("1", "2")]), *faults)
    injector = Injector(swarm)  # type: ignore[arg-type]
    assert asyncio.run(injector.clear(["f1"])) == "cleared f1"
    instant_ns = 500 * MS + 1
    assert [(fault.id, fault.until_ns) for fault in swarm.armed] == [("f1.3", instant_ns), ("f1.4", instant_ns)]
    assert [(event["event"], event["id"]) for event in swarm.events] == [("cleared", "f1.3"), ("cleared", "f1.4")]
    assert [fault.until_ns for fault in swarm.live_faults.values()] == [300 * MS, 400 * MS, instant_ns, instant_ns]
