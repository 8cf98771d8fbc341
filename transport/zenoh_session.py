"""The only module that imports zenoh: sessions of hub and agents, and an inbox that hands over to an asyncio loop."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zenoh

from ..errors import BadInput, RunFailed

_ADMIN_TIMEOUT_S = 5.0
_CONNECT_TIMEOUT_S = 20.0
_LEASE_MS = 60_000
LINK_QUEUE_BATCHES = 16
_WAIT_BEFORE_DROP_US = 100_000

Session = zenoh.Session
Query = zenoh.Query
Sample = zenoh.Sample
ZError = zenoh.ZError
PUT = zenoh.SampleKind.PUT


@dataclass(frozen=True)
class Credentials:
    """User name and password of a session."""

    user: str
    password: str


def _config(mode: str, **settings: Any) -> zenoh.Config:
    """A configuration without discovery; the argument `a__b` is the setting a/b."""
    config = zenoh.Config()
    config.insert_json5("mode", json.dumps(mode))
    shared = {
        "scouting__multicast__enabled": False,
        "scouting__gossip__enabled": False,
        "scouting__delay": 0,
        # frames are small, and a killed process would leave its pool behind
        "transport__shared_memory__enabled": False,
        "transport__link__tx__lease": _LEASE_MS,
        "transport__link__tx__queue__size__data": LINK_QUEUE_BATCHES,
        "transport__link__tx__queue__congestion_control__drop__wait_before_drop": _WAIT_BEFORE_DROP_US,
    }
    for key, value in (shared | settings).items():
        config.insert_json5(key.replace("__", "/"), json.dumps(value))
    return config


def open_hub(listen: str, access_control: Mapping[str, Any], passwords: Path) -> tuple[zenoh.Session, str]:
    """Open the session that routes between the agents, and return it with the endpoint at which it listens.

    Args:
        listen: endpoint, e.g. tcp/127.0.0.1:0 for a free port.
        access_control: Zenoh's `access_control` section.
        passwords: file of `user:password` lines.

    Raises:
        BadInput: the endpoint is in use or unusable.
    """
    config = _config(
        "router",
        listen__endpoints=[listen],
        adminspace__enabled=True,
        access_control=access_control,
        transport__auth__usrpwd__user="hub",
        transport__auth__usrpwd__password=passwords.name,
        transport__auth__usrpwd__dictionary_file=str(passwords),
    )
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise BadInput(
            f"cannot listen at {listen}: is the port in use? Choose another with --listen ({error})"
        ) from error
    for reply in session.get(f"@/{session.zid()}/router", timeout=_ADMIN_TIMEOUT_S):
        if reply.ok is not None:
            locators: list[str] = json.loads(reply.ok.payload.to_string())["locators"]
            return session, locators[0]
    session.close()
    raise RunFailed(f"the hub at {listen} does not say where it listens")


def open_client(endpoint: str, who: Credentials, timeout_s: float = _CONNECT_TIMEOUT_S) -> zenoh.Session:
    """Open the session of an agent or of the control client.

    Raises:
        RunFailed: no connection within the timeout: nothing listens there, or the credentials are refused.
    """
    config = _config(
        "client",
        connect__endpoints=[endpoint],
        connect__timeout_ms=int(timeout_s * 1000),
        transport__auth__usrpwd__user=who.user,
        transport__auth__usrpwd__password=who.password,
    )
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise RunFailed(f"{who.user} cannot join the hub at {endpoint}: {error}") from error


def publisher(session: zenoh.Session, key: str) -> zenoh.Publisher:
    """A publisher that batches messages, never blocks the loop, and does not publish to its own session."""
    return session.declare_publisher(
        key,
        express=False,
        congestion_control=zenoh.CongestionControl.DROP,
        allowed_destination=zenoh.Locality.REMOTE,
    )


def asked(query: Query) -> bytes:
    """Payload of a query, or empty bytes."""
    return b"" if query.payload is None else query.payload.to_bytes()


class Inbox:
    """Queue from Zenoh's threads to the loop, which is woken up once per batch."""

    def __init__(self, loop: asyncio.AbstractEventLoop, limit: int, drained: Callable[[list[Any]], None]) -> None:
        self._loop = loop
        self._limit = limit
        self._drained = drained
        self._queue: deque[Any] = deque()
        self._armed = False
        self.overflowed = 0

    def push(self, item: Any) -> None:
        """Add an item; called on Zenoh's threads."""
        if len(self._queue) >= self._limit:
            self.overflowed += 1
            return
        self._queue.append(item)
        if not self._armed:
            self._armed = True
            self._loop.call_soon_threadsafe(self._drain)

    def _drain(self) -> None:
        self._armed = False
        queue = self._queue
        items = [queue.popleft() for _ in range(len(queue))]
        if items:
            self._drained(items)


async def ask(session: zenoh.Session, key: str, payload: bytes, timeout_s: float) -> dict[str, bytes]:
    """Query every queryable that a key reaches; key → answer, of those that answered in time."""

    def get() -> dict[str, bytes]:
        replies = session.get(
            key,
            payload=payload,
            timeout=timeout_s,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
        )
        return {str(reply.ok.key_expr): reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None}

    return await asyncio.to_thread(get)
