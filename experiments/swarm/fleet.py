"""The processes of a swarm: their start, orders to them, and their end."""

from __future__ import annotations

import asyncio
import secrets
import sys
import time
from collections.abc import Coroutine, Mapping
from typing import Any

import msgpack

from ...agents.plan import Plan
from ...agents.plan_codec import encode_plan, encode_value
from ...agents.process import Assignment, Pace
from ...errors import RunFailed
from ...transport import zenoh_session as zs
from ...transport.faults import Fault, Kill
from ...transport.keys import CONTROL_CLIENT, Keys
from ..record.record import INJECTED
from ..twin import RecordSink
from .members import Member, joined_or_ended
from .spawning import spawn
from .status import Status, WatchedSink

_JOIN_TIMEOUT_S = 60.0
_ANSWER_TIMEOUT_S = 10.0


class Fleet:
    """The processes of one run of a plan, and the state of the run that they are given at their start.

    Args:
        plan: the plan.
        sink: receives the entries of the record.
        run: name of the run in the keys.
        pace: exact, lockstep or realtime.
        speed: nominal seconds per wall second, in exact and realtime pace.

    The lock `intervening` is held while a live fault is armed or an incarnation is started, so that a new incarnation
    knows every fault armed before, and receives every later one. `ready`: all agents have been started. `over`: all
    agents have ended, or the run has failed; the run ends when `intervening` is free. `returns_due`: id → kill whose
    agent is to return and has no process on standby yet.
    """

    def __init__(self, plan: Plan, sink: RecordSink, run: str, pace: Pace, speed: float) -> None:
        self.plan, self.pace, self.speed = plan, pace, speed
        self.loaded_sources: dict[str, str] = {}
        self._encoded_plan = encode_plan(plan)
        self.status = Status(plan)
        self.sink = WatchedSink(sink, self.status)
        self.keys = Keys(run)
        self.endpoint = ""
        names = *(agent.name for agent in plan.all_agents), CONTROL_CLIENT
        self.passwords = {name: secrets.token_urlsafe(18) for name in names}
        self.session: zs.Session
        self.loop: asyncio.AbstractEventLoop
        self.live_faults: dict[str, Fault] = {fault.id: fault for fault in plan.faults}
        self.interventions: list[int] = []
        self.intervening = asyncio.Lock()
        self.external_kills: set[tuple[str, int]] = set()
        self.returns_due: dict[str, Kill] = {}
        self.epoch_ns = 0
        self.end_ns = plan.duration_ns
        self.ready = asyncio.Event()
        self.over = asyncio.Event()
        self.problems: list[str] = []
        self.members: dict[tuple[str, int], Member] = {}
        self.tasks: set[asyncio.Task[None]] = set()
        self._living: dict[str, int] = {}

    # -- processes start ----------------------------------------------------------------------------------------

    def spawn(self, name: str, incarnation: int) -> Member:
        """Start a process for an incarnation of an agent."""
        assignment = Assignment(
            self._encoded_plan,
            name,
            incarnation,
            self.keys.run,
            self.endpoint,
            self.passwords[name],
            self.pace,
            self.speed,
        )
        member = Member(spawn(assignment, list(sys.path)))
        self.members[name, incarnation] = member
        self.loop.add_reader(member.process.sentinel, self._process_ended, name, incarnation)
        return member

    async def joined(self, who: list[tuple[str, int]]) -> None:
        """Wait until these processes have joined.

        Raises:
            RunFailed: one has not joined in time, or has ended.
        """
        try:
            async with asyncio.timeout(_JOIN_TIMEOUT_S):
                for key in who:
                    member = self.members[key]
                    await joined_or_ended(member)
        except TimeoutError:
            missing = [name for name, incarnation in who if not self.members[name, incarnation].joined.is_set()]
            raise RunFailed(f"agents {', '.join(missing)} have not joined within {_JOIN_TIMEOUT_S:g} s") from None
        if dead := [name for name, incarnation in who if self.members[name, incarnation].ended.is_set()]:
            raise RunFailed(f"agents {', '.join(dead)} ended before the run began")

    def start_order(self, start_ns: int, saved: bytes | None = None) -> dict[str, Any]:
        """The order to start an incarnation at an instant, with the present state of the run."""
        run_start = {
            "epoch_ns": self.epoch_ns,
            "end_ns": self.end_ns,
            "interventions": self.interventions,
            "external_kills": sorted(self.external_kills),
        }
        faults = [encode_value(fault) for fault in self.live_faults.values()]
        return {"do": "start", "start_ns": start_ns, "faults": faults, "saved": saved, "run_start": run_start}

    async def bring_to_life(self, key: tuple[str, int], start_ns: int, saved: bytes | None) -> None:
        """Start the incarnation of a process on standby at an instant, with the state saved before, if any."""
        name, incarnation = key
        if key not in await self.order(self.start_order(start_ns, saved), name, incarnation):
            return  # it has failed, and says so itself
        self.mark_alive(name, incarnation)
        self.sink.event({"event": "restarted", "agent": name, "incarnation": incarnation, "time_ns": start_ns})

    def mark_alive(self, name: str, incarnation: int) -> None:
        """Note that an incarnation is alive."""
        self._living[name] = incarnation
        self.status.alive.add(name)

    # -- orders to processes, and their incarnations ------------------------------------------------------------------

    def now_ns(self) -> int:
        """Nominal time: by the clock in realtime pace, else how far the slowest agent has come, as reported."""
        return self.ahead_ns(0.0) if self.pace == "realtime" else self.status.time_ns

    def ahead_ns(self, wall_s: float) -> int:
        """The nominal instant that the clock reaches so many wall seconds from now; not in lockstep pace."""
        elapsed_ns = time.monotonic_ns() - self.epoch_ns if self.epoch_ns else 0
        return max(0, int((elapsed_ns + wall_s * 1e9) * self.speed))

    async def order(
        self, order: Mapping[str, Any], name: str = "*", incarnation: int | str = "*"
    ) -> dict[tuple[str, int], Any]:
        """Send an order to all agents or to one; the answers of those that are alive."""
        answers = await zs.ask(
            self.session, self.keys.control(name, incarnation), msgpack.packb(order), _ANSWER_TIMEOUT_S
        )
        return {Keys.agent_of(key): msgpack.unpackb(answer) for key, answer in answers.items()}

    def current(self, name: str) -> tuple[str, int]:
        """The newest incarnation of an agent."""
        return name, max(incarnation for agent, incarnation in self.members if agent == name)

    def pids(self) -> dict[str, int]:
        """Agent → process id of its newest incarnation."""
        newest = {name: self.members[self.current(name)].process.pid for name, _ in self.members}
        return {name: pid for name, pid in newest.items() if pid is not None}

    def living(self) -> list[Member]:
        """The processes of all living agents."""
        return [self.members[key] for key in self._living.items() if key[0] in self.status.alive]

    def is_alive(self, name: str) -> bool:
        """Whether an agent is alive; a process on standby is not."""
        return name in self.status.alive

    def member(self, name: str, incarnation: int) -> Member:
        """The process of one incarnation of an agent."""
        return self.members[name, incarnation]

    def before(self, key: tuple[str, int]) -> Member:
        """The process of the agent's previous incarnation."""
        name, incarnation = key
        earlier = (number for agent, number in self.members if agent == name and number < incarnation)
        return self.members[name, max(earlier)]

    # -- processes end -----------------------------------------------------------------------------------------------

    def dismiss(self, key: tuple[str, int]) -> None:
        """Mark a process on standby as done: the run ends before it is needed."""
        self.members[key].done = True
        self.check_over()

    def _process_ended(self, name: str, incarnation: int) -> None:
        member = self.members[name, incarnation]
        self.loop.remove_reader(member.process.sentinel)
        member.process.join()
        member.ended.set()
        if self._living.get(name) == incarnation:
            self.status.alive.discard(name)
        if (member.done or self.over.is_set()) and member.process.exitcode == 0:
            member.buried.set()
            self.check_over()
        else:
            self.background(self._bury(name, incarnation, self.now_ns()))

    async def _bury(self, name: str, incarnation: int, time_ns: int) -> None:
        """Record how a process ended; inform the others of one that was killed externally."""
        cause = await self.members[name, incarnation].cause()
        death = {"event": "died", "agent": name, "incarnation": incarnation, "time_ns": time_ns, "cause": cause}
        self.sink.event(death)
        if cause != INJECTED:
            await self._ended_externally(name, incarnation, cause)
        self.members[name, incarnation].buried.set()
        self.check_over()

    async def _ended_externally(self, name: str, incarnation: int, cause: str) -> None:
        self.external_kills.add((name, incarnation))
        self.returns_due = {id_: kill for id_, kill in self.returns_due.items() if kill.agent != name}
        failed = self.members[name, incarnation].failed.is_set()
        if not failed and (cause.startswith("ended") or name in {one.name for one in self.plan.world_agents}):
            self.problems.append(f"agent {name} {cause}")
        if self.pace != "realtime" and cause.startswith("ended"):
            self.over.set()
        elif self.ready.is_set():
            await self.order({"do": "external-kill", "agent": name, "incarnation": incarnation})

    def check_over(self) -> None:
        """End the run if every agent has ended and none is to return."""
        newest = {name: self.members[self.current(name)] for name, _ in self.members}
        to_come = [kill for kill in self.returns_due.values() if kill.until_ns and kill.until_ns < self.end_ns]
        if all(member.done or member.buried.is_set() for member in newest.values()) and not to_come:
            self.over.set()

    # -- work in the background --------------------------------------------------------------------------------------

    def background(self, work: Coroutine[Any, Any, None]) -> None:
        """Run a coroutine in the background, cancelled at the end of the swarm."""
        task = self.loop.create_task(work)
        self.tasks.add(task)
        task.add_done_callback(self._background_ended)

    def _background_ended(self, task: asyncio.Task[None]) -> None:
        """Report a failure in the background and end the run."""
        self.tasks.discard(task)
        if not task.cancelled() and (error := task.exception()):
            self.problems.append(str(error) or repr(error))
            self.over.set()
