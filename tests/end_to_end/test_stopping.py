"""The end of a run that somebody stops."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

import pytest

from volery.agents.plan import Plan
from volery.errors import BadInput
from volery.experiments.record.record import Collector
from volery.experiments.swarm.live_faults import Injector
from volery.experiments.swarm.supervisor import Swarm

from .conftest import LIMIT_S


class Dawdling(Swarm):
    """Gives the last order of a stop only when all agents have reached the end that they were told."""

    async def order(self, order: Mapping[str, Any], *to: Any, **keywords: Any) -> dict[tuple[str, int], Any]:
        """Note when an order is given and when it is answered."""
        if order["do"] == "thaw":
            await self.over.wait()
        self.orders = [*getattr(self, "orders", []), order["do"]]
        answers = await super().order(order, *to, **keywords)
        self.orders.append(f"{order['do']} answered")
        return answers


def test_a_run_does_not_end_under_an_order(plan_of: Callable[..., Plan]) -> None:
    """Agents may reach the end before the last order of a stop is given: the session stays open for its answers."""

    async def stopped() -> Dawdling:
        collector = Collector()
        swarm = Dawdling(plan_of("dfa4"), collector, "test", "realtime")
        async with asyncio.timeout(LIMIT_S):
            running = asyncio.create_task(swarm.run())
            await swarm.ready.wait()
            await swarm.stop()
            await running
            await swarm.stop()
            with pytest.raises(BadInput, match="the run is over"):
                await Injector(swarm).inject({"cut": "1-2"})
        return swarm

    assert asyncio.run(stopped()).orders[-4:] == ["thaw", "thaw answered", "stop", "stop answered"]
