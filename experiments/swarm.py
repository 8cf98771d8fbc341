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
from dataclasses import dataclass, field
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

import msgpack

from ..agents.journal import Batch
from ..agents.plan import Plan
from ..agents.process import Assignment, Pace
from ..errors import RunFailed
from ..transport import zenoh_session as zs
from ..transport.access import access_control
from ..transport.faults import Fault, Kill, to_plain
from ..transport.keys import OPERATOR, Keys
from .spawning import prepare, spawn
from .status import Status
from .twin import RecordSink

_JOIN_TIMEOUT_S = 60.0
_ANSWER_TIMEOUT_S = 10.0
_LEAVE_TIMEOUT_S = 5.0
_HEAD_START_S = 0.4
_STOP_AHEAD_S = 0.1
_HEAD_START_PER_AGENT_S = 0.005
_STANDBY_S = 2.0
_OVERDUE_S = 20.0
_LOOK_EVERY_S = 0.5
_STOPPED_S = 2.0
_TELEMETRY_LIMIT = 1_000_000


@dataclass
class _Member:
    """One process of the swarm."""

    process: ForkServerProcess
    joined: asyncio.Event = field(default_factory=asyncio.Event)
    ended: asyncio.Event = field(default_factory=asyncio.Event)
    done: bool = False
    stopped_from_outside: bool = False
    batches: int = 0
    state: asyncio.Future[bytes] = field(default_factory=lambda: asyncio.get_running_loop().create_future())


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
        self.status = Status(plan.duration_ns, len(plan.agents))
        self.endpoint = ""
        self.passwords = {
            name: secrets.token_urlsafe(18) for name in (*(agent.name for agent in plan.agents), OPERATOR)
        }
        self.session: zs.Session
        self.live_faults: dict[str, Fault] = {}
        self.interventions = 0
        self.intervening = asyncio.Lock()
        self.ready = asyncio.Event()
        self._sink = sink
        self._keys = Keys(run)
        self._speed = speed
        self._listen = listen
        self._members: dict[tuple[str, int], _Member] = {}
        self._epoch_ns = 0
        self._over = asyncio.Event()
        self._news = asyncio.Event()
        self._problems: list[str] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self._end_ns = plan.duration_ns
        self._living: dict[str, int] = {}
        self._restarts_due: dict[str, int] = {}
        self._kills_expected: set[tuple[str, int]] = set()
        self._gone: set[tuple[str, int]] = set()

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
            control = access_control(self._keys, {agent.name: agent.neighbours for agent in self.plan.agents})
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
        for agent in self.plan.agents:
            self._spawn(agent.name, 0)
        await self._joined([(agent.name, 0) for agent in self.plan.agents])
        if self.pace == "realtime":
            await self.order({"do": "rehearse"})
        head_start_s = _HEAD_START_S + _HEAD_START_PER_AGENT_S * len(self.plan.agents)
        self._epoch_ns = time.monotonic_ns() + int(head_start_s * 1e9)
        self._sink.event({"event": "started", "time_ns": 0, "agents": len(self.plan.agents)})
        await self.order(self._start_order(0))
        self.ready.set()
        for agent in self.plan.agents:
            for incarnation, kill in enumerate(self.plan.kills(agent.name), start=1):
                self._kills_expected.add((agent.name, incarnation - 1))
                if kill.until_ns is not None:
                    self._restart_later(kill, incarnation)
        self._background(self._watch_the_end())
        self._background(self._watch_for_stopped())

    def _start_order(self, start_ns: int, saved: bytes | None = None) -> dict[str, Any]:
        """Come to life at an instant, in the run as it is now."""
        beginning = {
            "epoch_ns": self._epoch_ns,
            "end_ns": self._end_ns,
            "interventions": self.interventions,
            "gone": sorted(self._gone),
        }
        faults = [to_plain(fault) for fault in self.live_faults.values()]
        return {"do": "start", "start_ns": start_ns, "faults": faults, "saved": saved, "beginning": beginning}

    def _spawn(self, name: str, incarnation: int) -> _Member:
        assignment = Assignment(
            self.plan, name, incarnation, self._keys.run, self.endpoint, self.passwords[name], self.pace, self._speed
        )
        member = _Member(spawn(assignment))
        self._members[name, incarnation] = member
        self._loop.add_reader(member.process.sentinel, self._process_ended, name, incarnation)
        return member

    async def _joined(self, who: list[tuple[str, int]]) -> None:
        try:
            async with asyncio.timeout(_JOIN_TIMEOUT_S):
                for key in who:
                    member = self._members[key]
                    await _first(member.joined, member.ended)
        except TimeoutError:
            missing = [name for name, incarnation in who if not self._members[name, incarnation].joined.is_set()]
            raise RunFailed(f"agents {', '.join(missing)} have not joined within {_JOIN_TIMEOUT_S:g} s") from None
        if dead := [name for name, incarnation in who if self._members[name, incarnation].ended.is_set()]:
            raise RunFailed(f"agents {', '.join(dead)} ended before the run began")

    def _background(self, work: Coroutine[Any, Any, None]) -> None:
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._background_ended)

    def _background_ended(self, task: asyncio.Task[None]) -> None:
        """What goes wrong in the background ends the run, and is told."""
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            self._problems.append(str(error) or repr(error))
            self._over.set()

    # -- orders to agents ---------------------------------------------------------------------------------------

    def now_ns(self) -> int:
        """Nominal time: by the clock in realtime pace, else as last told by the agents."""
        if self.pace == "realtime":
            elapsed_ns = time.monotonic_ns() - self._epoch_ns if self._epoch_ns else 0
            return max(0, int(elapsed_ns * self._speed))
        return self.status.time_ns

    def ahead_ns(self, wall_s: float) -> int:
        """The nominal instant that the wall clock reaches so much later."""
        return self.now_ns() + int(wall_s * 1e9 * self._speed)

    async def order(
        self, order: Mapping[str, Any], name: str = "*", incarnation: int | str = "*"
    ) -> dict[tuple[str, int], Any]:
        """Give an order to all agents or to one; the answers of those that are alive."""
        answers = await zs.ask(
            self.session, self._keys.control(name, incarnation), msgpack.packb(order), _ANSWER_TIMEOUT_S
        )
        return {Keys.agent_of(key): msgpack.unpackb(answer) for key, answer in answers.items()}

    def expect_kill(self, name: str) -> None:
        """The next death of this agent is meant."""
        self._kills_expected.add(self.current(name))

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

    def _lives(self, name: str, incarnation: int) -> None:
        self._living[name] = incarnation
        self.status.alive.add(name)

    async def standby(self, name: str) -> tuple[str, int]:
        """A new process for an agent, joined but not yet alive in nominal time."""
        _, incarnation = self.current(name)
        key = (name, incarnation + 1)
        await self._prepare(key)
        return key

    async def _prepare(self, key: tuple[str, int]) -> None:
        self._spawn(*key)
        await self._joined([key])
        if self.pace == "realtime":
            await self.order({"do": "rehearse"}, *key)

    async def revive(self, key: tuple[str, int], kill: Kill, start_ns: int) -> None:
        """Let a process on standby live from an instant on, the end of a kill, with what that has kept."""
        name, incarnation = key
        saved = None
        if kill.keep_state:
            async with asyncio.timeout(_ANSWER_TIMEOUT_S):
                saved = await self._members[name, incarnation - 1].state
        await self.order(self._start_order(start_ns, saved), name, incarnation)
        self._restarts_due.pop(name, None)
        self._lives(name, incarnation)
        self._sink.event({"event": "restarted", "agent": name, "incarnation": incarnation, "time_ns": start_ns})

    def restart_later(self, kill: Kill) -> None:
        """An agent that a live fault kills comes back when the fault ends."""
        self._restart_later(kill, self.current(kill.agent)[1] + 1)

    def _restart_later(self, kill: Kill, incarnation: int) -> None:
        if kill.until_ns is not None and kill.until_ns < self._end_ns:
            self._restarts_due[kill.agent] = kill.until_ns
            self._background(self._restart_at(kill, kill.until_ns, incarnation))

    async def _restart_at(self, kill: Kill, until_ns: int, incarnation: int) -> None:
        """In realtime pace the process stands by beforehand; in lockstep everybody waits for it."""
        key = (kill.agent, incarnation)
        if self.pace == "realtime":
            await asyncio.sleep(max(0.0, (until_ns - self.ahead_ns(_STANDBY_S)) / 1e9 / self._speed))
        else:
            await self._members[kill.agent, incarnation - 1].ended.wait()
        if (kill.agent, incarnation - 1) not in self._gone:
            await self._prepare(key)
            async with self.intervening:
                await self.revive(key, kill, until_ns)

    async def stop(self) -> None:
        """End the run early, at one nominal instant for all."""
        if not self.ready.is_set():
            self._problems.append("stopped before the run began")
            self._over.set()
            return
        held = (await self.order({"do": "hold"})).values()
        self._end_ns = max([*held, self.ahead_ns(_STOP_AHEAD_S)]) + 1 if self.pace == "realtime" else max(held) + 1
        await self.order({"do": "end", "instant_ns": self._end_ns})
        await self.order({"do": "release"})
        self._sink.event({"event": "stopped", "time_ns": self._end_ns})

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
            elif event["event"] == "state":
                member.state.set_result(bytes.fromhex(event["state"]))
            elif event["event"] == "crashed":
                self._problems.append(f"agent {batch.agent} failed: {event['error']}")
        self.status.take(batch, min(now_ns, self._end_ns))
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
        told_to_go = member.done or self._over.is_set()
        if not (told_to_go and member.process.exitcode == 0):
            self._died(name, incarnation, member)
        self._check_over()

    def _died(self, name: str, incarnation: int, member: _Member) -> None:
        """By a fault, or from outside: then nobody waits for it any more, and what has not come of it never does."""
        injected = (name, incarnation) in self._kills_expected and not member.stopped_from_outside
        cause = "injected" if injected else _cause(member)
        self._sink.event(
            {"event": "died", "agent": name, "incarnation": incarnation, "time_ns": self.now_ns(), "cause": cause}
        )
        if injected:
            return
        self._gone.add((name, incarnation))
        self._restarts_due.pop(name, None)
        if cause.startswith("ended"):
            self._problems.append(f"agent {name} {cause}")
        if self.pace == "lockstep" and cause.startswith("ended"):
            self._over.set()
        elif self.pace == "lockstep" and self.ready.is_set():
            self._background(self._tell_gone(name, incarnation))

    async def _tell_gone(self, name: str, incarnation: int) -> None:
        await self.order({"do": "gone", "agent": name, "incarnation": incarnation})

    def _check_over(self) -> None:
        newest = {name: self._members[self.current(name)] for name, _ in self._members}
        to_come = [until_ns for until_ns in self._restarts_due.values() if until_ns < self._end_ns]
        if all(member.done or member.ended.is_set() for member in newest.values()) and not to_come:
            self._over.set()

    async def _watch_the_end(self) -> None:
        """Realtime pace does not wait for ever for an agent that says nothing."""
        while self.pace == "realtime":
            overdue_s = (self.now_ns() - self._end_ns) / 1e9 / self._speed
            if overdue_s > _OVERDUE_S:
                silent = [
                    name for (name, _), member in self._members.items() if not (member.done or member.ended.is_set())
                ]
                self._problems.append(f"agents {', '.join(silent)} have not ended {_OVERDUE_S:g} s after the run")
                self._over.set()
                return
            await asyncio.sleep(1.0)

    async def _watch_for_stopped(self) -> None:
        """A process that is stopped from outside for a while counts as dead."""
        since: dict[int, float] = {}
        while True:
            await asyncio.sleep(_LOOK_EVERY_S)
            for member in list(self._members.values()):
                pid = member.process.pid
                if pid is None or member.ended.is_set() or not _is_stopped(pid):
                    since.pop(pid or 0, None)
                elif time.monotonic() - since.setdefault(pid, time.monotonic()) > _STOPPED_S:
                    member.stopped_from_outside = True
                    member.process.kill()

    # -- ending -------------------------------------------------------------------------------------------------

    async def _finish(self) -> None:
        """Let the agents go, once their last batches are here."""
        last = await self.order({"do": "stop"})
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_LEAVE_TIMEOUT_S):
                while any(self._members[key].batches < number for key, number in last.items()):
                    self._news.clear()
                    await self._news.wait()
        for key, number in last.items():
            if self._members[key].batches < number:
                self._problems.append(f"agent {key[0]}: its last journal batch was lost on the way")
        self._sink.event({"event": "finished", "time_ns": self._end_ns})

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


async def _first(*events: asyncio.Event) -> None:
    waits = [asyncio.ensure_future(event.wait()) for event in events]
    await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
    for wait in waits:
        wait.cancel()


def _is_stopped(pid: int) -> bool:
    """Whether a signal has stopped a process: state T in /proc, after the name in brackets."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] == "T"
    except (FileNotFoundError, ProcessLookupError):
        return False


def _cause(member: _Member) -> str:
    if member.stopped_from_outside:
        return "was stopped from outside"
    exit_code = member.process.exitcode
    return "was killed from outside" if exit_code is not None and exit_code < 0 else f"ended with exit code {exit_code}"
