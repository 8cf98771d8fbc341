"""Faults injected while a swarm runs: armed everywhere beforehand, in effect at one nominal instant, and recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..agents.registry import find
from ..errors import BadInput
from ..transport.faults import Fault, Kill, LinkFault, Pause, effective, in_force, to_plain
from .fitting import placeless, settings_problems
from .swarm import Swarm
from .timeline import parse_fault
from .twin import RecordSink

_AHEAD_S = 0.05
_TRIES = 3


class Injector:
    """Live faults of one swarm: f1, f2, … in the order in which they were asked for."""

    def __init__(self, swarm: Swarm, sink: RecordSink) -> None:
        self._swarm = swarm
        self._sink = sink
        self._faults = swarm.live_faults
        self._faults.update({fault.id: fault for fault in swarm.plan.faults})
        self._count = 0
        self._newest_ns = 0

    def in_force(self) -> dict[str, Fault]:
        """The faults that hold now, those of the timeline included; what was asked for just now counts as done."""
        return in_force(self._faults.values(), max(self._swarm.now_ns(), self._newest_ns))

    async def inject(self, written: Mapping[str, Any]) -> str:
        """Let a fault take effect, written as an entry of the timeline without `at`; what was done, in words.

        Raises:
            BadInput: not a fault, something that does not exist, or one without effect.
        """
        name = f"f{self._count + 1}"
        drafted = parse_fault(written, name, 0, list(self._swarm.plan.links))
        self._check(drafted)
        self._count += 1
        async with self._swarm.intervening:
            fault = await self._arm(drafted)
            self._faults[name] = fault
        self._newest_ns = fault.at_ns
        if isinstance(fault, Kill) and fault.until_ns is not None:
            self._swarm.restarts.later(fault)
        end = "until cleared" if fault.until_ns is None else f"until {fault.until_ns / 1e9:.3f} s"
        return f"{name}: from {fault.at_ns / 1e9:.3f} s {end}"

    def _check(self, fault: Fault) -> None:
        if isinstance(fault, LinkFault):
            self._check_fit(fault)
            if fault.changes == {"cut": True} and (cut := self._already_cut(fault)):
                raise BadInput(f"already cut: {', '.join('>'.join(link) for link in cut)}; nothing was changed")
            return
        if not self._swarm.is_alive(fault.agent):
            raise BadInput(f"agent {fault.agent} is not alive; `volery fault restart {fault.agent}` brings it back")
        if isinstance(fault, Pause) and any(
            isinstance(other, Pause) and other.agent == fault.agent for other in self.in_force().values()
        ):
            raise BadInput(f"agent {fault.agent} is paused already")

    def _check_fit(self, fault: LinkFault) -> None:
        """Refuse settings under which an agent's frames would not fit the link any more."""
        plan = self._swarm.plan
        present = [other for other in self.in_force().values() if isinstance(other, LinkFault)]
        for link in fault.links:
            sender = plan.agent(link[0])
            payload = find(sender.kind).largest_payload(sender.parameters)
            settings = replace(effective(plan.links[link], link, present, self._swarm.now_ns()), **fault.changes)
            problems = [*settings_problems(settings, payload, sender.compute_ns), *placeless(plan, link, settings)]
            for field, text in problems:
                raise BadInput(f"{field} on {'>'.join(link)}: {text}")

    def _already_cut(self, fault: LinkFault) -> list[tuple[str, str]]:
        cut = {
            link
            for other in self.in_force().values()
            if isinstance(other, LinkFault) and other.changes.get("cut")
            for link in other.links
        }
        return [link for link in fault.links if link in cut] if cut.issuperset(fault.links) else []

    async def _arm(self, drafted: Fault) -> Fault:
        """Choose an instant, arm the fault everywhere, and do so anew with a later one if some agent was too slow."""
        swarm = self._swarm
        lasts_ns = drafted.until_ns
        if isinstance(drafted, Kill):
            swarm.expect_kill(drafted.agent)
        held = (await swarm.order({"do": "hold"})).values() if swarm.pace == "lockstep" else []
        for _ in range(_TRIES):
            at_ns = max(held) + 1 if swarm.pace == "lockstep" else swarm.ahead_ns(_AHEAD_S)
            fault = replace(drafted, at_ns=at_ns, until_ns=None if lasts_ns is None else at_ns + lasts_ns)
            in_time = await self._tell(fault, at_ns)
            if in_time:
                break
        if swarm.pace == "lockstep":
            await swarm.order({"do": "release"})
        self._sink.event({"event": "fault", "time_ns": at_ns, "fault": to_plain(fault)})
        if not in_time:
            self._sink.event({"event": "late-fault", "time_ns": at_ns, "id": fault.id})
        return fault

    async def _tell(self, fault: Fault, instant_ns: int) -> bool:
        self._swarm.interventions += self._swarm.pace == "lockstep"
        answers = await self._swarm.order({"do": "arm", "fault": to_plain(fault), "instant_ns": instant_ns})
        return all(answers.values())

    async def clear(self, names: list[str]) -> str:
        """Undo faults that are in force, all of them if none is named; what was done, in words.

        Raises:
            BadInput: a name that is not in force, or nothing to clear.
        """
        present = self.in_force()
        if unknown := [name for name in names if name not in present]:
            known = ", ".join(present) or "none"
            raise BadInput(f"no fault {', '.join(unknown)} is in force; in force: {known}")
        chosen = names or list(present)
        if not chosen:
            raise BadInput("no fault is in force")
        for name in chosen:
            await self._end(present[name])
        return f"cleared {', '.join(chosen)}"

    async def restart(self, agent: str) -> str:
        """Bring a killed agent back; what was done, in words.

        Raises:
            BadInput: it is alive.
        """
        kills = [fault for fault in self.in_force().values() if isinstance(fault, Kill) and fault.agent == agent]
        if not kills:
            raise BadInput(f"agent {agent} was not killed by a fault, so there is nothing to restart")
        await self._end(kills[-1])
        return f"restarted {agent}"

    async def restore(self, written: Mapping[str, Any]) -> str:
        """Clear every cut that touches the named links; what was done, in words.

        Raises:
            BadInput: none of them is cut.
        """
        wanted = parse_fault(written, "restore", 0, list(self._swarm.plan.links))
        assert isinstance(wanted, LinkFault)
        names = [
            name
            for name, fault in self.in_force().items()
            if isinstance(fault, LinkFault) and fault.changes.get("cut") and set(fault.links) & set(wanted.links)
        ]
        if not names:
            raise BadInput("none of these links is cut")
        return await self.clear(names)

    async def _end(self, fault: Fault) -> None:
        key = await self._swarm.restarts.standby(fault.agent) if isinstance(fault, Kill) else None
        async with self._swarm.intervening:
            await self._end_now(fault, key)

    async def _end_now(self, fault: Fault, key: tuple[str, int] | None) -> None:
        swarm = self._swarm
        if swarm.pace == "lockstep":
            until_ns = max((await swarm.order({"do": "hold"})).values()) + 1
            ended: Fault = replace(fault, until_ns=until_ns)
            await self._tell(ended, until_ns)
            self._faults[fault.id] = ended
            if key is not None and isinstance(ended, Kill):
                await swarm.restarts.revive(key, ended, until_ns)
            await swarm.order({"do": "release"})
        elif key is not None and isinstance(fault, Kill):
            until_ns = swarm.ahead_ns(_AHEAD_S)
            ended = replace(fault, until_ns=until_ns)
            await swarm.restarts.revive(key, ended, until_ns)
            if swarm.now_ns() > until_ns:
                self._sink.event({"event": "late-fault", "time_ns": until_ns, "id": fault.id})
        else:
            until_ns = swarm.ahead_ns(_AHEAD_S)
            ended = replace(fault, until_ns=until_ns)
            if not await self._tell(ended, until_ns):
                self._sink.event({"event": "late-fault", "time_ns": until_ns, "id": fault.id})
        self._faults[fault.id] = ended
        self._newest_ns = until_ns
        self._sink.event({"event": "cleared", "time_ns": until_ns, "id": fault.id})
