"""The control server of a running swarm: answers the requests of `volery status`, `fault` and `stop`.

While a swarm runs, `control.json` in its run folder has endpoint and password, readable by its owner only.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import msgpack

from ...errors import VoleryError
from ...transport import zenoh_session as zs
from ...transport.keys import CONTROL_CLIENT, Keys
from ..record.run_files import CONTROL_FILE
from ..scenario.fault_labels import in_words
from ..whole_files import whole_file
from .live_faults import Injector
from .supervisor import Swarm

_LIMIT = 1000


class ControlServer:
    """Answers requests, one after another."""

    def __init__(self, swarm: Swarm, injector: Injector) -> None:
        self._swarm = swarm
        self._injector = injector
        self._requests: asyncio.Queue[zs.Query] = asyncio.Queue()

    async def serve(self, keys: Keys, folder: Path) -> None:
        """Answer requests until cancelled; the control file exists meanwhile."""
        await self._swarm.ready.wait()
        inbox = zs.Inbox(asyncio.get_running_loop(), _LIMIT, self._queue)
        serving = self._swarm.session.declare_queryable(keys.supervisor(), inbox.push)
        control = folder / CONTROL_FILE
        password = self._swarm.passwords[CONTROL_CLIENT]
        with whole_file(control) as partial:
            partial.touch(mode=0o600)
            partial.write_text(json.dumps({"run": keys.run, "endpoint": self._swarm.endpoint, "password": password}))
        try:
            while True:
                query = await self._requests.get()
                with query:
                    query.reply(query.key_expr, msgpack.packb(await self._answer(zs.asked(query))))
        finally:
            control.unlink(missing_ok=True)
            del serving

    def _queue(self, queries: list[zs.Query]) -> None:
        for query in queries:
            self._requests.put_nowait(query)

    async def _answer(self, payload: bytes) -> dict[str, Any]:
        request = msgpack.unpackb(payload)
        do = request.pop("do")
        actions: dict[str, Callable[[], Awaitable[Any]]] = {
            "status": self._status,
            "inject": lambda: self._injector.inject(request["fault"]),
            "clear": lambda: self._injector.clear(request["faults"]),
            "restart": lambda: self._injector.restart(request["agents"]),
            "resume": lambda: self._injector.resume(request["agents"]),
            "restore": lambda: self._injector.restore(request["links"], "cut"),
            "release": lambda: self._injector.restore(request["links"], "hold"),
            "stop": self._stop,
        }
        try:
            return {"result": await actions[do]()}
        except VoleryError as error:
            return {"error": str(error), "exit_code": error.exit_code}

    async def _status(self) -> dict[str, Any]:
        self._swarm.status.faults = in_words(self._injector.in_force(), len(self._swarm.plan.links))
        return self._swarm.status.to_dict()

    async def _stop(self) -> str:
        await self._swarm.stop()
        return "the run ends"
