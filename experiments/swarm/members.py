"""The state of a swarm's processes, as their supervisor knows it."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from multiprocessing.context import ForkServerProcess
from pathlib import Path

from ..record.record import INJECTED

_LOOK_EVERY_S = 0.5
_STOPPED_S = 2.0
_LAST_BATCH_S = 1.0


@dataclass
class Member:
    """One process.

    joined: it has joined the swarm.
    ended: it has ended.
    killed: it has reported that a fault kills it.
    failed: it has reported an error of its agent.
    buried: it has ended, and the cause is known.
    done: it has reported its regular end.
    stopped_from_outside: it was stopped externally (SIGSTOP).
    batches: number of received journal batches.
    now_ns: how far its agent had come at the last of them.
    behind_ns: how far behind the clock it was since the one before, in wall time.
    state: what its agent saves when it is killed by a fault that keeps the state.
    """

    process: ForkServerProcess
    joined: asyncio.Event = field(default_factory=asyncio.Event)
    ended: asyncio.Event = field(default_factory=asyncio.Event)
    killed: asyncio.Event = field(default_factory=asyncio.Event)
    failed: asyncio.Event = field(default_factory=asyncio.Event)
    buried: asyncio.Event = field(default_factory=asyncio.Event)
    done: bool = False
    stopped_from_outside: bool = False
    batches: int = 0
    now_ns: int = 0
    behind_ns: int = 0
    state: asyncio.Future[bytes] = field(default_factory=lambda: asyncio.get_running_loop().create_future())

    async def cause(self) -> str:
        """The cause of its end: a fault, whose report may still be on its way, or an external cause."""
        reported = {-signal.SIGKILL: self.killed, 1: self.failed}.get(self.process.exitcode or 0)
        if reported is not None:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_LAST_BATCH_S):
                    await reported.wait()
        if self.killed.is_set():
            return INJECTED
        if self.stopped_from_outside:
            return "was stopped from outside"
        exit_code = self.process.exitcode
        killed = exit_code is not None and exit_code < 0
        return "was killed from outside" if killed else f"ended with exit code {exit_code}"


async def joined_or_ended(member: Member) -> None:
    """Wait until a process has joined the swarm or has ended."""
    waits = [asyncio.ensure_future(event.wait()) for event in (member.joined, member.ended)]
    await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
    for wait in waits:
        wait.cancel()


async def watch_for_stopped(members: Callable[[], Iterable[Member]]) -> None:
    """Kill processes that stay stopped externally (SIGSTOP)."""
    since: dict[int, float] = {}
    while True:
        await asyncio.sleep(_LOOK_EVERY_S)
        for member in list(members()):
            pid = member.process.pid
            if pid is None or member.ended.is_set() or not _is_stopped(pid):
                since.pop(pid or 0, None)
            elif time.monotonic() - since.setdefault(pid, time.monotonic()) > _STOPPED_S:
                member.stopped_from_outside = True
                member.process.kill()


def _is_stopped(pid: int) -> bool:
    """Whether a signal has stopped a process: state T in /proc, after the name in brackets."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] == "T"
    except (FileNotFoundError, ProcessLookupError):
        return False
