"""The shell of one agent's OS process: a Zenoh session, an asyncio loop, a pacer and a node."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import gc
import os
import resource
import signal
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing import parent_process
from pathlib import Path
from typing import Any, Literal

import msgpack
import numpy as np
import uvloop

from ..errors import RunFailed
from ..transport import fabric
from ..transport import zenoh_session as zs
from ..transport.events import Event
from ..transport.frames import DamagedFrame, Message, air_promise, decode, encode, promise
from ..transport.keys import Keys
from ..transport.media_settings import AIR, on_air
from ..user_code import described
from .exact_pace import Exact
from .journal import Batch
from .loaded_sources import loaded_sources
from .node import Node
from .plan_codec import decode_plan, decode_value
from .realtime_pace import Realtime
from .run_start import RunStart
from .sender import Put
from .wall_clock import WallClock

FLUSH_EVERY_S = 0.2
_YOUNG_GARBAGE, _ALL_GARBAGE, _ALL_EVERY = 1, 2, 50
_REHEARSAL_NS = 200_000_000
_ORDERS_LIMIT = 1_000
_NEEDS_NODE = {"arm", "external-kill", "freeze", "prepare", "thaw", "end"}
"""Orders without effect on a process on standby: it is told everything when its incarnation starts."""
Pace = Literal["exact", "lockstep", "realtime"]
"""Lockstep is exact pace without a clock."""


@dataclass(frozen=True)
class Assignment:
    """What one process runs, the plan as `plan_codec` encodes it, and how it joins."""

    plan: str
    name: str
    incarnation: int
    run: str
    endpoint: str
    password: str
    pace: Pace
    speed: float


def main(assignment: Assignment, path: list[str]) -> None:
    """Entry of the process; `path` is where the user's own modules are found."""
    gc.freeze()  # what was loaded before the fork stays shared: the collector writes into every object that it looks at
    gc.disable()  # it is called with the journal, between events
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _end_with_supervisor()
    sys.path[:] = path
    uvloop.run(_Shell(assignment).live())


