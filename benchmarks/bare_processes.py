"""Code of the processes that volery is compared with; imports only what they need."""

from __future__ import annotations

import asyncio
import socket
import time
from collections import deque
from heapq import heappop, heappush
from multiprocessing.connection import Connection
from typing import Any

import uvloop
from shapes import PAYLOAD_BYTES, SECOND_NS

from volery.transport import zenoh_session as zs
from volery.transport.frames import Frame, encode
from volery.transport.timerfd import TimerFd

# -- Zenoh --------------------------------------------------------------------------------------------------------


class _Talker:
    """Sends the same bytes to every neighbour at a rate; receives with a callback, a deque and one wake-up."""

    def __init__(self, session: zs.Session, name: str, neighbours: tuple[str, ...], rate: float) -> None:
        self.loop = asyncio.get_running_loop()
        self.publishers = [zs.publisher(session, f"bench/link/{name}/{other}") for other in neighbours]
        self.period_ns = SECOND_NS / rate
        self.queue: deque[Any] = deque()
        self.armed = False
        self.frames = 0
        body = b"x" * PAYLOAD_BYTES
        self.bytes = encode(Frame(0, 1000, 2 * SECOND_NS, 0, 2 * SECOND_NS, "delivered", body, 1001, None))
        self.receiver = session.declare_subscriber(f"bench/link/*/{name}", self._push)

    def _push(self, sample: Any) -> None:
        self.queue.append(sample)
        if not self.armed:
            self.armed = True
            self.loop.call_soon_threadsafe(self._drain)

    def _drain(self) -> None:
        self.armed = False
        while self.queue:
            self.queue.popleft().payload.to_bytes()
            self.frames += 1

    async def talk(self, first_ns: int, begin_ns: int, end_ns: int) -> tuple[float, int]:
        """Send from `first_ns`; processor time and number of received frames between `begin_ns` and `end_ns`."""
        turns = 0

        def send() -> None:
            nonlocal turns
            for publisher in self.publishers:
                publisher.put(self.bytes)
            turns += 1
            timer.set(first_ns + int(turns * self.period_ns))

        timer = TimerFd(self.loop, send)
        timer.set(first_ns)
        await asyncio.sleep((begin_ns - time.monotonic_ns()) / 1e9)
        before = (time.process_time(), self.frames)
        await asyncio.sleep((end_ns - time.monotonic_ns()) / 1e9)
        after = (time.process_time(), self.frames)
        timer.close()
        return after[0] - before[0], after[1] - before[1]


def talk(endpoint: str, pipe: Connection, name: str, neighbours: tuple[str, ...], rate: float) -> None:
    """A process that sends and receives over Zenoh."""

    async def life() -> None:
        session = zs.open_client(endpoint, zs.Credentials("bench", "bench"))
        try:
            talker = _Talker(session, name, neighbours, rate)
            pipe.send("ready")
            pipe.send(await talker.talk(*await asyncio.to_thread(pipe.recv)))
            await asyncio.to_thread(pipe.recv)
        finally:
            session.close()

    uvloop.run(life())


def live(endpoint: str, pipe: Connection, name: str) -> None:
    """A process with a session and a liveliness token only."""
    session = zs.open_client(endpoint, zs.Credentials("bench", "bench"))
    token = session.liveliness().declare_token(f"bench/alive/{name}")
    pipe.recv()
    del token
    session.close()


# -- UDP ----------------------------------------------------------------------------------------------------------


class _Relay:
    """Sends packets with the time of sending, holds received ones for a time, and records the error of that time."""

    def __init__(self, sock: socket.socket, hold_ns: int, begin_ns: int) -> None:
        self.loop = asyncio.get_running_loop()
        self.sock = sock
        self.hold_ns = hold_ns
        self.begin_ns = begin_ns
        self.errors: list[int] = []
        self.loop.add_reader(sock, self._readable)

    def _readable(self) -> None:
        try:
            while True:
                packet = self.sock.recv(2048)
                self.hold(int.from_bytes(packet[:8], "little") + self.hold_ns, packet)
        except BlockingIOError:
            return

    def hold(self, due_ns: int, packet: bytes) -> None:
        """Hold a packet until it is due."""
        raise NotImplementedError

    def deliver(self, due_ns: int, packet: bytes) -> None:
        """Record the delay error."""
        now = time.monotonic_ns()
        if due_ns >= self.begin_ns:
            self.errors.append(now - due_ns)

    async def talk(self, ports: list[int], first_ns: int, rate: float, end_ns: int) -> None:
        """Send to every neighbour at a rate."""
        turns = 0

        def send() -> None:
            nonlocal turns
            for port in ports:
                self.sock.sendto(time.monotonic_ns().to_bytes(8, "little") + b"x" * PAYLOAD_BYTES, ("127.0.0.1", port))
            turns += 1
            timer.set(first_ns + int(turns * SECOND_NS / rate))

        timer = TimerFd(self.loop, send)
        timer.set(first_ns)
        await asyncio.sleep((end_ns - time.monotonic_ns()) / 1e9)
        timer.close()


class TimerFdRelay(_Relay):
    """Holds packets in a heap, with one timerfd for the first."""

    def __init__(self, sock: socket.socket, hold_ns: int, begin_ns: int) -> None:
        super().__init__(sock, hold_ns, begin_ns)
        self.heap: list[tuple[int, bytes]] = []
        self.timer = TimerFd(self.loop, self._due)

    def hold(self, due_ns: int, packet: bytes) -> None:
        """Add the packet to the heap."""
        heappush(self.heap, (due_ns, packet))
        if self.heap[0][0] == due_ns:
            self.timer.set(due_ns)

    def _due(self) -> None:
        while self.heap and self.heap[0][0] <= time.monotonic_ns():
            self.deliver(*heappop(self.heap))
        if self.heap:
            self.timer.set(self.heap[0][0])


class CallAtRelay(_Relay):
    """Holds packets with the loop's `call_at`."""

    def hold(self, due_ns: int, packet: bytes) -> None:
        """Schedule the packet in the loop."""
        self.loop.call_at(due_ns / 1e9, self.deliver, due_ns, packet)


_RELAYS = {"timerfd": (TimerFdRelay, uvloop.run), "call_at": (CallAtRelay, asyncio.run)}


def relay(kind: str, pipe: Connection, rate: float, hold_ns: int) -> None:
    """A process that sends packets and holds received ones."""
    make, run = _RELAYS[kind]

    async def life() -> list[int]:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.setblocking(False)
            sock.bind(("127.0.0.1", 0))
            pipe.send(sock.getsockname()[1])
            ports, first_ns, begin_ns, end_ns = pipe.recv()
            running = make(sock, hold_ns, begin_ns)
            await running.talk(ports, first_ns, rate, end_ns)
            return running.errors

    pipe.send(run(life()))
    pipe.recv()
