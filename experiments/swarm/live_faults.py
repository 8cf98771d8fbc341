"""Live faults: armed at all agents beforehand, in effect at one nominal instant, and recorded."""

from __future__ import annotations

import contextlib
import time
from collections.abc import AsyncIterator, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ...agents.plan_codec import encode_value
from ...errors import BadInput
from ...transport.faults import Fault, Kill, LinkFault, Pause, in_force
from ..scenario.expansion import entry_of, parse_fault
from ..scenario.fault_places import parse_agents, parse_links, places_of, read_words
from .live_fault_checks import RunState, refuse, warnings
from .supervisor import Swarm

_AHEAD_S = 0.05
_TRIES = 3
_BEFORE_EFFECT_S = 0.02
"""Agents transmit a little early: this long before its instant a fault may already have an effect."""
_TIMES_AN_ORDER = 2.0
_BEHIND_S = 0.05
"""A swarm that is further behind the clock is frozen for a live fault: an instant by the clock would be far away."""
_UNDONE = {"cut": "is cut", "hold": "is held"}


class Injector:
    """Live faults of one swarm, called f1, f2, … in the order of their requests."""

    def __init__(self, swarm: Swarm) -> None:
        self._swarm = swarm
        self._sink = swarm.sink
        self._places = places_of(swarm.plan)
        self._faults = swarm.live_faults
        self._count = 0
        self._newest_ns = 0
        self._took_s = 0.0

    def in_force(self) -> dict[str, Fault]:
        """The faults in force, including those of the timeline and those that were injected just now."""
        return in_force(self._faults.values(), self._now_ns())

    def _now_ns(self) -> int:
        return max(self._swarm.now_ns(), self._newest_ns)

    def _run_state(self) -> RunState:
        swarm = self._swarm
        return RunState(swarm.plan, swarm.pace, self._now_ns(), self.in_force(), swarm.status.alive, swarm.status.used)

    async def inject(self, source: Mapping[str, Any]) -> str:
        """Inject a fault, given as an entry of the timeline with no time but `for`; a description of what was done.

        Raises:
            BadInput: not a fault, an unknown place, or a fault without effect.
        """
        name = f"f{self._count + 1}"
        remaining_ns = self._swarm.plan.duration_ns - self._now_ns()
        drafted = parse_fault(source, name, self._places, remaining_ns)
        state = self._run_state()
        refuse(drafted, state)
        self._count += 1
        async with self._intervention():
            at_ns, faults = await self._arm(drafted)
            self._faults.update({fault.id: fault for fault in faults})
        self._newest_ns = at_ns
        for fault in faults:
            if isinstance(fault, Kill) and fault.until_ns is not None:
                self._swarm.restarts.later(fault)
        return "\n".join([f"{name}: {_times(faults)}", *warnings(faults, state)])

    @contextlib.asynccontextmanager
    async def _intervention(self) -> AsyncIterator[None]:
        """Keep the run from ending, and other interventions waiting."""
        async with self._swarm.intervening:
            if self._swarm.over.is_set():
                raise BadInput("the run is over")
            yield

    async def _arm(self, drafted: Sequence[Fault]) -> tuple[int, list[Fault]]:
        """Choose an instant and arm the faults at all agents.

        In realtime pace, if an agent was too slow they are armed again for a later instant, unless they may have had an
        effect.
        """
        swarm = self._swarm
        prepared_ns = await self._prepare() if swarm.pace != "realtime" else 0
        for _ in range(_TRIES):
            at_ns = prepared_ns or swarm.ahead_ns(self._ahead_s())
            faults = [_shifted(draft, at_ns) for draft in drafted]
            in_time = await self._arm_all(faults, at_ns)
            if in_time or prepared_ns or swarm.ahead_ns(_BEFORE_EFFECT_S) > at_ns:
                break
        if prepared_ns:
            await swarm.order({"do": "thaw"})
        for fault in faults:
            self._sink.event({"event": "fault", "time_ns": at_ns, "fault": encode_value(fault)})
        self._record_late(faults, at_ns, in_time=in_time)
        return at_ns, faults

    async def _prepare(self) -> int:
        """An instant that no agent has passed, and that none passes before the faults are armed there.

        By the clock it is a little ahead, and all go on until then; where somebody has passed it already, or the
        machine is behind, all are frozen instead.
        """
        swarm = self._swarm
        if swarm.pace == "exact" and swarm.status.behind_s < _BEHIND_S:
            instant_ns = max(swarm.ahead_ns(self._ahead_s()), self._newest_ns + 1)
            began = time.monotonic()
            answers = await swarm.order({"do": "prepare", "instant_ns": instant_ns})
            self._took_s = time.monotonic() - began
            if all(answers.values()) and not self._absent(answers) and instant_ns < swarm.end_ns:
                return instant_ns
        return await self._freeze()

    async def _freeze(self) -> int:
        """Freeze all agents; the first instant that nobody has reached.

        Raises:
            BadInput: there is none, because an agent without a living neighbour does not wait and is at the end.
        """
        answers = await self._swarm.order({"do": "freeze"})
        absent = self._absent(answers)
        instant_ns: int = max([self._now_ns(), self._newest_ns, *answers.values()]) + 1
        if absent or instant_ns >= self._swarm.end_ns:
            await self._swarm.order({"do": "thaw"})
            who = f"agent {', '.join(sorted(absent))} does" if absent else "somebody has no neighbour alive and does"
            raise BadInput(f"{who} not wait for others: there is no instant that all have still before them")
        return instant_ns

    def _absent(self, answers: Mapping[tuple[str, int], Any]) -> set[str]:
        """Living agents that have not answered, and are not about to be killed."""
        mortal = {fault.agent for fault in self._faults.values() if isinstance(fault, Kill)}
        return self._swarm.status.alive - mortal - {name for name, _ in answers}

    async def _arm_all(self, faults: Iterable[Fault], instant_ns: int) -> bool:
        if self._swarm.pace != "realtime":
            self._swarm.interventions.append(instant_ns)
        order = {"do": "arm", "faults": [encode_value(fault) for fault in faults], "instant_ns": instant_ns}
        began = time.monotonic()
        answers = await self._swarm.order(order)
        self._took_s = max(time.monotonic() - began, self._took_s / 2)
        return all(answers.values())

    def _ahead_s(self) -> float:
        """How far ahead to choose an instant: further if the last order took long to reach all agents."""
        return max(_AHEAD_S, _TIMES_AN_ORDER * self._took_s)

    def _record_late(self, faults: Iterable[Fault], instant_ns: int, *, in_time: bool) -> None:
        for fault in () if in_time else faults:
            self._sink.event({"event": "late-fault", "time_ns": instant_ns, "id": fault.id})

    # -- undoing --------------------------------------------------------------------------------------------------

    async def clear(self, names: list[str]) -> str:
        """Undo faults in force, all of them if none is named; a description of what was done.

        The name of an entry stands for all its faults, t3 for t3.1 and t3.2, including future ones except kills. Kills
        whose agents return anyway are not undone.

        Raises:
            BadInput: a fault that is not in force, or no fault in force.
        """
        present = {name: fault for name, fault in self.in_force().items() if not self._comes_back(fault)}
        chosen: dict[str, Fault] = {} if names else present
        known = ", ".join(dict.fromkeys(map(entry_of, present))) or "none"
        for name in names:
            parts = self._parts(name)
            if not parts:
                raise BadInput(f"no fault {name} is in force; in force: {known}")
            chosen |= parts
        if not chosen:
            raise BadInput("no fault is in force")
        await self._end(list(chosen.values()))
        return f"cleared {', '.join(names or dict.fromkeys(map(entry_of, chosen)))}"

    def _parts(self, name: str) -> dict[str, Fault]:
        now_ns = self._now_ns()
        return {
            fault.id: fault
            for fault in self._faults.values()
            if name in (fault.id, entry_of(fault.id))
            and (fault.in_force(now_ns) or (_is_to_come(fault, now_ns) and not isinstance(fault, Kill)))
            and not self._comes_back(fault)
        }

    def _comes_back(self, fault: Fault) -> bool:
        return isinstance(fault, Kill) and self._swarm.restarts.comes_back(fault)

    async def restart(self, words: str) -> str:
        """Restart killed agents; a description of what was done.

        Raises:
            BadInput: none of them was killed.
        """
        return f"restarted {await self._end_of(Kill, words, 'was killed')}"

    async def resume(self, words: str) -> str:
        """Resume paused agents; a description of what was done.

        Raises:
            BadInput: none of them is paused.
        """
        return f"resumed {await self._end_of(Pause, words, 'is paused')}"

    async def _end_of(self, kind: type[Kill | Pause], words: str, state: str) -> str:
        agents = parse_agents(read_words(words), self._places)
        found = [fault for fault in self.in_force().values() if isinstance(fault, kind) and fault.agent in agents]
        if not found:
            raise BadInput(f"agent {', '.join(agents)}: none {state} by a fault")
        chosen = [fault for fault in found if not self._comes_back(fault)]
        if not chosen:
            raise BadInput(f"agent {', '.join(fault.agent for fault in found)} comes back by itself")
        await self._end(chosen)
        return ", ".join(fault.agent for fault in chosen)

    async def restore(self, words: str, field: str) -> str:
        """Clear every fault that cuts, or holds, one of the links; a description of what was done.

        Raises:
            BadInput: none of them is cut, or held.
        """
        wanted = set(parse_links(words, self._places))
        chosen = [
            fault
            for fault in self.in_force().values()
            if isinstance(fault, LinkFault) and fault.changes.get(field) and wanted & set(fault.links)
        ]
        if not chosen:
            raise BadInput(f"none of these links {_UNDONE[field]} by a fault")
        await self._end(chosen)
        return f"cleared {', '.join(fault.id for fault in chosen)}"

    async def _end(self, faults: Sequence[Fault]) -> None:
        """End faults at one instant, with a process on standby for each agent that returns then."""
        if self._swarm.pace != "realtime":
            async with self._intervention():
                until_ns = await (self._freeze() if any(isinstance(one, Kill) for one in faults) else self._prepare())
                await self._end_at(faults, await self._standbys(faults), until_ns)
        else:
            revived = await self._standbys(faults)
            async with self._intervention():
                await self._end_at(faults, revived, self._swarm.ahead_ns(self._ahead_s()))

    async def _standbys(self, faults: Sequence[Fault]) -> list[tuple[tuple[str, int], Kill]]:
        kills = [fault for fault in faults if isinstance(fault, Kill)]
        return [(await self._swarm.restarts.standby(kill), kill) for kill in kills]

    async def _end_at(
        self, faults: Sequence[Fault], revived: Sequence[tuple[tuple[str, int], Kill]], until_ns: int
    ) -> None:
        """End faults at an instant; those that are over by then, as the run may know later, stay as they were."""
        swarm = self._swarm
        lasting = (fault for fault in faults if fault.until_ns is None or fault.until_ns > until_ns)
        ended = [replace(fault, until_ns=until_ns) for fault in lasting]
        in_time = await self._arm_all(ended, until_ns)
        self._faults.update({fault.id: fault for fault in ended})
        for key, kill in revived:
            await swarm.restarts.revive(key, replace(kill, until_ns=until_ns), until_ns)
        if swarm.pace != "realtime":
            await swarm.order({"do": "thaw"})
        elif revived:
            in_time = in_time and swarm.now_ns() <= until_ns
        self._newest_ns = until_ns
        self._record_late(ended, until_ns, in_time=in_time)
        for fault in ended:
            self._sink.event({"event": "cleared", "time_ns": until_ns, "id": fault.id})


def _is_to_come(fault: Fault, now_ns: int) -> bool:
    return fault.at_ns > now_ns and (fault.until_ns is None or fault.at_ns < fault.until_ns)


def _shifted(draft: Fault, by_ns: int) -> Fault:
    """A fault whose times were relative to the instant of the command."""
    until_ns = None if draft.until_ns is None else draft.until_ns + by_ns
    return replace(draft, at_ns=draft.at_ns + by_ns, until_ns=until_ns)


def _times(faults: Sequence[Fault]) -> str:
    """The times of faults, in words."""
    begin_s = min(fault.at_ns for fault in faults) / 1e9
    ends = [fault.until_ns for fault in faults if fault.until_ns is not None]
    end = f"until {max(ends) / 1e9:.3f} s" if len(ends) == len(faults) else "until cleared"
    count = f", {len(faults)} faults" if len(faults) > 1 else ""
    return f"from {begin_s:.3f} s {end}{count}"
