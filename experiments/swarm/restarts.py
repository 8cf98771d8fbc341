"""Restarts of agents that were killed by faults."""

from __future__ import annotations

import asyncio

from ...transport.faults import Kill, kills_of
from .fleet import Fleet

_STANDBY_S = 2.0
_LOOK_EVERY_S = 0.02
_STATE_TIMEOUT_S = 10.0


class Restarts:
    """Restarts agents of one fleet, each when the fault that killed it ends."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._standing_by: set[str] = set()

    async def standby(self, kill: Kill) -> tuple[str, int]:
        """Start a process for the next incarnation of a killed agent, and wait until it has joined."""
        fleet = self._fleet
        fleet.returns_due.pop(kill.id, None)
        key = (kill.agent, self._incarnation_after(kill))
        fleet.spawn(*key)
        await fleet.joined([key])
        if fleet.pace != "lockstep":
            await fleet.order({"do": "rehearse"}, *key)
        return key

    def _incarnation_after(self, kill: Kill) -> int:
        """The incarnation after a kill: kills without a return count too, as in the twin."""
        kills = kills_of(self._fleet.live_faults.values(), kill.agent)
        return 1 + [other.id for other in kills].index(kill.id)

    async def revive(self, key: tuple[str, int], kill: Kill, start_ns: int) -> None:
        """Start a process on standby at the end of a kill, with the kept state; the caller holds `intervening`."""
        saved = None
        if kill.keep_state:
            async with asyncio.timeout(_STATE_TIMEOUT_S):
                saved = await self._fleet.before(key).state
        await self._fleet.bring_to_life(key, start_ns, saved)

    def later(self, kill: Kill) -> None:
        """Schedule the return of an agent at the end of a kill, if this is before the end of the run."""
        if kill.until_ns is not None and kill.until_ns < self._fleet.end_ns:
            self._fleet.returns_due[kill.id] = kill
            self._fleet.background(self._at(kill, kill.until_ns))

    def comes_back(self, kill: Kill) -> bool:
        """Whether the agent of a kill has returned or is about to; in exact pace scheduled returns always come."""
        agent = kill.agent
        due = self._fleet.pace != "realtime" and any(other.agent == agent for other in self._fleet.returns_due.values())
        return due or agent in self._standing_by or self._fleet.current(agent)[1] >= self._incarnation_after(kill)

    async def _at(self, kill: Kill, until_ns: int) -> None:
        """Restart an agent, in realtime pace from a process on standby; in exact pace all agents wait for it."""
        fleet = self._fleet
        if fleet.pace == "realtime":
            await asyncio.sleep(max(0.0, (until_ns - fleet.ahead_ns(_STANDBY_S)) / 1e9 / fleet.speed))
        else:
            await self._previous_end(kill)
        if kill.id not in fleet.returns_due:
            return
        self._standing_by.add(kill.agent)
        key = await self.standby(kill)
        async with fleet.intervening:
            if until_ns < fleet.end_ns:
                await self.revive(key, kill, until_ns)
            else:
                fleet.dismiss(key)
        self._standing_by.discard(kill.agent)

    async def _previous_end(self, kill: Kill) -> None:
        """Wait until an agent is dead and has no return before the one from this kill."""
        while True:
            key = self._fleet.current(kill.agent)
            await self._fleet.member(*key).buried.wait()
            earlier = (
                other
                for other in self._fleet.returns_due.values()
                if other.agent == kill.agent and other.at_ns < kill.at_ns
            )
            if key == self._fleet.current(kill.agent) and not any(earlier):
                return
            await asyncio.sleep(_LOOK_EVERY_S)
