"""The other sides of the benchmarks: processes from the same fork server, without volery."""

from __future__ import annotations

import multiprocessing
import time
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, Self

import bare_processes
from shapes import BEGIN_NS, SECOND_NS, cpu_summary, delay_summary, end_ns, phase_ns, pss_mb, ring

from volery.experiments.swarm.spawning import prepare
from volery.transport import zenoh_session as zs

_ANSWER_TIMEOUT_S = 40.0
_HEAD_START_NS = 300_000_000


class _Crowd:
    """Processes with a pipe to each; any message ends them."""

    def __init__(self) -> None:
        prepare()
        self._context = multiprocessing.get_context("forkserver")
        self.processes: list[Any] = []
        self.pipes: list[Connection] = []

    def spawn(self, target: Any, first: str, *arguments: Any) -> None:
        """Start a process: `target(first, pipe, …)`."""
        mine, its = self._context.Pipe()
        process = self._context.Process(target=target, args=(first, its, *arguments), daemon=True)
        process.start()
        its.close()
        self.processes.append(process)
        self.pipes.append(mine)

    def ask(self) -> list[Any]:
        """The next message of each process."""
        answers = []
        for pipe in self.pipes:
            if not pipe.poll(_ANSWER_TIMEOUT_S):
                raise TimeoutError(f"a process has not answered within {_ANSWER_TIMEOUT_S:g} s")
            answers.append(pipe.recv())
        return answers

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for pipe, process in zip(self.pipes, self.processes, strict=True):
            if error is None:
                pipe.send("end")
            else:
                process.kill()
        for process in self.processes:
            process.join()


class _Hub:
    """A router without access control."""

    def __enter__(self) -> Self:
        with TemporaryDirectory() as folder:
            passwords = Path(folder) / "passwords"
            passwords.write_text("bench:bench\n", "ascii")
            self.session, self.endpoint = zs.open_hub("tcp/127.0.0.1:0", {"enabled": False}, passwords)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.session.close()


# -- samples, see measuring.fresh ---------------------------------------------------------------------------------


def cpu(agents: int, degree: int, rate: float, seconds: float) -> dict[str, float]:
    """Processor time of all processes per message, from put to receive [µs]."""
    with _Hub() as hub, _Crowd() as crowd:
        for name, neighbours in ring(agents, degree).items():
            crowd.spawn(bare_processes.talk, hub.endpoint, name, neighbours, rate)
        crowd.ask()
        epoch_ns = time.monotonic_ns() + _HEAD_START_NS
        for index, pipe in enumerate(crowd.pipes):
            first_ns = epoch_ns + phase_ns(index, agents, rate)
            pipe.send((first_ns, epoch_ns + BEGIN_NS, epoch_ns + end_ns(seconds)))
        return cpu_summary(crowd.ask())


def startup(agents: int) -> dict[str, float]:
    """Time until every process has a session and a token [s], and memory per process [MB]."""
    began = time.monotonic_ns()
    alive: dict[str, int] = {}
    with _Hub() as hub, _Crowd() as crowd:
        tokens = hub.session.liveliness().declare_subscriber(
            "bench/alive/*", lambda token: alive.setdefault(str(token.key_expr), time.monotonic_ns())
        )
        for number in range(agents):
            crowd.spawn(bare_processes.live, hub.endpoint, str(number))
        deadline = time.monotonic() + _ANSWER_TIMEOUT_S
        while len(alive) < agents:
            if time.monotonic() > deadline:
                raise TimeoutError(f"{agents - len(alive)} of {agents} processes are not alive")
            time.sleep(0.01)
        pss = pss_mb([process.pid for process in crowd.processes])
        del tokens
    return {"alive_s": (max(alive.values()) - began) / 1e9, "pss_mb": pss}


def relay(kind: str, agents: int, degree: int, rate: float, seconds: float, latency_ms: float) -> dict[str, float]:
    """Delay error [µs] of UDP packets on loopback that each receiver holds with `timerfd` or `call_at`."""
    neighbours = ring(agents, degree)
    with _Crowd() as crowd:
        for _ in neighbours:
            crowd.spawn(bare_processes.relay, kind, rate, int(latency_ms * 1e6))
        ports = dict(zip(neighbours, crowd.ask(), strict=True))
        epoch_ns = time.monotonic_ns() + _HEAD_START_NS
        for index, (pipe, near) in enumerate(zip(crowd.pipes, neighbours.values(), strict=True)):
            first_ns = epoch_ns + phase_ns(index, agents, rate)
            to = [ports[other] for other in near]
            pipe.send((to, first_ns, epoch_ns + BEGIN_NS, epoch_ns + int(seconds * SECOND_NS)))
        return delay_summary(error for errors in crowd.ask() for error in errors)
