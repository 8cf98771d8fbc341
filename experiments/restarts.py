"""Next lives of agents that faults have killed."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from ..transport.faults import Kill

if TYPE_CHECKING:
    from .swarm import Swarm

_STANDBY_S = 2.0
_STATE_TIMEOUT_S = 10.0


class Restarts:
    """Brings agents of one swarm back. `due`: agent → when it will be, for restarts that are yet to come."""

    def __init__(self, swarm: Swarm) -> None:
        self._swarm = swarm
        self.due: dict[str, int] = {}

    async def standby(self, name: str) -> tuple[str, int]:
        """A new process for an agent, joined but not yet alive in nominal time."""
        _, incarnation = self._swarm.current(name)
        key = (name, incarnation + 1)
        await self._prepare(key)
        return key

    async def _prepare(self, key: tuple[str, int]) -> None:
        self._swarm.spawn(*key)
        await self._swarm.joined([key])
        if self._swarm.pace == "realtime":
            await self._swarm.order({"do": "rehearse"}, *key)

    async def revive(self, key: tuple[str, int], kill: Kill, start_ns: int) -> None:
        """Let a process on standby live from an instant on, the end of a kill, with what that has kept.

        The caller holds `intervening`.
        """
        name, incarnation = key
        saved = None
        if kill.keep_state:
            async with asyncio.timeout(_STATE_TIMEOUT_S):
                saved = await self._swarm.member(name, incarnation - 1).state
        self.due.pop(name, None)
        await self._swarm.bring_to_life(key, start_ns, saved)

    def later(self, kill: Kill, incarnation: int | None = None) -> None:
        """An agent comes back when the fault that kills it ends, if that is in the run; by default as its next life."""
        if incarnation is None:
            incarnation = self._swarm.current(kill.agent)[1] + 1
        if kill.until_ns is not None and kill.until_ns < self._swarm.end_ns:
            self.due[kill.agent] = kill.until_ns
            self._swarm.background(self._at(kill, kill.until_ns, incarnation))

    async def _at(self, kill: Kill, until_ns: int, incarnation: int) -> None:
        """In realtime pace the process stands by beforehand; in lockstep everybody waits for it."""
        swarm, key = self._swarm, (kill.agent, incarnation)
        if swarm.pace == "realtime":
            await asyncio.sleep(max(0.0, (until_ns - swarm.ahead_ns(_STANDBY_S)) / 1e9 / swarm.speed))
        else:
            await swarm.member(kill.agent, incarnation - 1).ended.wait()
        if (kill.agent, incarnation - 1) not in swarm.gone:
            await self._prepare(key)
            async with swarm.intervening:
                await self.revive(key, kill, until_ns)
