"""Next lives of agents that faults have killed."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from ...transport.faults import Kill, kills_of

if TYPE_CHECKING:
    from .supervisor import Swarm

_STANDBY_S = 2.0
_LOOK_EVERY_S = 0.02
_STATE_TIMEOUT_S = 10.0


class Restarts:
    """Brings agents of one swarm back. `due`: id → kill whose end is yet to come, and no process stands by for it."""

    def __init__(self, swarm: Swarm) -> None:
        self._swarm = swarm
        self._standing_by: set[str] = set()
        self.due: dict[str, Kill] = {}

    async def standby(self, kill: Kill) -> tuple[str, int]:
        """A new process for the agent of a kill, joined but not yet alive in nominal time."""
        swarm = self._swarm
        self.due.pop(kill.id, None)
        key = (kill.agent, self._life_after(kill))
        swarm.spawn(*key)
        await swarm.joined([key])
        if swarm.pace == "realtime":
            await swarm.order({"do": "rehearse"}, *key)
        return key

    def _life_after(self, kill: Kill) -> int:
        """Lives are numbered by the kills before them, those without a return included: so they are in the twin."""
        kills = kills_of(self._swarm.live_faults.values(), kill.agent)
        return 1 + [other.id for other in kills].index(kill.id)

    async def revive(self, key: tuple[str, int], kill: Kill, start_ns: int) -> None:
        """Let a process on standby live from an instant on, the end of a kill, with what that has kept.

        The caller holds `intervening`.
        """
        saved = None
        if kill.keep_state:
            async with asyncio.timeout(_STATE_TIMEOUT_S):
                saved = await self._swarm.before(key).state
        await self._swarm.bring_to_life(key, start_ns, saved)

    def later(self, kill: Kill) -> None:
        """An agent comes back when the fault that kills it ends, if that is in the run."""
        if kill.until_ns is not None and kill.until_ns < self._swarm.end_ns:
            self.due[kill.id] = kill
            self._swarm.background(self._at(kill, kill.until_ns))

    def forget(self, agent: str) -> None:
        """An agent that somebody has killed from outside does not come back."""
        self.due = {name: kill for name, kill in self.due.items() if kill.agent != agent}

    def comes_back(self, kill: Kill) -> bool:
        """Whether the agent of a kill is back, or about to be: in lockstep pace everybody counts on returns to come."""
        agent = kill.agent
        due = self._swarm.pace == "lockstep" and any(other.agent == agent for other in self.due.values())
        return due or agent in self._standing_by or self._swarm.current(agent)[1] >= self._life_after(kill)

    async def _at(self, kill: Kill, until_ns: int) -> None:
        """In realtime pace the process stands by beforehand; in lockstep everybody waits for it."""
        swarm = self._swarm
        if swarm.pace == "realtime":
            await asyncio.sleep(max(0.0, (until_ns - swarm.ahead_ns(_STANDBY_S)) / 1e9 / swarm.speed))
        else:
            await self._life_before(kill)
        if kill.id not in self.due:
            return
        self._standing_by.add(kill.agent)
        key = await self.standby(kill)
        async with swarm.intervening:
            if until_ns < swarm.end_ns:
                await self.revive(key, kill, until_ns)
            else:
                swarm.dismiss(key)
        self._standing_by.discard(kill.agent)

    async def _life_before(self, kill: Kill) -> None:
        """Wait until an agent is dead and has no other return before the one from this kill."""
        while True:
            key = self._swarm.current(kill.agent)
            await self._swarm.member(*key).buried.wait()
            earlier = (other for other in self.due.values() if other.agent == kill.agent and other.at_ns < kill.at_ns)
            if key == self._swarm.current(kill.agent) and not any(earlier):
                return
            await asyncio.sleep(_LOOK_EVERY_S)