def _end_with_supervisor() -> None:
    """Let the kernel kill this process once the supervisor has ended and its end of a pipe is closed.

    This also ends agents that are still joining, or whose own code never returns to the loop.
    """
    parent = parent_process()
    assert parent is not None
    pipe = parent.sentinel
    fcntl.fcntl(pipe, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(pipe, fcntl.F_SETSIG, signal.SIGKILL)
    fcntl.fcntl(pipe, fcntl.F_SETFL, fcntl.fcntl(pipe, fcntl.F_GETFL) | os.O_ASYNC)
    if not parent.is_alive():
        sys.exit(1)


class _Shell:
    """Ties the session, the pacer and the node together."""

    def __init__(self, assignment: Assignment) -> None:
        self._it = assignment
        self._plan = decode_plan(assignment.plan)
        self._keys = Keys(assignment.run)
        self._control = self._keys.control(assignment.name, assignment.incarnation)
        self._node: Node | None = None
        self._batches = 0
        self._finished = self._killed = self._crashed = False

    async def live(self) -> None:
        """Join the swarm, run until stopped, and close the session."""
        it, keys = self._it, self._keys
        loop = self._loop = asyncio.get_running_loop()
        self._stopped = asyncio.Event()
        session = zs.open_client(it.endpoint, zs.Credentials(it.name, it.password))
        try:
            me = self._plan.agent(it.name)
            radio = {other for other in me.neighbours if on_air(self._plan.links[it.name, other].medium)}
            self._links = {
                other: zs.publisher(session, keys.link(it.name, other))
                for other in me.neighbours + me.wired
                if other not in radio
            }
            if radio:
                self._links[AIR] = zs.publisher(session, keys.air(it.name))
            self._telemetry = zs.publisher(session, keys.telemetry(it.name))
            self._pacer = self._paced(loop)
            self._orders = zs.Inbox(loop, _ORDERS_LIMIT, self._ordered)
            self._hearing = session.declare_subscriber(keys.inbox(it.name), self._heard)
            self._listening = session.declare_subscriber(keys.air("*"), self._heard) if radio else None
            self._answering = session.declare_queryable(self._control, self._orders.push)
            self._token = session.liveliness().declare_token(keys.alive(it.name, it.incarnation))
            await self._flush_until_stopped()
        finally:
            session.close()
        if self._killed:
            os.kill(os.getpid(), signal.SIGKILL)
        if self._crashed:
            sys.exit(1)

    def _paced(self, loop: asyncio.AbstractEventLoop) -> Exact | Realtime:
        pace, speed = self._it.pace, self._it.speed
        if pace == "realtime":
            return Realtime(loop, self._write, self._done, self._guard, speed)
        clock_of = None if pace == "lockstep" else partial(WallClock, loop, speed=speed)
        return Exact(loop, self._write, self._done, self._guard, clock_of)

    def _write(self, outlet: str, message: Message) -> None:
        self._links[outlet].put(encode(message))

    def _guard(self, handle: Callable[[], None]) -> Callable[[], None]:
        """Wrap a function: an exception in the agent's code is journalled and ends the process."""

        def guarded() -> None:
            if self._crashed:
                return
            try:
                handle()
            except BaseException as error:  # noqa: BLE001 - whatever a user's agent raises is reported and ends it
                self._crash(error)

        return guarded

    def _crash(self, error: BaseException) -> None:
        """Report an error, with the lines of the user's code, and end the process."""
        self._flush()
        name = self._it.name
        text = str(error) if isinstance(error, RunFailed) else f"agent {name} failed: {described(error)}"
        self._publish(Batch(name, self._it.incarnation, events=[{"event": "crashed", "error": text}]))
        self._crashed = True
        self._stopped.set()

    # -- what comes in ------------------------------------------------------------------------------------------

    def _heard(self, sample: zs.Sample) -> None:
        """Called on Zenoh's thread."""
        try:
            frame = decode(sample.payload.to_bytes())
        except DamagedFrame as error:
            self._loop.call_soon_threadsafe(self._crash, error)
        else:
            self._pacer.arrived(Keys.source_of(str(sample.key_expr)), frame)

    def _ordered(self, queries: list[zs.Query]) -> None:
        for query in queries:
            with query:
                order = msgpack.unpackb(zs.asked(query))
                try:
                    answer = self._obey(order.pop("do"), **order)
                except BaseException as error:  # noqa: BLE001 - the agent's code runs in some orders too
                    self._crash(error)
                else:
                    query.reply(self._control, msgpack.packb(answer))

    def _obey(self, do: str, **order: Any) -> Any:
        orders: dict[str, Callable[..., Any]] = {
            "rehearse": self._rehearse,
            "start": self._start,
            "arm": self._arm,
            "external-kill": self._external_kill,
            "freeze": self._pacer.freeze,
            "prepare": self._pacer.prepare,
            "thaw": self._pacer.thaw,
            "end": self._end,
            "stop": self._stop,
        }
        if self._node is None and do in _NEEDS_NODE:
            return True if do in ("arm", "prepare") else 0
        return orders[do](**order)

    def _rehearse(self) -> bool:
        """Warm up: use each link once, and run the first moments on throw-away nodes that hear their own frames.

        Agents are pure and a promise of 0 says nothing, so this has no effect but warm code and known routes: the first
        round of the run is not slower than the rest. What a user's agent prints, or is warned of, is left out.
        """
        for outlet in self._links:
            say = air_promise if outlet == AIR else promise
            self._write(outlet, say(self._it.incarnation, 0, 0))
        silent = contextlib.redirect_stdout(None), contextlib.redirect_stderr(None), warnings.catch_warnings()
        with contextlib.suppress(BaseException), silent[0], silent[1], silent[2]:
            warnings.simplefilter("ignore")
            self._play()
        return True

    def _play(self) -> None:
        """Run the first moments, together with the coupled world where there is one, or one agent for that."""
        plan, me = self._plan, self._plan.agent(self._it.name)
        heap: list[Event] = []
        nodes: dict[str, Node] = {}

        def carry(source: str) -> Put:
            def put(outlet: str, message: Message) -> None:
                if outlet in nodes:
                    nodes[outlet].receiver.receive(source, decode(encode(message)))
                elif source == me.name and outlet not in me.wired:
                    for target in me.neighbours if outlet == AIR else (outlet,):
                        nodes[source].receiver.receive(target, decode(encode(message)))

            return put

        for name in (me.name, *me.wired[:1]):
            nodes[name] = Node(plan, name, heap, carry(name))
        fabric.run(heap, _REHEARSAL_NS)

    def _start(self, start_ns: int, faults: list[Any], saved: bytes | None, run_start: dict[str, Any]) -> bool:
        """Start this incarnation at `start_ns`, with the live faults so far and the state saved before."""
        it = self._it
        node = Node(self._plan, it.name, [], self._pacer.put, it.incarnation, start_ns, saved=saved)
        for fault in faults:
            node.arm(decode_value(fault))
        self._node = node
        kills = tuple((name, incarnation) for name, incarnation in run_start.pop("external_kills"))
        instants = tuple(run_start.pop("interventions"))
        self._pacer.begin(node, RunStart(external_kills=kills, interventions=instants, **run_start))
        return True

    def _external_kill(self, agent: str, incarnation: int) -> bool:
        """Another agent was killed externally."""
        self._pacer.external_kill(agent, incarnation)
        return True

    def _arm(self, faults: list[Any], instant_ns: int) -> bool:
        return self._pacer.arm([decode_value(fault) for fault in faults], instant_ns)

    def _end(self, instant_ns: int) -> bool:
        """End the run earlier than planned; whether the instant is still to come."""
        return self._pacer.end_at(instant_ns)

    def _stop(self) -> int:
        """End the process; the number of its last batch, which is sent after this answer."""
        self._finish()
        self._stopped.set()
        return 0 if self._node is None else self._batches + 1

    # -- what goes out ------------------------------------------------------------------------------------------

    def _flush(self) -> None:
        if self._node is not None:
            self._publish(self._node.take_journal())

    def _publish(self, batch: Batch) -> None:
        self._batches += 1
        now_ns = 0 if self._node is None else self._pacer.now_ns()
        head = {"number": self._batches, "now_ns": now_ns, "behind_ns": self._pacer.take_behind_ns()}
        self._telemetry.put(msgpack.packb(head | batch.to_dict()))

    def _flush_now_and_then(self) -> None:
        self._flushing = self._loop.call_later(FLUSH_EVERY_S, self._flush_now_and_then)
        self._flush()
        gc.collect(_ALL_GARBAGE if self._batches % _ALL_EVERY == 0 else _YOUNG_GARBAGE)

    async def _flush_until_stopped(self) -> None:
        self._flush_now_and_then()
        await self._stopped.wait()
        self._flushing.cancel()
        self._flush()
        self._pacer.close()

    def _done(self) -> None:
        """The node has ended: by an injected kill, or with the run."""
        assert self._node is not None
        if self._node.state.dead and not self._killed:
            self._killed = True
            self._stopped.set()
        elif not self._node.state.dead:
            self._finish()

    def _finish(self) -> None:
        if self._node is None or self._finished:
            return
        self._finished = True
        if not self._node.state.dead:
            self._node.finish()
        timing = self._pacer.timing()
        timing["lateness_ns"] = _quantiles(timing["lateness_ns"])
        usage = resource.getrusage(resource.RUSAGE_SELF)
        self._node.state.journal.events.append(
            {
                "event": "done",
                "time_ns": self._pacer.now_ns(),
                "cpu_s": usage.ru_utime + usage.ru_stime,
                "pss_kb": _pss_kb(),
                "promises": self._pacer.promises,
                "overflowed": self._pacer.mail.overflowed,
                "sources": loaded_sources(),
                **timing,
            }
        )


def _pss_kb() -> int:
    """Proportional set size of this process: its own memory and its share of what it has in common with others."""
    rollup = Path("/proc/self/smaps_rollup").read_text(encoding="ascii")
    return next(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:"))


def _quantiles(lateness_ns: list[int]) -> list[int]:
    """Median, 99th percentile and largest of how late events were handled; empty in lockstep pace."""
    if not lateness_ns:
        return []
    return [int(value) for value in np.quantile(lateness_ns, [0.5, 0.99, 1.0])]
