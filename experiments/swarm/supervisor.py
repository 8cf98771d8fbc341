"""The supervisor of a swarm over Zenoh: opens the hub, starts the agents, receives their journals, and ends the run.

Frames go from agent to agent through the hub's router, without Python code of the supervisor.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgpack

from ...agents.journal import Batch
from ...agents.plan import Plan
from ...agents.process import Pace
from ...names import first_of
from ...topologies import natural_key
from ...transport import zenoh_session as zs
from ...transport.keys import Keys
from ...transport.zenoh_access_control import access_control
from ..twin import RecordSink
from .fleet import Fleet
from .members import watch_for_stopped
from .restarts import Restarts
from .spawning import prepare

_LEAVE_TIMEOUT_S = 5.0
_HEAD_START_S = 0.4
_STOP_AHEAD_S = 0.1
_HEAD_START_PER_AGENT_S = 0.005
_OVERDUE_S = 20.0
_NAMED = 6
_TELEMETRY_LIMIT = 1_000_000


@dataclass(frozen=True)
class Ending:
    """The end of a run.

    problems: what went wrong.
    wall_s: duration of the run by the wall clock.
    sources: name → file of users' modules that agents' processes had loaded.
    """

    problems: tuple[str, ...]
    wall_s: float
    sources: Mapping[str, str] = field(default_factory=dict)


def told_once(problems: Iterable[str]) -> tuple[str, ...]:
    """Problems in their order, one sentence for what several agents say of themselves in the same words."""
    agents_of: dict[str, list[str]] = {}
    for problem in problems:
        match = re.fullmatch(r"agent (\w+)((?: failed|:).*)", problem, re.DOTALL)
        agents_of.setdefault(match[2] if match else problem, []).extend([match[1]] if match else [])
    return tuple(_of_agents(agents) + words for words, agents in agents_of.items())


def _of_agents(names: Sequence[str]) -> str:
    """The agents at the start of a sentence; nothing where it names none."""
    if not names:
        return ""
    return f"{'agent' if len(names) == 1 else 'agents'} {first_of(sorted(names, key=natural_key), _NAMED)}"


class Swarm(Fleet):
    """One run of a plan, with a process for each agent; arguments as for `Fleet`.

    Args:
        listen: endpoint of the hub.
    """

    def __init__(
        self,
        plan: Plan,
        sink: RecordSink,
        run: str,
        pace: Pace = "exact",
        speed: float = 1.0,
        listen: str = "tcp/127.0.0.1:0",
    ) -> None:
        super().__init__(plan, sink, run, pace, speed)
        self.restarts = Restarts(self)
        self._listen = listen
        self._news = asyncio.Event()
        self._began_ns = 0

    async def run(self) -> Ending:
        """Run from the start of the first process to the end of the last; no process and no session is left behind.

        Raises:
            BadInput: the endpoint cannot be used.
            RunFailed: an agent did not join.
        """
        prepare()
        self.loop = asyncio.get_running_loop()
        with tempfile.TemporaryDirectory(prefix="volery-") as private:
            passwords = Path(private) / "passwords"
            passwords.write_text("".join(f"{user}:{word}\n" for user, word in self.passwords.items()), encoding="ascii")
            joined = {agent.name: agent.neighbours + agent.wired for agent in self.plan.all_agents}
            control = access_control(self.keys, joined)
            self.session, self.endpoint = zs.open_hub(self._listen, control, passwords)
        stopped, wall_ns = False, 0
        try:
            telemetry = zs.Inbox(self.loop, _TELEMETRY_LIMIT, self._receive)
            tokens = zs.Inbox(self.loop, _TELEMETRY_LIMIT, self._token_changed)
            journals = self.session.declare_subscriber(self.keys.telemetry("*"), telemetry.push)
            liveliness = self.session.liveliness().declare_subscriber(self.keys.alive("*"), tokens.push, history=True)
            await self._start()
            await self.over.wait()
            wall_ns = max(0, time.monotonic_ns() - self._began_ns)
            async with self.intervening:
                await self._finish()
            stopped = True
            del journals, liveliness
        finally:
            for task in self.tasks:
                task.cancel()
            await asyncio.gather(*self.tasks, return_exceptions=True)
            await self._end_processes(stopped=stopped)
            await asyncio.to_thread(self.session.close)
        return Ending(told_once(self.problems), wall_ns / 1e9, self.loaded_sources)

    # -- start and stop -----------------------------------------------------------------------------------------

    async def _start(self) -> None:
        for agent in self.plan.all_agents:
            self.spawn(agent.name, 0)
        await self.joined([(agent.name, 0) for agent in self.plan.all_agents])
        if self.pace != "lockstep":
            await self.order({"do": "rehearse"})
        head_start_s = _HEAD_START_S + _HEAD_START_PER_AGENT_S * len(self.plan.all_agents)
        self.epoch_ns = time.monotonic_ns() + int(head_start_s * 1e9)
        self.sink.event({"event": "started", "time_ns": 0, "agents": len(self.plan.agents)})
        self._began_ns = time.monotonic_ns() if self.pace == "lockstep" else self.epoch_ns
        await self.order(self.start_order(0))
        self.ready.set()
        for agent in self.plan.agents:
            for kill in self.plan.kills(agent.name):
                self.restarts.later(kill)
        self.background(self._watch_the_end())
        self.background(watch_for_stopped(self.members.values))

    async def stop(self) -> None:
        """End the run early, at the same nominal instant for all agents."""
        if not self.ready.is_set():
            self.problems.append("stopped before the run began")
            self.over.set()
            return
        async with self.intervening:
            if self.over.is_set():
                return
            frozen = (await self.order({"do": "freeze"})).values()
            ahead = [self.ahead_ns(_STOP_AHEAD_S)] if self.pace == "realtime" else []
            self.end_ns = max([*frozen, *ahead]) + 1
            await self.order({"do": "end", "instant_ns": self.end_ns})
            await self.order({"do": "thaw"})
            self.sink.event({"event": "stopped", "time_ns": self.end_ns})

    # -- telemetry ----------------------------------------------------------------------------------------------

    def _receive(self, samples: list[zs.Sample]) -> None:
        for sample in samples:
            self._take(msgpack.unpackb(sample.payload.to_bytes()))

    def _take(self, data: dict[str, Any]) -> None:
        number, now_ns, behind_ns = data.pop("number"), data.pop("now_ns"), data.pop("behind_ns")
        batch = Batch.from_dict(data)
        member = self.members[batch.agent, batch.incarnation]
        self._news.set()
        member.now_ns, member.behind_ns = now_ns, behind_ns
        member.batches += 1
        if number != member.batches:
            self.problems.append(f"agent {batch.agent}: {number - member.batches} journal batches were lost on the way")
            member.batches = number
        for event in batch.events:
            if event["event"] == "done":
                member.done = True
                self.loaded_sources.update(event.pop("sources"))
            elif event["event"] == "killed":
                member.killed.set()
            elif event["event"] == "state":
                member.state.set_result(bytes.fromhex(event["state"]))
            elif event["event"] == "crashed":
                member.failed.set()
                self.problems.append(event["error"])
        self._note_progress()
        if batch:
            self.sink(batch)
        self.check_over()

    def _note_progress(self) -> None:
        """How far the slowest agent has come that runs, and how far behind the clock the swarm is."""
        running = [member for member in self.living() if member.now_ns and not member.done]
        reached_ns = min((member.now_ns for member in running), default=self.status.time_ns)
        self.status.time_ns = max(self.status.time_ns, min(reached_ns, self.end_ns))
        self.status.behind_s = max((member.behind_ns for member in running), default=0) / 1e9

    def _token_changed(self, samples: list[zs.Sample]) -> None:
        for sample in samples:
            name, incarnation = Keys.agent_of(str(sample.key_expr))
            if sample.kind == zs.PUT and (name, incarnation) in self.members:
                self.members[name, incarnation].joined.set()
                if incarnation == 0:
                    self.mark_alive(name, incarnation)

    async def _watch_the_end(self) -> None:
        """In realtime pace, end a run whose agents have not reported their end for too long."""
        while self.pace == "realtime":
            overdue_s = (self.now_ns() - self.end_ns) / 1e9 / self.speed
            if overdue_s > _OVERDUE_S:
                silent = [
                    name for (name, _), member in self.members.items() if not (member.done or member.ended.is_set())
                ]
                self.problems.append(f"agents {', '.join(silent)} have not ended {_OVERDUE_S:g} s after the run")
                self.over.set()
                return
            await asyncio.sleep(1.0)

    # -- the end ------------------------------------------------------------------------------------------------

    async def _finish(self) -> None:
        """Stop the agents and wait for their last batches."""
        for member in [member for member in self.members.values() if member.ended.is_set()]:
            await member.buried.wait()
        last = await self.order({"do": "stop"})
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_LEAVE_TIMEOUT_S):
                while any(self.members[key].batches < number for key, number in last.items()):
                    self._news.clear()
                    await self._news.wait()
        for key, number in last.items():
            if self.members[key].batches < number:
                self.problems.append(f"agent {key[0]}: its last journal batch was lost on the way")
        self.sink.event({"event": "finished", "time_ns": self.end_ns})

    async def _end_processes(self, *, stopped: bool) -> None:
        """Wait for the processes to end if they were ordered to stop; kill those that do not end in time."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_LEAVE_TIMEOUT_S if stopped else 0):
                for member in list(self.members.values()):
                    await member.ended.wait()
        for member in self.members.values():
            if not member.ended.is_set():
                self.loop.remove_reader(member.process.sentinel)
                member.process.kill()
                await asyncio.to_thread(member.process.join)
