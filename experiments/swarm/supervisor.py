"""The supervisor of a swarm over Zenoh: opens the hub, spawns the agents, injects, watches and ends.

Frames go from agent to agent through the hub's router; no Python of the supervisor touches them. It hears journals.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import tempfile
import time
from collections.abc import Coroutine, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgpack

from ...agents.journal import Batch
from ...agents.plan import Plan
from ...agents.process import Assignment, Pace
from ...errors import RunFailed
from ...transport import zenoh_session as zs
from ...transport.faults import Fault, to_plain
from ...transport.keys import CONTROL_CLIENT, Keys
from ...transport.zenoh_access_control import access_control
from ..record.record import INJECTED
from ..twin import RecordSink
from .members import Member, joined_or_ended, watch_for_stopped
from .restarts import Restarts
from .spawning import prepare, spawn
from .status import Status

_JOIN_TIMEOUT_S = 60.0
_ANSWER_TIMEOUT_S = 10.0
_LEAVE_TIMEOUT_S = 5.0
_HEAD_START_S = 0.4
_STOP_AHEAD_S = 0.1
_HEAD_START_PER_AGENT_S = 0.005
_OVERDUE_S = 20.0
_TELEMETRY_LIMIT = 1_000_000


@dataclass(frozen=True)
class Ending:
    """How a run ended: what went wrong, if anything, and how long its nominal time took by the clock."""

    problems: tuple[str, ...]
    wall_s: float


class Swarm:
    """One run of a plan in processes of its own.

    Args:
        plan: what to run.
        sink: where the entries go.
        run: name of the run in the keys.
        pace: realtime or lockstep.
        speed: nominal seconds per wall second, in realtime pace.
        listen: the hub's endpoint.

    Who arms a live fault or brings an agent to life holds `intervening` meanwhile: a newcomer knows every fault that
    was armed before it, and hears of every later one.
    """

    def __init__(
        self,
        plan: Plan,
        sink: RecordSink,
        run: str,
        pace: Pace = "realtime",
        speed: float = 1.0,
        listen: str = "tcp/127.0.0.1:0",
    ) -> None:
        self.plan = plan
        self.pace = pace
        self.status = Status(plan.duration_ns, frozenset(agent.name for agent in plan.agents))
        self.endpoint = ""
        names = *(agent.name for agent in plan.all_agents), CONTROL_CLIENT
        self.passwords = {name: secrets.token_urlsafe(18) for name in names}
        self.session: zs.Session
        self.live_faults: dict[str, Fault] = {fault.id: fault for fault in plan.faults}
        self.interventions = 0
        self.intervening = asyncio.Lock()
        self.ready = asyncio.Event()
        self._sink = sink
        self._keys = Keys(run)
        self.speed = speed
        self._listen = listen
        self._members: dict[tuple[str, int], Member] = {}
        self._epoch_ns = 0
        self._over = asyncio.Event()
        self._news = asyncio.Event()
        self._problems: list[str] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self.end_ns = plan.duration_ns
        self._living: dict[str, int] = {}
        self.restarts = Restarts(self)
        self.external_kills: set[tuple[str, int]] = set()

    async def run(self) -> Ending:
        """The whole life of the swarm; however it ends, no process and no session is left behind.

        Raises:
            BadInput: the endpoint cannot be used.
            RunFailed: an agent did not join.
        """
        prepare()
        self._loop = asyncio.get_running_loop()
        with tempfile.TemporaryDirectory(prefix="volery-") as private:
            passwords = Path(private) / "passwords"
            passwords.write_text("".join(f"{user}:{word}\n" for user, word in self.passwords.items()), encoding="ascii")
            joined = {agent.name: agent.neighbours + agent.wired for agent in self.plan.all_agents}
            control = access_control(self._keys, joined)
            self.session, self.endpoint = zs.open_hub(self._listen, control, passwords)
        told, wall_ns = False, 0
        try:
            telemetry = zs.Inbox(self._loop, _TELEMETRY_LIMIT, self._heard)
            tokens = zs.Inbox(self._loop, _TELEMETRY_LIMIT, self._token_changed)
            hearing = self.session.declare_subscriber(self._keys.telemetry("*"), telemetry.push)
            watching = self.session.liveliness().declare_subscriber(self._keys.alive("*"), tokens.push, history=True)
            await self._start()
            await self._over.wait()
            wall_ns = max(0, time.monotonic_ns() - self._epoch_ns)
            await self._finish()
            told = True
            del hearing, watching
        finally:
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)
            await self._end_processes(told=told)
            await asyncio.to_thread(self.session.close)
        return Ending(tuple(self._problems), wall_ns / 1e9)

    # -- beginning ----------------------------------------------------------------------------------------------

    async def _start(self) -> None:
        for agent in self.plan.all_agents:
            self.spawn(agent.name, 0)
        await self.joined([(agent.name, 0) for agent in self.plan.all_agents])
        if self.pace == "realtime":
            await self.order({"do": "rehearse"})
        head_start_s = _HEAD_START_S + _HEAD_START_PER_AGENT_S * len(self.plan.all_agents)
        self._epoch_ns = time.monotonic_ns() + int(head_start_s * 1e9)
        self._sink.event({"event": "started", "time_ns": 0, "agents": len(self.plan.agents)})
        await self.order(self._start_order(0))
        self.ready.set()
        for agent in self.plan.agents:
            for kill in self.plan.kills(agent.name):
                self.restarts.later(kill)
        self.background(self._watch_the_end())
        self.background(watch_for_stopped(self._members.values))

    def _start_order(self, start_ns: int, saved: bytes | None = None) -> dict[str, Any]:
        """Come to life at an instant, in the run as it is now."""
        run_start = {
            "epoch_ns": self._epoch_ns,
            "end_ns": self.end_ns,
            "interventions": self.interventions,
            "external_kills": sorted(self.external_kills),
        }
        faults = [to_plain(fault) for fault in self.live_faults.values()]
        return {"do": "start", "start_ns": start_ns, "faults": faults, "saved": saved, "run_start": run_start}

    def spawn(self, name: str, incarnation: int) -> Member:
        """A process for a life of an agent."""
        assignment = Assignment(
            self.plan, name, incarnation, self._keys.run, self.endpoint, self.passwords[name], self.pace, self.speed
        )
        member = Member(spawn(assignment))
        self._members[name, incarnation] = member
        self._loop.add_reader(member.process.sentinel, self._process_ended, name, incarnation)
        return member

    async def joined(self, who: list[tuple[str, int]]) -> None:
        """Wait until these processes have joined.

        Raises:
            RunFailed: one has not, or has ended before.
        """
        try:
            async with asyncio.timeout(_JOIN_TIMEOUT_S):
                for key in who:
                    member = self._members[key]
                    await joined_or_ended(member)
        except TimeoutError:
            missing = [name for name, incarnation in who if not self._members[name, incarnation].joined.is_set()]
            raise RunFailed(f"agents {', '.join(missing)} have not joined within {_JOIN_TIMEOUT_S:g} s") from None
        if dead := [name for name, incarnation in who if self._members[name, incarnation].ended.is_set()]:
            raise RunFailed(f"agents {', '.join(dead)} ended before the run began")

    def background(self, work: Coroutine[Any, Any, None]) -> None:
        """Let something go on beside; the swarm ends it with itself."""
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._background_ended)

    def _background_ended(self, task: asyncio.Task[None]) -> None:
        """What goes wrong in the background ends the run, and is told."""
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()):
            self._problems.append(str(error) or repr(error))
            self._over.set()

    # -- orders to agents ---------------------------------------------------------------------------------------

    def now_ns(self) -> int:
        """Nominal time: by the clock in realtime pace, else as last told by the agents."""
        if self.pace == "realtime":
            elapsed_ns = time.monotonic_ns() - self._epoch_ns if self._epoch_ns else 0
            return max(0, int(elapsed_ns * self.speed))
        return self.status.time_ns

    def ahead_ns(self, wall_s: float) -> int:
        """The nominal instant that the wall clock reaches so much later."""
        return self.now_ns() + int(wall_s * 1e9 * self.speed)

    async def order(
        self, order: Mapping[str, Any], name: str = "*", incarnation: int | str = "*"
    ) -> dict[tuple[str, int], Any]:
        """Give an order to all agents or to one; the answers of those that are alive."""
        answers = await zs.ask(
            self.session, self._keys.control(name, incarnation), msgpack.packb(order), _ANSWER_TIMEOUT_S
        )
        return {Keys.agent_of(key): msgpack.unpackb(answer) for key, answer in answers.items()}

    def current(self, name: str) -> tuple[str, int]:
        """The newest incarnation of an agent."""
        return name, max(incarnation for agent, incarnation in self._members if agent == name)

    def pids(self) -> dict[str, int]:
        """Process of each agent's newest incarnation."""
        newest = {name: self._members[self.current(name)].process.pid for name, _ in self._members}
        return {name: pid for name, pid in newest.items() if pid is not None}

    def is_alive(self, name: str) -> bool:
        """Whether the agent is alive; a process on standby is not."""
        return name in self.status.alive

    def member(self, name: str, incarnation: int) -> Member:
        """The process of one life of an agent."""
        return self._members[name, incarnation]

    def before(self, key: tuple[str, int]) -> Member:
        """The process of the last life of an agent before this one."""
        name, incarnation = key
        return self._members[name, max(life for agent, life in self._members if agent == name and life < incarnation)]

    def dismiss(self, key: tuple[str, int]) -> None:
        """The run ends before a process on standby is needed."""
        self._members[key].done = True
        self._check_over()

    async def bring_to_life(self, key: tuple[str, int], start_ns: int, saved: bytes | None) -> None:
        """Let a process on standby live from an instant on, with what the life before has left."""
        name, incarnation = key
        await self.order(self._start_order(start_ns, saved), name, incarnation)
        self._lives(name, incarnation)
        self._sink.event({"event": "restarted", "agent": name, "incarnation": incarnation, "time_ns": start_ns})

    def _lives(self, name: str, incarnation: int) -> None:
        self._living[name] = incarnation
        self.status.alive.add(name)

    async def stop(self) -> None:
        """End the run early, at one nominal instant for all."""
        if not self.ready.is_set():
            self._problems.append("stopped before the run began")
            self._over.set()
            return
        async with self.intervening:
            frozen = (await self.order({"do": "freeze"})).values()
            ahead = [self.ahead_ns(_STOP_AHEAD_S)] if self.pace == "realtime" else []
            self.end_ns = max([*frozen, *ahead]) + 1
            await self.order({"do": "end", "instant_ns": self.end_ns})
            await self.order({"do": "thaw"})
        self._sink.event({"event": "stopped", "time_ns": self.end_ns})

    # -- what is heard ------------------------------------------------------------------------------------------

    def _heard(self, samples: list[zs.Sample]) -> None:
        for sample in samples:
            self._take(msgpack.unpackb(sample.payload.to_bytes()))

    def _take(self, data: dict[str, Any]) -> None:
        number, now_ns = data.pop("number"), data.pop("now_ns")
        batch = Batch.from_dict(data)
        member = self._members[batch.agent, batch.incarnation]
        self._news.set()
        member.batches += 1
        if number != member.batches:
            self._problems.append(
                f"agent {batch.agent}: {number - member.batches} journal batches were lost on the way"
            )
            member.batches = number
        for event in batch.events:
            if event["event"] == "done":
                member.done = True
            elif event["event"] == "killed":
                member.killed.set()
            elif event["event"] == "state":
                member.state.set_result(bytes.fromhex(event["state"]))
            elif event["event"] == "crashed":
                self._problems.append(f"agent {batch.agent} failed: {event['error']}")
        self.status.take(batch, min(now_ns, self.end_ns))
        if batch:
            self._sink(batch)
        self._check_over()

    def _token_changed(self, samples: list[zs.Sample]) -> None:
        for sample in samples:
            name, incarnation = Keys.agent_of(str(sample.key_expr))
            if sample.kind == zs.PUT and (name, incarnation) in self._members:
                self._members[name, incarnation].joined.set()
                if incarnation == 0:
                    self._lives(name, incarnation)

    def _process_ended(self, name: str, incarnation: int) -> None:
        member = self._members[name, incarnation]
        self._loop.remove_reader(member.process.sentinel)
        member.process.join()
        member.ended.set()
        if self._living.get(name) == incarnation:
            self.status.alive.discard(name)
        if (member.done or self._over.is_set()) and member.process.exitcode == 0:
            member.buried.set()
            self._check_over()
        else:
            self.background(self._bury(name, incarnation, self.now_ns()))

    async def _bury(self, name: str, incarnation: int, time_ns: int) -> None:
        """Who ended from outside nobody waits for any more, and what has not come of it never does."""
        cause = await self._members[name, incarnation].cause()
        death = {"event": "died", "agent": name, "incarnation": incarnation, "time_ns": time_ns, "cause": cause}
        self._sink.event(death)
        if cause != INJECTED:
            await self._end_from_outside(name, incarnation, cause)
        self._members[name, incarnation].buried.set()
        self._check_over()

    async def _end_from_outside(self, name: str, incarnation: int, cause: str) -> None:
        self.external_kills.add((name, incarnation))
        self.restarts.forget(name)
        if cause.startswith("ended") or name in {one.name for one in self.plan.world_agents}:
            self._problems.append(f"agent {name} {cause}")
        if self.pace == "lockstep" and cause.startswith("ended"):
            self._over.set()
        elif self.ready.is_set():
            await self.order({"do": "external-kill", "agent": name, "incarnation": incarnation})

    def _check_over(self) -> None:
        newest = {name: self._members[self.current(name)] for name, _ in self._members}
        to_come = [kill for kill in self.restarts.due.values() if kill.until_ns and kill.until_ns < self.end_ns]
        if all(member.done or member.buried.is_set() for member in newest.values()) and not to_come:
            self._over.set()

    async def _watch_the_end(self) -> None:
        """Realtime pace does not wait for ever for an agent that says nothing."""
        while self.pace == "realtime":
            overdue_s = (self.now_ns() - self.end_ns) / 1e9 / self.speed
            if overdue_s > _OVERDUE_S:
                silent = [
                    name for (name, _), member in self._members.items() if not (member.done or member.ended.is_set())
                ]
                self._problems.append(f"agents {', '.join(silent)} have not ended {_OVERDUE_S:g} s after the run")
                self._over.set()
                return
            await asyncio.sleep(1.0)

    # -- ending -------------------------------------------------------------------------------------------------

    async def _finish(self) -> None:
        """Let the agents go, once their last batches are here."""
        for member in [member for member in self._members.values() if member.ended.is_set()]:
            await member.buried.wait()
        last = await self.order({"do": "stop"})
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_LEAVE_TIMEOUT_S):
                while any(self._members[key].batches < number for key, number in last.items()):
                    self._news.clear()
                    await self._news.wait()
        for key, number in last.items():
            if self._members[key].batches < number:
                self._problems.append(f"agent {key[0]}: its last journal batch was lost on the way")
        self._sink.event({"event": "finished", "time_ns": self.end_ns})

    async def _end_processes(self, *, told: bool) -> None:
        """Wait for the processes that were told to stop; end the others, and those that take too long."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_LEAVE_TIMEOUT_S if told else 0):
                for member in list(self._members.values()):
                    await member.ended.wait()
        for member in self._members.values():
            if not member.ended.is_set():
                self._loop.remove_reader(member.process.sentinel)
                member.process.kill()
                await asyncio.to_thread(member.process.join)
